"""How far a trajectory stands from its limits, on a grid ten times denser than its own and between its points.

Independent of the solver: it takes the derivatives of the path and the finished s(t), nothing in between, and the true
torque curve, not the solver's estimate of it. Between two points of the dense grid a value can exceed both by an eighth
of its second difference (the height of a parabola over its chord), so that is added.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from planarm.dynamics.motor_terms import MotorTerms, motor_terms
from planarm.dynamics.pull_out import Drives, pull_out_nm
from planarm.smoothing.smooth_path import Floats
from planarm.trajectory.limits import Limits
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.samples import Samples, take_samples
from planarm_wire.kernel_cache import kernel

MOST = 1e3
"""The use of a torque of which nothing is left."""


@dataclass(frozen=True, slots=True)
class LimitUse:
    """Shares of the limits that are used inside each interval; 1 is the limit.

    Attributes:
        speed: the largest, of each joint's speed, shape (intervals, joints).
        acceleration: the largest, of each joint's acceleration, shape (intervals, joints).
        torque: the largest, of the torque that gravity and friction leave each motor, shape (intervals, motors); zeros
            when torque is not limited.
        slack: how much of the nearest limit of any joint is unused at the point where that is most, shape (intervals,).
    """

    speed: Floats
    acceleration: Floats
    torque: Floats
    slack: Floats

    @property
    def largest(self) -> float:
        """The largest use of all."""
        return float(max(self.speed.max(), self.acceleration.max(), self.torque.max()))


def limit_use(trajectory: Trajectory, limits: Limits, samples: Samples | None = None) -> LimitUse:
    """Return the use of the limits, with both one-sided accelerations at every gridpoint.

    `samples` are the path's on the trajectory's grid where they are known; they are taken if not.
    """
    lengths = np.diff(trajectory.s)
    q, dq, ddq = samples or take_samples(trajectory.path, trajectory.s[:-1], trajectory.s[1:])
    x = trajectory.s_dot**2
    speed, acceleration, torque = np.zeros((3, len(lengths), limits.joints))
    nearest = np.zeros(dq.shape[:2])
    _kinematic_use(lengths, x, dq, ddq, limits.speeds_rad_s, limits.accelerations_rad_s2, speed, acceleration, nearest)
    if limits.load is not None:
        flat = (nearest.size, -1)
        senses = np.sign(dq)
        senses[:, [0, -1]] = senses[:, [1, -2]]  # a joint that turns back does so at a gridpoint
        terms = motor_terms(limits.load, *(np.ascontiguousarray(v.reshape(flat)) for v in (q, dq, ddq, senses)))
        _torque_use(lengths, x, terms, limits.load.drives, limits.share, torque, nearest)
    return LimitUse(speed, acceleration, torque, 1.0 - nearest.min(axis=1))


@kernel
def _kinematic_use(
    lengths: Floats,
    x: Floats,
    dq: Floats,
    ddq: Floats,
    speeds: Floats,
    accelerations: Floats,
    speed_use: Floats,
    acceleration_use: Floats,
    nearest: Floats,
) -> None:
    """Fill the uses of speed and acceleration, and at every point the largest of them."""
    points = dq.shape[1]
    speed2, acceleration = np.empty(points), np.empty(points)
    for i in range(lengths.shape[0]):
        u = (x[i + 1] - x[i]) / (2.0 * lengths[i])
        for j in range(dq.shape[2]):
            for p in range(points):
                at = between(x[i], x[i + 1], p / (points - 1))
                speed2[p] = dq[i, p, j] ** 2 * at / speeds[j] ** 2
                acceleration[p] = (dq[i, p, j] * u + ddq[i, p, j] * at) / accelerations[j]
                nearest[i, p] = max(nearest[i, p], sqrt(speed2[p]), abs(acceleration[p]))
            speed_use[i, j] = sqrt(largest_between(speed2))
            acceleration_use[i, j] = largest_between(acceleration)


@kernel
def _torque_use(
    lengths: Floats, x: Floats, terms: MotorTerms, drives: Drives, share: float, torque_use: Floats, nearest: Floats
) -> None:
    """Fill the use of torque, and raise the largest use at every point to it."""
    a, b, v, h, w = terms
    points = nearest.shape[1]
    use = np.empty(points)
    for i in range(lengths.shape[0]):
        u = (x[i + 1] - x[i]) / (2.0 * lengths[i])
        for m in range(torque_use.shape[1]):
            for p in range(points):
                row = i * points + p
                at = between(x[i], x[i + 1], p / (points - 1))
                moving = a[row, m] * u + b[row, m] * at + v[row, m] * sqrt(at)
                held = h[row, m] if moving > 0.0 else -h[row, m]
                left = share * (pull_out_nm(drives, m, w[row, m] * sqrt(at)) - held)
                use[p] = moving / left if abs(moving) < MOST * left else (MOST if moving > 0.0 else -MOST)
                nearest[i, p] = max(nearest[i, p], abs(use[p]))
            torque_use[i, m] = largest_between(use)


@kernel
def between(start: float, end: float, share: float) -> float:
    """Return the squared rate at a share of an interval: it is linear in s, and never negative by rounding."""
    return max(0.0, start + (end - start) * share)


@kernel
def largest_between(values: Floats) -> float:
    """Return the largest size of the values, of shape (points,), or of what may lie between two of them."""
    largest, height = 0.0, 0.0
    for p in range(values.shape[0]):
        largest = max(largest, abs(values[p]))
        if 0 < p < values.shape[0] - 1:
            height = max(height, abs(values[p - 1] - 2.0 * values[p] + values[p + 1]))
    return largest + height / 8.0
