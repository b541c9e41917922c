"""Strict reading of TOML tables: every key is known, every value has the type and range that was asked for.

Each error names the file, the dotted key with tables counted from 1, the value given and what is expected instead.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from sys import float_info
from typing import NoReturn, Self, TypeVar

from planarm.errors import SceneError

T = TypeVar("T", bound=str)

UNITS = {
    "cm": "centimetres",
    "deg": "degrees",
    "deg_s": "degrees per second",
    "deg_s2": "degrees per second squared",
    "kg": "kilograms",
    "kg_m2": "kilogram square metres",
    "g_cm2": "gram square centimetres",
    "nm": "newton metres",
    "nm_s": "newton metres for 1 rad/s",
    "nm_rad": "newton metres for 1 rad",
    "nm_a": "newton metres for 1 ampere",
    "v_rad": "volts for 1 rad",
    "v_s_rad": "volts for 1 rad/s",
    "a": "amperes",
    "v": "volts",
    "ohm": "ohms",
    "mh": "millihenries",
    "ms": "milliseconds",
    "s": "seconds",
}
"""The unit suffixes that keys of a scene end in."""

OTHER_UNITS = (
    "mm",
    "m",
    "in",
    "inch",
    "rad",
    "rad_s",
    "rad_s2",
    "rev_s",
    "rpm",
    "turns",
    "g",
    "ncm",
    "ma",
    "h",
    "uh",
    *UNITS,
)
"""Suffixes that tell a key with the wrong unit from a key with the wrong name."""


@dataclass(frozen=True, slots=True)
class Table:
    """A TOML table with known keys; `path` is its dotted key, empty for the whole file."""

    source: str
    path: str
    data: Mapping[str, object]

    @classmethod
    def with_keys(cls, source: str, path: str, data: object, keys: Sequence[str]) -> Self:
        """Return the table `data`, all of whose keys are among `keys`.

        Raises:
            SceneError: `data` is no table, or has a key that is not known.
        """
        if not isinstance(data, dict):
            raise SceneError(source, path, f"{shown(data)} given, a table expected: write [{path}] above its keys")
        table = cls(source, path, data)
        for key in data:
            if key not in keys:
                table.fail(key, _unknown(key, keys))
        return table

    def name_of(self, key: str) -> str:
        """Return the dotted key of one of this table's keys."""
        return f"{self.path}.{key}" if self.path else key

    def fail(self, key: str, problem: str) -> NoReturn:
        """Raise the SceneError that names this table's key."""
        raise SceneError(self.source, self.name_of(key), problem)

    def reject(self, key: str, value: object, wanted: str) -> NoReturn:
        """Raise the SceneError for a value that is not what is wanted."""
        self.fail(key, f"{shown(value)} given, {wanted} expected")

    def table(self, key: str, keys: Sequence[str], *, optional: bool = False) -> "Table":
        """Return the table at `key`; an optional one that is missing is empty."""
        if key not in self.data and not optional:
            self.fail(key, f"missing: write a table [{key}] with {_listed(keys)}")
        return Table.with_keys(self.source, self.name_of(key), self.data.get(key, {}), keys)

    def tables(self, key: str) -> list[tuple[str, object]]:
        """Return (path, data) of each entry of the array of tables at `key`, counted from 1; none when missing."""
        entries = self.data.get(key, [])
        if not isinstance(entries, list):
            self.reject(key, entries, f"an array of tables (write [[{key}]] with two brackets)")
        return [(f"{self.name_of(key)}[{i}]", entry) for i, entry in enumerate(entries, 1)]

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        above: float | None = None,
        at_least: float | None = None,
        at_most: float | None = None,
    ) -> float:
        """Return the finite number at `key`, within the limits."""
        limits = _Limits(above, at_least, at_most)
        wanted = f"a number{limits.words}{_unit_words(key)}"
        return self._number(key, self._value(key, default, wanted), wanted, limits)

    def integer(self, key: str, default: int | None = None, *, at_least: int, at_most: int) -> int:
        """Return the whole number at `key`, within the limits."""
        wanted = f"a whole number from {at_least} to {at_most}"
        value = self._value(key, default, wanted)
        if isinstance(value, bool) or not isinstance(value, int) or not at_least <= value <= at_most:
            self.reject(key, value, wanted)
        return value

    def flag(self, key: str, default: bool | None = None) -> bool:
        """Return the true or false at `key`."""
        value = self._value(key, default, "true or false")
        if not isinstance(value, bool):
            self.reject(key, value, "true or false")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return the text at `key`, which is not empty."""
        value = self._value(key, default, "a text in quotes")
        if not isinstance(value, str) or not value.strip():
            self.reject(key, value, "a text in quotes, not empty,")
        return value

    def choice(self, key: str, choices: Sequence[T], default: T | None = None) -> T:
        """Return the one of `choices` that stands at `key`."""
        wanted = "one of " + ", ".join(repr(c) for c in choices)
        value = self._value(key, default, wanted)
        match = next((candidate for candidate in choices if candidate == value), None)
        if match is None:
            close = get_close_matches(value, choices, 1) if isinstance(value, str) else []
            self.reject(key, value, wanted + (f" (did you mean {close[0]!r}?)" if close else ""))
        return match

    def numbers(
        self, key: str, *, above: float | None = None, at_least: float | None = None, at_most: float | None = None
    ) -> tuple[float, ...]:
        """Return the list of numbers at `key`, each within the limits, at least one."""
        limits = _Limits(above, at_least, at_most)
        wanted = f"a list of numbers{limits.words}{_unit_words(key)}"
        return self._numbers(key, self._value(key, None, wanted), wanted, limits)

    def each(
        self,
        key: str,
        default: Sequence[float],
        *,
        above: float | None = None,
        at_least: float | None = None,
        at_most: float | None = None,
    ) -> tuple[float, ...]:
        """Return the list at `key` with one number a link or joint, as many as the default has."""
        if key not in self.data:
            return tuple(default)
        numbers = self.numbers(key, above=above, at_least=at_least, at_most=at_most)
        if len(numbers) != len(default):
            self.reject(key, list(numbers), f"{len(default)} numbers, one for each link from the base,")
        return numbers

    def point(self, key: str, default: tuple[float, float] | None = None, *, within: float) -> tuple[float, float]:
        """Return the pair of numbers at `key`, each from -within to within."""
        wanted = f"[x, y]{_unit_words(key)}, each from {-within:g} to {within:g},"
        return self._pair(key, self._value(key, default, wanted), wanted, within)

    def points(self, key: str, *, within: float) -> tuple[tuple[float, float], ...]:
        """Return the list of pairs at `key`, each number from -within to within."""
        wanted = f"a list of [x, y]{_unit_words(key)}, each from {-within:g} to {within:g},"
        return tuple(
            self._pair(key, p, wanted, within) for p in self._list(key, self._value(key, None, wanted), wanted)
        )

    def range(self, key: str, *, within: float) -> tuple[float, float]:
        """Return the [least, greatest] at `key`, from -within to within and not empty."""
        wanted = _wanted_range(key, within)
        return self._range(key, self._value(key, None, wanted), wanted, within)

    def ranges(
        self, key: str, default: Sequence[tuple[float, float]], *, within: float
    ) -> tuple[tuple[float, float], ...]:
        """Return the list of [least, greatest] at `key`."""
        wanted = f"a list of {_wanted_range(key, within)}"
        return tuple(
            self._range(key, r, wanted, within) for r in self._list(key, self._value(key, default, wanted), wanted)
        )

    def _value(self, key: str, default: object, wanted: str) -> object:
        if key in self.data:
            return self.data[key]
        if default is None:
            self.fail(key, f"missing: give {wanted.rstrip(',')}")
        return default

    def _number(self, key: str, value: object, wanted: str, limits: "_Limits") -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not limits.allow(value):
            self.reject(key, value, wanted)
        return float(value)

    def _numbers(self, key: str, value: object, wanted: str, limits: "_Limits") -> tuple[float, ...]:
        return tuple(self._number(key, entry, wanted, limits) for entry in self._list(key, value, wanted))

    def _list(self, key: str, value: object, wanted: str) -> Sequence[object]:
        if not isinstance(value, list | tuple) or not value:
            self.reject(key, value, wanted)
        return value

    def _pair(self, key: str, value: object, wanted: str, within: float) -> tuple[float, float]:
        numbers = self._numbers(key, value, wanted, _Limits(at_least=-within, at_most=within))
        if len(numbers) != 2:
            self.reject(key, value, wanted)
        return numbers[0], numbers[1]

    def _range(self, key: str, value: object, wanted: str, within: float) -> tuple[float, float]:
        least, greatest = self._pair(key, value, wanted, within)
        if least >= greatest:
            self.reject(key, value, wanted)
        return least, greatest


@dataclass(frozen=True, slots=True)
class _Limits:
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None

    def allow(self, value: float) -> bool:
        """Tell whether a number is finite and within the limits."""
        return (
            abs(value) <= float_info.max  # false for NaN and infinity
            and (self.above is None or value > self.above)
            and (self.at_least is None or value >= self.at_least)
            and (self.at_most is None or value <= self.at_most)
        )

    @property
    def words(self) -> str:
        """The limits as words that follow a noun."""
        named = (("above", self.above), ("at least", self.at_least), ("at most", self.at_most))
        given = [f"{word} {limit:g}" for word, limit in named if limit is not None]
        return " " + " and ".join(given) if given else ""


def shown(value: object) -> str:
    """Return a value as it stands in the file, shortened."""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _unknown(key: str, keys: Sequence[str]) -> str:
    """Say what is wrong with a key that is not known."""
    for known in keys:
        unit = unit_of(known)
        stem = known.removesuffix(f"_{unit}")
        if unit and key in (stem, *(f"{stem}_{other}" for other in OTHER_UNITS)):
            return f"wrong unit: {known!r} expected, in {UNITS[unit]}"
    if key.startswith("radius") and "diameter_cm" in keys:
        return f"unknown key; 'diameter_cm' expected, twice the radius, in {UNITS['cm']}"
    close = get_close_matches(key, keys, 1)
    listed = f"he keys here are {_listed(keys)}"
    return f"unknown key; did you mean {close[0]!r}? T{listed}" if close else f"unknown key; t{listed}"


def unit_of(key: str) -> str:
    """Return the unit suffix of a key, empty when it has none."""
    return next((unit for unit in sorted(UNITS, key=len, reverse=True) if key.endswith(f"_{unit}")), "")


def _unit_words(key: str) -> str:
    unit = unit_of(key)
    return f" in {UNITS[unit]}" if unit else ""


def _wanted_range(key: str, within: float) -> str:
    return f"[least, greatest]{_unit_words(key)}, least below greatest, both from {-within:g} to {within:g},"


def _listed(keys: Sequence[str]) -> str:
    return ", ".join(keys)
