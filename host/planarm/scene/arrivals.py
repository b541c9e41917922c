"""Obstacles that appear while an arm moves: a TOML file of `[[obstacles]]`, each with a time `at_s`, if it is known."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from planarm.errors import SceneError
from planarm.scene.load import parse_obstacle
from planarm.scene.strict_toml import Table
from planarm.scene.types import Obstacle


@dataclass(frozen=True, slots=True)
class Arrival:
    """An obstacle, and when it appears: seconds since the motion began."""

    at_s: float
    obstacle: Obstacle


def load_arrivals(path: Path) -> tuple[Arrival, ...]:
    """Read the file; an obstacle without `at_s` is there from the beginning.

    Raises:
        SceneError: it cannot be read, is not TOML, or is no list of obstacles.
    """
    source = str(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as problem:
        raise SceneError(source, "", f"cannot be read: {problem.strerror}; give a file of [[obstacles]]") from problem
    except ValueError as problem:  # not UTF-8, or not TOML
        raise SceneError(source, "", f"is not valid TOML: {problem}") from problem
    root = Table.with_keys(source, "", data, ("obstacles",))
    return tuple(_arrival(source, where, entry) for where, entry in root.tables("obstacles"))


def _arrival(source: str, where: str, entry: object) -> Arrival:
    shape = {key: value for key, value in entry.items() if key != "at_s"} if isinstance(entry, dict) else entry
    obstacle = parse_obstacle(source, where, shape)
    told = {"at_s": entry["at_s"]} if isinstance(entry, dict) and "at_s" in entry else {}
    at_s = Table(source, where, told).number("at_s", 0.0, at_least=0.0, at_most=1e6)
    return Arrival(at_s, obstacle)
