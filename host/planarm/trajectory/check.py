"""How far a trajectory stands from its limits, on a grid ten times denser than its own and between its points.

Independent of the solver: it takes the derivatives of the path and the finished s(t), nothing in between. Between two
points of the dense grid a value can exceed both by an eighth of its second difference (the height of a parabola over
its chord), so that is added.
"""

from dataclasses import dataclass

import numpy as np

from planarm.smoothing.smooth_path import Floats
from planarm.trajectory.motion import Trajectory

SUBSTEPS = 10


@dataclass(frozen=True, slots=True)
class LimitUse:
    """Shares of the limits that are used inside each interval; 1 is the limit.

    Attributes:
        speed: the largest, of each joint's speed, shape (intervals, joints).
        acceleration: the largest, of each joint's acceleration, shape (intervals, joints).
        slack: how much of the nearest limit of any joint is unused at the point where that is most, shape (intervals,).
    """

    speed: Floats
    acceleration: Floats
    slack: Floats


def limit_use(trajectory: Trajectory, speeds_rad_s: Floats, accelerations_rad_s2: Floats) -> LimitUse:
    """Return the use of limits of shape (joints,), with both one-sided accelerations at every gridpoint."""
    shares = np.arange(SUBSTEPS + 1) / SUBSTEPS
    lengths = np.diff(trajectory.s)
    s = trajectory.s[:-1, None] + lengths[:, None] * shares
    s[:, -1] = trajectory.s[1:]
    x0, x1 = trajectory.s_dot[:-1] ** 2, trajectory.s_dot[1:] ** 2
    x = x0[:, None] + (x1 - x0)[:, None] * shares  # the square of the rate is linear in s
    u = ((x1 - x0) / (2.0 * lengths))[:, None, None]
    inner = trajectory.path.evaluate(s[:, :-1].ravel(), "right")
    ends = trajectory.path.evaluate(s[:, -1], "left")
    shape = (len(lengths), SUBSTEPS, -1)
    dq = np.concatenate([inner.dq_rad.reshape(shape), ends.dq_rad[:, None]], axis=1)
    ddq = np.concatenate([inner.ddq_rad.reshape(shape), ends.ddq_rad[:, None]], axis=1)
    speed2 = dq**2 * x[..., None] / speeds_rad_s**2
    acceleration = (dq * u + ddq * x[..., None]) / accelerations_rad_s2
    nearest = np.maximum(np.sqrt(speed2), np.abs(acceleration)).max(axis=2)
    return LimitUse(
        np.sqrt(speed2.max(axis=1) + _between(speed2)),
        np.abs(acceleration).max(axis=1) + _between(acceleration),
        1.0 - nearest.min(axis=1),
    )


def _between(values: Floats) -> Floats:
    """Return how much the values, of shape (intervals, points, joints), can exceed their largest between two points."""
    height: Floats = np.abs(np.diff(values, n=2, axis=1)).max(axis=1) / 8.0
    return height
