"""Checks of parsed TOML: each raises SpecError with the place in the file and what is wrong there."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Any, Final

from planarm_wire.errors import SpecError

_NAME: Final = re.compile(r"[a-z][a-z0-9_]*")


def table_of(
    value: object,
    place: str,
    needed: Mapping[str, type],
    optional: Mapping[str, type] | None = None,
    may_be_empty: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Check that `value` is a table of exactly these keys and types; strings must say something."""
    if not isinstance(value, dict):
        raise SpecError(f"{place}: not a table")
    types = {**needed, **(optional or {})}
    check_keys(value, place, types, needed)
    for key, item in value.items():
        if not isinstance(item, types[key]) or isinstance(item, bool):
            raise SpecError(f"{place}.{key}: {item!r} is not of type {types[key].__name__}")
        if isinstance(item, str) and not item.strip() and key not in may_be_empty:
            raise SpecError(f"{place}.{key}: empty")
    return value


def check_keys(
    table: Mapping[str, Any], place: str, allowed: Iterable[str], needed: Iterable[str] | None = None
) -> None:
    """Check that `table` has no key but the allowed, and all the needed (by default all the allowed)."""
    allowed = tuple(allowed)
    for key in table:
        if key not in allowed:
            raise SpecError(f"{place}: unknown key {key!r}{suggestion(key, allowed)}")
    for key in allowed if needed is None else needed:
        if key not in table:
            raise SpecError(f"{place}: {key} is missing")


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return the end of a message that offers the nearest known word, or nothing."""
    close = difflib.get_close_matches(word, list(known), n=1)
    return f"; did you mean {close[0]!r}?" if close else ""


def checked_name(name: str, place: str) -> str:
    """Return `name` if it can be a name in C, Python and TOML alike."""
    if not _NAME.fullmatch(name):
        raise SpecError(f"{place}: {name!r} is no name of small letters, digits and underscores")
    return name


def check_range(value: object, low: int, high: int, place: str) -> None:
    """Check that `value` is a whole number from `low` to `high`, both included."""
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise SpecError(f"{place}: {value!r} is outside {low} .. {high}")


def check_different(values: Iterable[object], place: str) -> None:
    """Check that no value stands there twice."""
    seen: set[object] = set()
    for value in values:
        if value in seen:
            raise SpecError(f"{place}: {value!r} stands there twice")
        seen.add(value)
