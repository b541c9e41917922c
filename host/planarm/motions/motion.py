"""The fastest motion along a route, before it is made steps."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from planarm.errors import TimingError
from planarm.fastest.task import fastest_path
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.notice import Notice
from planarm.routes.gentle import ROOM_CM, gentle_motion, jerk_limits
from planarm.routes.route import Route
from planarm.scene import Scene
from planarm.search.path import Path as TipPath
from planarm.stepping.schedule import encode, schedule
from planarm.stepping.slowing import SpeedLimit, road_ticks
from planarm.trajectory.binding import TimingReport, report_timing
from planarm.trajectory.jerk import Mean
from planarm.trajectory.limits import Limits
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.timing import fastest_motion
from planarm_wire.messages import TICKS_HZ

CURVE_POINTS = 400
"""Positions by which the curve of a motion is told in reports."""

LONGEST_MOTION_S = 600.0
"""The certificate looks at a motion every 0.1 ms; beyond ten minutes that takes gigabytes."""


@dataclass(frozen=True, slots=True)
class Motion:
    """The fastest motion along a route, before it is made steps.

    Attributes:
        trajectory: it.
        under: the same under a further limit of its speed, or as it is.
        timing: what holds it back.
        path: the tip's, and `bound_cm` what none is shorter than; an optimised path has another tip and no bound.
    """

    trajectory: Trajectory
    under: Callable[[SpeedLimit | None], Trajectory]
    timing: TimingReport
    path: TipPath
    bound_cm: float | None
    mean: Mean | None = None
    """Of what it is the mean, where jerk is limited."""


def motion_along(scene: Scene, route: Route, margin_cm: float, notice: Notice) -> Motion:
    """Time a route, optimise its path for duration where that is asked for, and keep the limits of jerk."""
    limits = Limits.of(scene)
    trajectory, path, bound_cm = fastest_motion(route.smooth, limits), route.path, route.bound_cm
    if scene.planner.objective == "time":
        trajectory = optimised(scene, margin_cm, trajectory, limits, notice)
        path, bound_cm = TipPath.through(tip_curve_cm(trajectory, Arm.from_spec(scene.arm)), path.elbow), None
    timing, jerks = report_timing(trajectory, limits), jerk_limits(scene)
    if jerks is None or trajectory.duration_s <= 0.0:
        return Motion(trajectory, lambda limit: timed(scene, trajectory, limits, limit), timing, path, bound_cm)
    # Not timed anew: where a stop lacks road, the device slows down by itself.
    made = gentle_motion(scene, margin_cm - ROOM_CM, trajectory, limits, jerks)
    gentle = made.trajectory
    timing = replace(timing, duration_s=gentle.duration_s, executed_s=gentle.duration_s)
    return Motion(gentle, lambda _limit: timed(scene, gentle, limits, None), timing, path, bound_cm, made.mean)


def timed(scene: Scene, fastest: Trajectory, limits: Limits, limit: SpeedLimit | None) -> Trajectory:
    """Return the motion along a path timed before, under a further limit of its speed.

    Raises:
        TimingError: It takes too long to be looked at.
    """
    trajectory = fastest if limit is None else fastest_motion(fastest.path, limits, limit)
    if trajectory.duration_s > LONGEST_MOTION_S:
        raise TimingError(
            f"{scene.source}: the motion would take {trajectory.duration_s:.6g} s, {LONGEST_MOTION_S:g} s are the "
            "most; raise joints.max_speed_deg_s or joints.max_acceleration_deg_s2, or move task.goal_cm nearer"
        )
    return trajectory


def optimised(scene: Scene, margin_cm: float, known: Trajectory, limits: Limits, notice: Notice) -> Trajectory:
    """Optimise the path itself for duration; return the known motion when no faster one is found within the budget.

    Both are compared as they will be executed, slowed down where a stop does not fit (docs/decisions/0107).
    """
    road_s = road_ticks(encode(scene, known)[1]) / TICKS_HZ
    spline = fastest_path(
        scene, margin_cm, known.path, limits, road_s, time.perf_counter, lambda share, _s: notice("optimise", share)
    )
    notice("optimise", 1.0)
    if spline is None:
        return known
    motions = known, fastest_motion(spline, limits)
    return min(motions, key=lambda motion: _executed_s(scene, motion, limits))


def _executed_s(scene: Scene, motion: Trajectory, limits: Limits) -> float:
    """Return how long a motion lasts as it will be executed; for ever, where no timing of it can be."""
    try:
        return schedule(scene, partial(timed, scene, motion, limits))[0].duration_s
    except TimingError:
        return np.inf


def tip_curve_cm(trajectory: Trajectory, arm: Arm) -> NDArray[np.float64]:
    """Return positions of the tip along a motion, shape (m, 2), for reports."""
    s = np.linspace(trajectory.s[0], trajectory.s[-1], CURVE_POINTS)
    return np.asarray(forward(arm, trajectory.path.evaluate(s).q_rad)[:, -1])
