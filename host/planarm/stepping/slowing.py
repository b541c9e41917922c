"""Slow a motion down where a stop would take more path than the device holds.

The device can come to rest on the path only within the segments in its queue. Where the path time to rest and the
link's margin are longer than those last, the motion there gets an upper limit of its speed along the path, a little
lower than before, and is timed anew, until every stop fits.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from planarm.scene import Scene
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.stopping import Slices, allowances, held_until
from planarm.stepping.table import SegmentTable, segment_bytes, table_of
from planarm.stepping.train import Floats, Ticks
from planarm.trajectory.motion import Trajectory
from planarm_wire.boards import Board
from planarm_wire.messages import SLICE_TICKS, TICKS_HZ

LINK_MARGIN_TICKS = 240_000
"""15 ms: how long what was executed is not yet made good by two joints, since a reply takes up to 10 ms and a message 4
ms."""
LINK_MARGIN_JOINT_TICKS = 40_000
"""What each further joint of the board adds: it makes status and message longer and their reading slower. With 15.2 ms
a board of four was seen to slow down by 0.4 ms."""

LEAST_FACTOR = 0.6
MOST_FACTOR = 0.97
"""Bounds of one round's change of speed. A stop's path time grows with the speed and the time that a stretch of path
lasts falls with it, so the change is the root of the share of a stop that there is road for; more than one round is
needed since both depend on the motion ahead, too."""

SMOOTH_SLICES = 48
"""Changes of the limit are spread over so many slices to either side: a jagged limit makes a jagged motion, and that
takes more bytes."""


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
    spare = held - last_slices(table) - needs - link_margin_ticks(table.board)
    return np.where(held < starts[-1], -spare, -float(starts[-1]))


def link_margin_ticks(board: Board) -> int:
    """Return by how much more path than a stop takes a board has to hold when its queue is full."""
    return LINK_MARGIN_TICKS + LINK_MARGIN_JOINT_TICKS * (board.joints - 2)


def last_slices(table: SegmentTable) -> Ticks:
    """Return the start of each segment's last slice."""
    slices = Slices.of(table.durations.tolist())
    last = np.searchsorted(slices.segment, np.arange(len(table.durations)), side="right") - 1
    return np.asarray(table.starts[0] + slices.starts[last])


ROAD_SHARE = 0.95
"""Of the road found, what a slower motion is sure to have about: it is coded anew, into other segments."""

PATIENCE = 3
"""So many times that share is believed. Where steps are so slow that each is a segment, a slower motion has less road
again; then less and less is relied on, so that the motion becomes slow enough in the end."""


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """How far along its path the device's queue reaches, from everywhere.

    The bytes of a stretch of path depend little on how fast it is passed, so it is nearly that of a slower motion.

    Attributes:
        s: path parameters of the segments' starts, ascending, shape (n,).
        end_s: how far the queue reaches while each segment runs; the path's end where it holds all that is left.
    """

    s: Floats
    end_s: Floats

    @classmethod
    def of(cls, plan: SegmentPlan, trajectory: Trajectory, found_before: int = 0) -> Self:
        """Return a little less than the road that a plan of a motion was found to have.

        Args:
            plan: made of the motion.
            trajectory: the motion.
            found_before: how many roads were found too short before.
        """
        share = ROAD_SHARE ** max(1, found_before + 1 - PATIENCE)
        table = table_of(plan)
        held = held_until(table.starts, segment_bytes(table), table.board.queue_bytes)
        s = _path_parameter(trajectory, table.starts[:-1] / TICKS_HZ)
        whole = held >= table.starts[-1]
        end_s = np.where(whole, trajectory.s[-1], s + share * (_path_parameter(trajectory, held / TICKS_HZ) - s))
        return cls(s, end_s)

    def ticks(self, trajectory: Trajectory, at_s: Floats) -> Floats:
        """Return how long it lasts from times in a motion, infinite where it reaches the path's end."""
        running = np.searchsorted(self.s, _path_parameter(trajectory, at_s), side="right") - 1
        end_s = self.end_s[np.maximum(running, 0)]
        lasts = (trajectory.time_at(end_s) - at_s) * TICKS_HZ
        return np.where(end_s >= trajectory.s[-1], np.inf, lasts)


def lacks_road(plan: SegmentPlan, first: int = 0) -> bool:
    """Tell whether a stop does not fit into what the device holds, in any segment from number `first` on."""
    return bool(plan.allowances) and bool((shortfall_ticks(plan, table_of(plan))[first:] > 0.0).any())


def road_ticks(plan: SegmentPlan) -> float:
    """Return the path time that a stop may take in a plan like this, on average; infinite where all of it is held."""
    table = table_of(plan)
    held = held_until(table.starts, segment_bytes(table), table.board.queue_bytes)
    partly = held < table.starts[-1]
    if not partly.any():
        return float("inf")
    return max(float(SLICE_TICKS), float((held - last_slices(table))[partly].mean()) - link_margin_ticks(plan.board))


def slower(trajectory: Trajectory, scene: Scene, road: Road, before: SpeedLimit | None) -> SpeedLimit | None:
    """Return a lower limit of the speed where a stop takes more than there is road for; None where none does.

    The motion is looked at in slices as the device cuts them.
    """
    count = -(-int(trajectory.duration_s * TICKS_HZ) // SLICE_TICKS)
    needs = np.array([one.need_ticks for one in allowances(trajectory, scene, [SLICE_TICKS] * count)])
    starts = SLICE_TICKS * np.arange(count + 1)
    fits = (road.ticks(trajectory, starts[:-1] / TICKS_HZ) - link_margin_ticks(scene.board)) / np.maximum(needs, 1.0)
    lacking = np.flatnonzero(fits < 1.0)
    if not len(lacking):
        return None
    factors, changes = np.ones(len(starts)), np.clip(np.sqrt(np.maximum(fits, 0.0)), LEAST_FACTOR, MOST_FACTOR)
    for k in lacking.tolist():
        end = int(np.searchsorted(starts, starts[k] + needs[k]))
        factors[k : end + 1] = np.minimum(factors[k : end + 1], changes[k])
    return SpeedLimit.lower(trajectory, starts / TICKS_HZ, _spread(factors), before)


def _spread(factors: Floats) -> Floats:
    """Return factors that change slowly from slice to slice, nowhere above them: means of the neighbours' least."""
    width = 2 * SMOOTH_SLICES + 1
    padded = np.pad(factors, 2 * SMOOTH_SLICES, mode="edge")
    least = sliding_window_view(padded, width).min(axis=1)
    return np.asarray(sliding_window_view(least, width).mean(axis=1))


def _path_parameter(trajectory: Trajectory, times_s: Floats) -> Floats:
    """Return where the motion is at each time."""
    t = np.clip(times_s, 0.0, trajectory.duration_s)
    i = np.clip(np.searchsorted(trajectory.t_s, t, side="right") - 1, 0, len(trajectory.t_s) - 2)
    since = t - trajectory.t_s[i]
    s = trajectory.s[i] + since * (trajectory.s_dot[i] + 0.5 * trajectory.s_ddot[i] * since)
    return np.asarray(np.clip(s, trajectory.s[i], trajectory.s[i + 1]))
