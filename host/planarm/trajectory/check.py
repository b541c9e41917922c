"""How far a trajectory stands from its limits, on a grid ten times denser than its own.

Independent of the solver: it takes the derivatives of the path and the finished s(t), nothing in between.
"""

from dataclasses import dataclass

import numpy as np

from planarm.trajectory.joint_path import Floats
from planarm.trajectory.motion import Trajectory

SUBSTEPS = 10


@dataclass(frozen=True, slots=True)
class LimitUse:
    """The largest share of each limit that is used inside each interval, shape (intervals, joints); 1 is the limit."""

    speed: Floats
    acceleration: Floats


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
    speed = np.abs(dq) * np.sqrt(x)[..., None] / speeds_rad_s
    acceleration = np.abs(dq * u + ddq * x[..., None]) / accelerations_rad_s2
    return LimitUse(speed.max(axis=1), acceleration.max(axis=1))
