"""The cost of a particle: the length of its curve, or none when it cannot be moved along at its times."""

from math import atan2, floor, hypot, inf, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.model.moving import MovingSet, gap_in_span
from planarm.workspace.world import (
    FREE,
    TwoLinkArm,
    elbow_from_base,
    floor_clearance,
    region_at,
    theta2_at,
    within_limits,
)
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]


class Pace(NamedTuple):
    """When the points of a curve are passed, and what the joints can do."""

    step_s: float
    """Time from each point to the next."""
    delay_s: float
    speeds_rad_s: tuple[float, float]
    """Infinite when the joints are not limited."""
    accelerations_rad_s2: tuple[float, float]


@kernel
def curve_costs(
    arm: TwoLinkArm, moving: MovingSet, pace: Pace, tips_cm: Floats, bars_cm: Floats, costs: Floats
) -> None:
    """Fill the length of each particle's curve, infinite when it is infeasible or no shorter than its bar.

    Args:
        arm: the arm with the margin to keep.
        moving: the obstacles.
        pace: the times and limits.
        tips_cm: points of each curve, evenly spaced in time, the first at time 0, shape (particles, m, 2).
        bars_cm: what each must be shorter than, shape (particles,).
        costs: filled, shape (particles,).
    """
    q_rad = np.empty((tips_cm.shape[1], 2))
    for p in range(tips_cm.shape[0]):
        tips = tips_cm[p]
        length = 0.0
        for j in range(1, tips.shape[0]):
            length += hypot(tips[j, 0] - tips[j - 1, 0], tips[j, 1] - tips[j - 1, 1])
        costs[p] = inf
        if length < bars_cm[p] and _free(arm, moving, pace, tips, q_rad) and _can_follow(pace, q_rad):
            costs[p] = length


@kernel
def _free(arm: TwoLinkArm, moving: MovingSet, pace: Pace, tips: Floats, q_rad: Floats) -> bool:
    """Tell whether every point's pose is within reach and limits and free around its time; fill the joint angles."""
    bx, by, half = arm.base_x_cm, arm.base_y_cm, 0.5 * pace.step_s
    for j in range(tips.shape[0]):
        x, y = tips[j, 0] - bx, tips[j, 1] - by
        r2 = x * x + y * y
        r = sqrt(r2)
        if region_at(arm, r) != FREE:
            return False
        ex, ey = elbow_from_base(arm, x, y, r2, r)
        if not within_limits(arm, bx + ex, by + ey, 0.0) or floor_clearance(arm, by + ey, by + y) <= arm.margin_cm:
            return False
        since, until = max(0.0, j * pace.step_s - half), j * pace.step_s + half + pace.delay_s
        for i in range(moving.speeds_cm_s.shape[0]):
            gap = gap_in_span(moving, i, since, until, bx, by, bx + ex, by + ey, bx + x, by + y, arm.margin_cm)
            if gap <= arm.margin_cm:
                return False
        q_rad[j, 0], q_rad[j, 1] = atan2(ey, ex), theta2_at(arm, r)
    return True


@kernel
def _can_follow(pace: Pace, q_rad: Floats) -> bool:
    """Tell whether the joints can take the poses in their times, by differences."""
    if pace.speeds_rad_s[0] == inf:
        return True
    rate1 = rate2 = 0.0
    for j in range(1, q_rad.shape[0]):
        new1 = _turn(q_rad[j, 0] - q_rad[j - 1, 0]) / pace.step_s
        new2 = (q_rad[j, 1] - q_rad[j - 1, 1]) / pace.step_s
        if abs(new1) > pace.speeds_rad_s[0] or abs(new2) > pace.speeds_rad_s[1]:
            return False
        if abs(new1 - rate1) > pace.step_s * pace.accelerations_rad_s2[0]:
            return False
        if abs(new2 - rate2) > pace.step_s * pace.accelerations_rad_s2[1]:
            return False
        rate1, rate2 = new1, new2
    return True


@kernel
def _turn(angle: float) -> float:
    """Return an angle in [-pi, pi)."""
    return float(angle - 2.0 * pi * floor((angle + pi) / (2.0 * pi)))
