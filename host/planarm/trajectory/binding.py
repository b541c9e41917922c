"""What holds a motion back: which joint and which limit, and what the braking share costs."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from planarm.trajectory.check import limit_use
from planarm.trajectory.limits import HEADROOM, Limits
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.planes import Grid
from planarm.trajectory.timing import solve

LimitName = Literal["speed", "acceleration", "torque"]

SAME = 1e-6
"""Durations that differ by less than this share are the same."""


@dataclass(frozen=True, slots=True)
class Binding:
    """A limit that holds the motion back for a share of its duration; joints are counted from 1."""

    joint: int
    limit: LimitName
    share: float


@dataclass(frozen=True, slots=True)
class TimingReport:
    """Why a motion takes as long as it does.

    Attributes:
        binding: the limits in the order of their shares; every moment counts for the limit used most in it.
        duration_s: of the motion that these limits allow.
        acceleration_share: the share of the acceleration that it uses.
        full_acceleration_s: what it would take with all of the acceleration, nothing left for a stop.
        executed_s: what it takes in the end: more, where it is slower because the device's queue holds less of the path
            than a stop takes.
    """

    binding: tuple[Binding, ...]
    duration_s: float
    acceleration_share: float
    full_acceleration_s: float
    executed_s: float

    @property
    def braking_cost(self) -> float:
        """How much longer the motion takes for the share of acceleration that is kept for a stop, as a share."""
        return self.duration_s / self.full_acceleration_s - 1.0 if self.full_acceleration_s > 0.0 else 0.0

    def figures(self) -> dict[str, Any]:
        """Return the report as plain values for JSON."""
        return {
            "motion_s": round(self.executed_s, 6),
            "motion_unslowed_s": round(self.duration_s, 6),
            "motion_full_acceleration_s": round(self.full_acceleration_s, 6),
            "acceleration_share": self.acceleration_share,
            "binding_limits": [
                {"joint": b.joint, "limit": b.limit, "share_of_time": round(b.share, 4)} for b in self.binding
            ],
        }

    def words(self) -> str:
        """Say what holds the motion back, such as ``joint 1 speed 60 % of the time; ...``."""
        if not self.binding:
            return "nothing moves"
        held = ", ".join(f"joint {b.joint} {b.limit} {100.0 * b.share:.0f} %" for b in self.binding if b.share >= 0.005)
        words = f"held back by {held} of the time"
        if self.braking_cost >= 0.0005:  # less reads 0.0 %
            words += f"; keeping a stop possible costs {100.0 * self.braking_cost:.1f} %"
        if self.executed_s <= self.duration_s * (1.0 + SAME):
            return words
        more = 100.0 * (self.executed_s / self.duration_s - 1.0)
        return f"{words}, and {more:.1f} % more because the board's queue would hold too little path for it"


def report_timing(trajectory: Trajectory, limits: Limits, *, fixed: bool = False) -> TimingReport:
    """Return what holds a timed motion back.

    Args:
        trajectory: the motion.
        limits: the limits it was timed under.
        fixed: its times are those of appointments, which more acceleration does not change.
    """
    if len(trajectory.t_s) == 1:
        return TimingReport((), 0.0, limits.acceleration_share, 0.0, 0.0)
    grid = Grid.on(trajectory.path, trajectory.s, trajectory.s_dot**2)
    use = limit_use(trajectory, limits, grid.samples)
    names: tuple[LimitName, ...] = ("speed", "acceleration", "torque")
    most = np.stack([use.speed, use.acceleration, use.torque], axis=1).reshape(len(use.slack), -1).argmax(axis=1)
    shares = np.bincount(most, np.diff(trajectory.t_s), minlength=3 * limits.joints) / trajectory.duration_s
    binding = [
        Binding(int(k % limits.joints) + 1, names[k // limits.joints], float(shares[k]))
        for k in np.argsort(-shares, kind="stable")
        if shares[k] > 0.0
    ]
    full_s = trajectory.duration_s if fixed else _full_acceleration_s(trajectory, grid, limits)
    duration_s = trajectory.duration_s
    return TimingReport(tuple(binding), duration_s, limits.acceleration_share, full_s, duration_s)


def _full_acceleration_s(trajectory: Trajectory, grid: Grid, limits: Limits) -> float:
    """Return the duration with all of the acceleration, on the motion's own grid."""
    if limits.acceleration_share >= 1.0:
        return trajectory.duration_s
    full = replace(limits, accelerations_rad_s2=limits.accelerations_rad_s2 / limits.acceleration_share, share=HEADROOM)
    return min(trajectory.duration_s, solve(trajectory.path, grid, full).duration_s)
