"""Slow a motion down where a stop would take more path than the device holds.

The device can come to rest on the path only within the segments in its queue. Where the path time to rest and the
link's margin are longer than those last, the motion there gets an upper limit of its speed along the path, a little
lower than before, and is timed anew, until every stop fits.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from planarm.scene import Scene
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.stopping import allowances, held_until, slice_lengths
from planarm.stepping.table import SegmentTable, segment_bytes, table_of
from planarm.stepping.train import Floats, Ticks
from planarm.trajectory.motion import Trajectory
from planarm_wire.messages import SLICE_TICKS, TICKS_HZ

LINK_MARGIN_TICKS = 240_000
"""15 ms: how long what was executed is not yet made good, since a reply takes up to 10 ms and a message 4 ms."""

LEAST_FACTOR = 0.6
MOST_FACTOR = 0.97
"""Bounds of one round's change of speed. A stop's path time grows with the speed, so the share of it that there is road
for is the change; more than one round is needed since it depends on the motion ahead, too."""


@dataclass(frozen=True, slots=True, eq=False)
class SpeedLimit:
    """An upper limit of ds/dt along a path, linear between points.

    Attributes:
        s: path parameters, ascending, shape (n,).
        rate: the limit at each.
    """

    s: Floats
    rate: Floats

    def __call__(self, s: Floats) -> Floats:
        """Return the limit at each s."""
        return np.asarray(np.interp(s, self.s, self.rate))

    @classmethod
    def lower(cls, trajectory: Trajectory, times_s: Floats, factors: Floats, before: Self | None) -> Self:
        """Return a limit that slows a motion by factors given at times in it; 1 changes nothing."""
        s = _path_parameter(trajectory, times_s)
        unlimited = 10.0 * float(trajectory.s_dot.max())
        speed = np.interp(s, trajectory.s, trajectory.s_dot)
        rate = np.where(factors < 1.0, factors * speed, unlimited)
        keep = np.concatenate([[True], np.diff(s) > 0.0])
        s, rate = s[keep], np.maximum(rate[keep], 1e-3 * unlimited)
        return cls(s, rate if before is None else np.minimum(rate, before(s)))


def shortfall_ticks(plan: SegmentPlan, table: SegmentTable) -> Floats:
    """Return how much path time is missing in each segment, at its last slice, for a stop; negative where none is.

    Where all of what is left is in the queue nothing is missing: the motion ends at rest.
    """
    starts = table.starts
    held = held_until(starts, segment_bytes(table), table.board.queue_bytes)
    needs = np.array([allowance.need_ticks for allowance in plan.allowances])
    spare = held - last_slices(table) - needs - LINK_MARGIN_TICKS
    return np.where(held < starts[-1], -spare, -float(starts[-1]))


def last_slices(table: SegmentTable) -> Ticks:
    """Return the start of each segment's last slice."""
    lengths = slice_lengths(table.durations)
    return np.asarray(table.starts[:-1] + (table.durations - 1) // lengths * lengths)


def missing_road_ticks(plan: SegmentPlan, first: int = 0) -> float | None:
    """Return how much path the device holds where stops do not fit, on average; None where all stops fit.

    Segments from number `first` on are looked at.
    """
    if not plan.allowances:
        return None
    table = table_of(plan)
    lacking = shortfall_ticks(plan, table) > 0.0
    lacking[:first] = False
    if not lacking.any():
        return None
    held = held_until(table.starts, segment_bytes(table), table.board.queue_bytes)
    return float((held - last_slices(table))[lacking].mean())


def road_ticks(plan: SegmentPlan) -> float:
    """Return the path time that a stop may take in a plan like this, on average; infinite where all of it is held."""
    table = table_of(plan)
    held = held_until(table.starts, segment_bytes(table), table.board.queue_bytes)
    partly = held < table.starts[-1]
    if not partly.any():
        return float("inf")
    return max(float(SLICE_TICKS), float((held - last_slices(table))[partly].mean()) - LINK_MARGIN_TICKS)


def slower(trajectory: Trajectory, scene: Scene, road_ticks: float, before: SpeedLimit | None) -> SpeedLimit | None:
    """Return a lower limit of the speed where a stop takes more than a road of this length; None where none does.

    The motion is looked at in slices as the device cuts them.
    """
    count = -(-int(trajectory.duration_s * TICKS_HZ) // SLICE_TICKS)
    needs = np.array([one.need_ticks for one in allowances(trajectory, scene, [SLICE_TICKS] * count)])
    starts = SLICE_TICKS * np.arange(count + 1)
    fits = (road_ticks - LINK_MARGIN_TICKS) / np.maximum(needs, 1.0)
    lacking = np.flatnonzero((fits < 1.0) & (starts[:-1] + road_ticks < starts[-1]))
    if not len(lacking):
        return None
    factors = np.ones(len(starts))
    for k in lacking.tolist():
        end = int(np.searchsorted(starts, starts[k] + needs[k]))
        factors[k : end + 1] = np.minimum(factors[k : end + 1], np.clip(fits[k], LEAST_FACTOR, MOST_FACTOR))
    return SpeedLimit.lower(trajectory, starts / TICKS_HZ, factors, before)


def _path_parameter(trajectory: Trajectory, times_s: Floats) -> Floats:
    """Return where the motion is at each time."""
    t = np.clip(times_s, 0.0, trajectory.duration_s)
    i = np.clip(np.searchsorted(trajectory.t_s, t, side="right") - 1, 0, len(trajectory.t_s) - 2)
    since = t - trajectory.t_s[i]
    s = trajectory.s[i] + since * (trajectory.s_dot[i] + 0.5 * trajectory.s_ddot[i] * since)
    return np.asarray(np.clip(s, trajectory.s[i], trajectory.s[i + 1]))
