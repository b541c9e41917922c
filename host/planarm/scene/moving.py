"""Moving obstacles: the scene's table [moving] and each obstacle's table [obstacles.motion].

Motions are those of paper B, Fig. 4, and any polyline: an obstacle keeps its shape and its sense, and its displacement
from where it is drawn is linear in time between way-points. Along a leg of so many motion samples MS the speed is the
paper's dx / (MS Ts).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, dist, radians, sin
from typing import Literal

from planarm.scene.strict_toml import Table

MotionPath = Literal["straight", "square", "waypoints"]
Turn = Literal["left", "right"]
Smoothing = Literal["none", "pso"]

MOVING_KEYS = ("sample_s", "samples", "delay_margin_s", "smoothing", "via_points")
MOTION_OF_KEYS: dict[MotionPath, tuple[str, ...]] = {
    "straight": ("path", "by_cm", "motion_samples", "repeat"),
    "square": ("path", "side_cm", "heading_deg", "turn", "motion_samples", "repeat"),
    "waypoints": ("path", "offsets_cm", "times_s", "at_samples", "repeat"),
}
OBSTACLE_MOTION_KEYS = tuple(dict.fromkeys(key for keys in MOTION_OF_KEYS.values() for key in keys))
PATHS: tuple[MotionPath, ...] = ("straight", "square", "waypoints")
TURNS: tuple[Turn, ...] = ("left", "right")
SMOOTHINGS: tuple[Smoothing, ...] = ("none", "pso")

LARGEST_CM = 10_000.0
SMALLEST_SAMPLE_S = 0.001
LARGEST_SAMPLE_S = 60.0
MOST_SAMPLES = 2_000
MOST_VIA_POINTS = 40
SAME_CM = 1e-9


@dataclass(frozen=True, slots=True)
class MovingSpec:
    """How time is divided, and what plans among moving obstacles keep."""

    sample_s: float
    """Ts: the time of one motion sample, in which the arm makes one move."""
    samples: int
    """Motion samples that are looked at: the horizon."""
    delay_margin_s: float = 0.02
    """Each pose of a plan stays free from its time to this much later."""
    smoothing: Smoothing = "none"
    via_points: int = 5
    """Points of the path that a particle swarm moves."""

    @property
    def horizon_s(self) -> float:
        """The time that is looked at."""
        return self.samples * self.sample_s


@dataclass(frozen=True, slots=True)
class ObstacleMotion:
    """An obstacle's displacement over time: linear between way-points, resting after the last unless it repeats."""

    times_s: tuple[float, ...]
    """Ascending from 0."""
    offsets_cm: tuple[tuple[float, float], ...]
    """Displacement from where the obstacle is drawn at each time; the first is (0, 0)."""
    repeat: bool
    """True when it begins again at its end, where it is back at (0, 0)."""

    @property
    def fastest_cm_s(self) -> float:
        """The greatest speed."""
        legs = zip(pairwise(self.times_s), pairwise(self.offsets_cm), strict=True)
        return max(dist(a, b) / (until - since) for (since, until), (a, b) in legs)


def read_moving(root: Table, on_roadmap: bool) -> MovingSpec | None:
    """Return the values of [moving] of a whole file, None where it is missing.

    Raises:
        SceneError: they are none; or the planner works on a roadmap, which knows obstacles at rest only.
    """
    if "moving" not in root.data:
        return None
    if on_roadmap:
        root.fail("moving", "a roadmap is planned among obstacles at rest; take another planner.algorithm")
    table = root.table("moving", MOVING_KEYS)
    default = MovingSpec(1.0, 1)
    return MovingSpec(
        sample_s=table.number("sample_s", at_least=SMALLEST_SAMPLE_S, at_most=LARGEST_SAMPLE_S),
        samples=table.integer("samples", at_least=1, at_most=MOST_SAMPLES),
        delay_margin_s=table.number("delay_margin_s", default.delay_margin_s, at_least=0.0, at_most=LARGEST_SAMPLE_S),
        smoothing=table.choice("smoothing", SMOOTHINGS, default.smoothing),
        via_points=table.integer("via_points", default.via_points, at_least=1, at_most=MOST_VIA_POINTS),
    )


def read_obstacle_motion(entry: Table, moving: MovingSpec | None) -> ObstacleMotion | None:
    """Return the motion of the obstacle that a table describes, None where it rests.

    Raises:
        SceneError: it has a motion, but the scene has no table [moving]; or the motion is none.
    """
    if "motion" not in entry.data:
        return None
    if moving is None:
        entry.fail("motion", "needs a table [moving] with sample_s and samples, the duration of a motion sample")
    path = entry.table("motion", OBSTACLE_MOTION_KEYS).choice("path", PATHS)
    table = entry.table("motion", MOTION_OF_KEYS[path])
    read = {"straight": _straight, "square": _square, "waypoints": _waypoints}[path]
    return read(table, moving.sample_s)


def _straight(table: Table, sample_s: float) -> ObstacleMotion:
    by = table.point("by_cm", within=LARGEST_CM)
    repeat = table.flag("repeat", False)
    corners = [(0.0, 0.0), by, (0.0, 0.0)] if repeat else [(0.0, 0.0), by]
    return _even_legs(table, corners, sample_s, repeat)


def _square(table: Table, sample_s: float) -> ObstacleMotion:
    side = table.number("side_cm", above=0.0, at_most=LARGEST_CM)
    heading = radians(table.number("heading_deg", 0.0, at_least=-360.0, at_most=360.0))
    along = (side * cos(heading), side * sin(heading))
    sense = 1.0 if table.choice("turn", TURNS, "left") == "left" else -1.0
    aside = (-sense * along[1], sense * along[0])
    corners = [(0.0, 0.0), along, (along[0] + aside[0], along[1] + aside[1]), aside, (0.0, 0.0)]
    return _even_legs(table, corners, sample_s, table.flag("repeat", True))


def _even_legs(table: Table, corners: Sequence[tuple[float, float]], sample_s: float, repeat: bool) -> ObstacleMotion:
    """Return the motion from corner to corner, `motion_samples` for each leg."""
    leg_s = sample_s * table.integer("motion_samples", at_least=1, at_most=MOST_SAMPLES)
    return ObstacleMotion(tuple(leg_s * i for i in range(len(corners))), tuple(corners), repeat)


def _waypoints(table: Table, sample_s: float) -> ObstacleMotion:
    """Return the motion through given displacements at given times or samples; (0, 0) at time 0 goes before them."""
    offsets = table.points("offsets_cm", within=LARGEST_CM)
    key = "at_samples" if "at_samples" in table.data else "times_s"
    if key == "at_samples" and "times_s" in table.data:
        table.fail(key, "is given beside times_s; give one of them")
    times = [value * (sample_s if key == "at_samples" else 1.0) for value in table.numbers(key, at_least=0.0)]
    if len(times) != len(offsets):
        table.fail(key, f"{len(times)} given, one for each of the {len(offsets)} offsets_cm expected")
    if times[0] > 0.0:
        times, offsets = [0.0, *times], ((0.0, 0.0), *offsets)
    if max(map(abs, offsets[0])) > SAME_CM:
        table.fail("offsets_cm", "the first is at time 0 and must be [0, 0]: there the obstacle is where it is drawn")
    if len(times) < 2 or any(b <= a for a, b in pairwise(times)):
        table.fail(key, f"{times} s are not ascending, with at least one time above 0")
    repeat = table.flag("repeat", False)
    if repeat and max(map(abs, offsets[-1])) > SAME_CM:
        table.fail("repeat", "is true, so the last of offsets_cm must be [0, 0] again")
    return ObstacleMotion(tuple(times), tuple(offsets), repeat)
