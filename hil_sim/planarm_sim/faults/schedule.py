"""Schedules of what goes wrong: TOML files read strictly into values.

::

    seed = 7                     # of every random draw
    zero = "first_step"          # what at_s counts from: the first step pulse, or "power_up"

    [[faults]]
    kind = "line.drop"
    at_s = 0.1
    for_s = 0.5                  # without it: to the end
    direction = "to_board"       # "to_host", or "both", which is the default
    share = 0.02                 # of the bytes

docs/faults.md lists every kind with its settings. A table `expected` is for tests that say what should come of it.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn

from planarm_sim.errors import FaultError

__all__ = ["KINDS", "Fault", "Schedule", "load_schedule", "parse_schedule"]

Zero = Literal["first_step", "power_up"]


@dataclass(frozen=True, slots=True)
class Setting:
    """A key of a kind: its type, its range, and its default; None: it must be given."""

    kind: type
    least: float = 0.0
    most: float = 0.0
    default: float | str | None = None
    choices: tuple[str, ...] = ()


_SHARE = Setting(float, 0.0, 1.0)
_DIRECTION = Setting(str, default="both", choices=("to_board", "to_host", "both"))
_NUMBER = Setting(int, 1, 16)
_TORQUE = Setting(float, -1e4, 1e4)

KINDS: Mapping[str, Mapping[str, Setting]] = {
    "line.drop": {"direction": _DIRECTION, "share": _SHARE},
    "line.flip": {"direction": _DIRECTION, "share": _SHARE},
    "line.duplicate": {"direction": _DIRECTION, "share": _SHARE},
    "line.delay": {"direction": _DIRECTION, "share": _SHARE, "by_s": Setting(float, 0.0, 60.0)},
    "line.burst": {"direction": _DIRECTION, "bytes": Setting(int, 1, 10_000)},
    "line.unplug": {},
    "line.wrong_baud": {"baud": Setting(int, 300, 2_000_000)},
    "power.brown_out": {},
    "power.reset": {},
    "power.motor_supply": {},
    "mechanics.stall": {"joint": _NUMBER},
    "mechanics.friction": {"joint": _NUMBER, "torque_nm": Setting(float, 0.0, 1e4)},
    "mechanics.bump": {"joint": _NUMBER, "torque_nm": _TORQUE},
    "mechanics.limit_switch": {
        "switch": _NUMBER,
        "state": Setting(str, choices=("stuck_open", "stuck_closed", "bouncing")),
    },
    "mechanics.stop_input": {},
    "host.pause": {},
    "host.killed": {},
}
"""Every kind of fault with its settings beside at_s and for_s; joints and switches are counted from 1."""

MOMENTARY = ("line.burst", "power.brown_out", "power.reset", "host.killed")
"""Kinds that happen at a moment; they take no for_s."""
LASTING = ("mechanics.bump", "host.pause")
"""Kinds that need a for_s."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that goes wrong.

    Attributes:
        kind: one of KINDS.
        at_s: when it begins, from the schedule's zero.
        for_s: how long it lasts; None: to the end.
        settings: the kind's own, defaults filled in.
    """

    kind: str
    at_s: float
    for_s: float | None
    settings: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Schedule:
    """Everything that goes wrong in a run.

    Attributes:
        source: where it is from.
        seed: of every random draw.
        zero: what `at_s` counts from.
        faults: in the order of the file.
    """

    source: str
    seed: int
    zero: Zero
    faults: tuple[Fault, ...]


def load_schedule(path: str | Path, seed: int | None = None) -> Schedule:
    """Read a schedule's file; `seed` replaces its own.

    Raises:
        FaultError: it cannot be read, or is no schedule.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise FaultError(f"{path}: cannot be read: {problem}; give the path of a schedule of faults") from problem
    return parse_schedule(text, str(path), seed)


def parse_schedule(text: str, source: str, seed: int | None = None) -> Schedule:
    """Read a schedule from TOML text; `source` names it in errors, `seed` replaces its own.

    Raises:
        FaultError: it is no schedule; the message names key, value and what is expected.
    """
    try:
        data = tomllib.loads(text)
    except ValueError as problem:
        raise FaultError(f"{source}: is not valid TOML: {problem}") from problem
    _require_known(source, "", data, ("seed", "zero", "faults", "expected"))
    zero = data.get("zero", "first_step")
    if zero not in ("first_step", "power_up"):
        _reject(source, "zero", zero, "'first_step' or 'power_up'")
    own_seed = data.get("seed", 0)
    if not _is(own_seed, int) or own_seed < 0:
        _reject(source, "seed", own_seed, "a whole number from 0 on")
    entries = data.get("faults", [])
    if not isinstance(entries, list):
        _reject(source, "faults", entries, "an array of tables: write [[faults]]")
    faults = tuple(_fault(source, f"faults[{i}]", entry) for i, entry in enumerate(entries, 1))
    return Schedule(source, own_seed if seed is None else seed, zero, faults)


def _fault(source: str, place: str, entry: Any) -> Fault:  # noqa: ANN401 - it comes from a file
    if not isinstance(entry, dict):
        _reject(source, place, entry, "a table")
    kind = str(entry.get("kind"))
    if kind not in KINDS:
        close = difflib.get_close_matches(kind, KINDS, n=1, cutoff=0.0)[0]
        _reject(source, f"{place}.kind", kind, f"one of {', '.join(KINDS)} (closest: {close})")
    own = KINDS[kind]
    times = ("at_s",) if kind in MOMENTARY else ("at_s", "for_s")
    _require_known(source, place, entry, ("kind", *times, *own))
    at_s = _number(source, f"{place}.at_s", entry.get("at_s", 0.0), Setting(float, 0.0, 1e6))
    for_s = None
    if "for_s" in entry or kind in LASTING:
        for_s = _number(source, f"{place}.for_s", entry.get("for_s"), Setting(float, 0.0, 1e6))
    settings = {
        key: _setting(source, f"{place}.{key}", entry.get(key, setting.default), setting)
        for key, setting in own.items()
    }
    return Fault(kind, at_s, for_s, settings)


def _setting(source: str, place: str, value: Any, setting: Setting) -> float | str:  # noqa: ANN401 - from a file
    if setting.kind is str:
        if value not in setting.choices:
            _reject(source, place, value, f"one of {', '.join(map(repr, setting.choices))}")
        return str(value)
    return _number(source, place, value, setting)


def _number(source: str, place: str, value: Any, setting: Setting) -> float:  # noqa: ANN401 - from a file
    kinds = int if setting.kind is int else (int, float)
    if not _is(value, kinds) or not setting.least <= value <= setting.most:
        noun = "a whole number" if setting.kind is int else "a number"
        _reject(source, place, value, f"{noun} from {setting.least:g} to {setting.most:g}")
    return int(value) if setting.kind is int else float(value)


def _is(value: object, kinds: type | tuple[type, ...]) -> bool:
    return isinstance(value, kinds) and not isinstance(value, bool)


def _require_known(source: str, place: str, table: Mapping[str, Any], keys: tuple[str, ...]) -> None:
    for key in table:
        if key not in keys:
            close = difflib.get_close_matches(key, keys, n=1, cutoff=0.0)[0]
            where = f"{place}.{key}" if place else key
            raise FaultError(f"{source}: {where}: unknown key; it takes {', '.join(keys)} (closest: {close})")


def _reject(source: str, place: str, value: object, wanted: str) -> NoReturn:
    given = "missing" if value is None else f"{value!r} given"
    raise FaultError(f"{source}: {place}: {given}, {wanted} expected")
