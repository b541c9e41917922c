"""`[task]`: where the end effector starts and where it is to go, as points or, on a roadmap, as joint angles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from math import cos, radians, sin

from planarm.scene.strict_toml import Table

TASK_KEYS = ("start_cm", "goal_cm", "start_deg", "goal_deg")

Point = tuple[float, float]
Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class TaskSpec:
    """Start and goal of the end effector; with joint angles given, the points are where these put it."""

    start_cm: Point
    goal_cm: Point
    start_rad: tuple[float, ...] | None = None
    goal_rad: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class TaskLimits:
    """What start and goal are held against, out of other tables."""

    x_cm: Range
    y_cm: Range
    within_cm: float
    link_lengths_cm: tuple[float, ...]
    base_cm: Point
    joint_limits_rad: tuple[Range, ...]
    joint_space: bool
    """True when the planner goes from pose to pose."""


def parse_task(table: Table, limits: TaskLimits) -> TaskSpec:
    """Read the table.

    Raises:
        SceneError: a point is outside the workspace; angles are not one a joint, or outside the joints' limits, or the
            planner goes from point to point; an end is given twice or not at all.
    """
    ends = [_end(table, name, limits) for name in ("start", "goal")]
    return TaskSpec(ends[0][0], ends[1][0], ends[0][1], ends[1][1])


def _end(table: Table, name: str, limits: TaskLimits) -> tuple[Point, tuple[float, ...] | None]:
    key, by_angles = f"{name}_cm", f"{name}_deg"
    joints = len(limits.link_lengths_cm)
    if by_angles not in table.data:
        if joints != 2:
            table.fail(
                by_angles, f"missing: an arm with {joints} links has many poses at a point; give {joints} angles"
            )
        return _point(table, key, limits), None
    if key in table.data:
        table.fail(by_angles, f"the {name} is given by task.{key} already; keep one of them")
    if not limits.joint_space:
        table.fail(by_angles, "angles are taken by planners on a roadmap; give task.start_cm and task.goal_cm")
    angles_deg = table.each(by_angles, [0.0] * joints, at_least=-720.0, at_most=720.0)
    angles = tuple(radians(angle) for angle in angles_deg)
    for joint, (angle, (low, high)) in enumerate(zip(angles, limits.joint_limits_rad, strict=True), 1):
        if not low <= angle <= high:
            table.reject(by_angles, list(angles_deg), f"joint {joint} within arm.joint_limits_deg")
    return _tip_cm(angles, limits), angles


def _point(table: Table, key: str, limits: TaskLimits) -> Point:
    point = table.point(key, within=limits.within_cm)
    for axis, value, (low, high) in zip("xy", point, (limits.x_cm, limits.y_cm), strict=True):
        if not low <= value <= high:
            table.reject(key, list(point), f"{axis} from {low:g} to {high:g} (workspace.{axis}_cm)")
    return point


def _tip_cm(angles_rad: tuple[float, ...], limits: TaskLimits) -> Point:
    x, y = limits.base_cm
    for length, heading in zip(limits.link_lengths_cm, accumulate(angles_rad), strict=True):
        x, y = x + length * cos(heading), y + length * sin(heading)
    return x, y
