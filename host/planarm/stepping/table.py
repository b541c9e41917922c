"""Segments as arrays, for checks over all of them at once, and the bytes they take on the wire."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.stepping.plan import SegmentPlan
from planarm.stepping.train import Ticks
from planarm_wire.boards import Board
from planarm_wire.messages import MAX_COARSE_STEPS, SLOW_INTERVAL_TICKS
from planarm_wire.steps import COARSE_ADD_BITS


class SegmentTable(NamedTuple):
    """The numbers of all segments: shape (segments,) or (segments, joints)."""

    durations: Ticks
    is_last: Ticks
    counts: Ticks
    positive: Ticks
    first: Ticks
    interval_q16: Ticks
    add: Ticks
    """As on the wire."""
    board: Board
    """That is to execute them."""

    @property
    def slow(self) -> NDArray[np.bool_]:
        """Whether a move is slow."""
        return np.asarray((self.counts > 1) & (self.interval_q16 >= SLOW_INTERVAL_TICKS << 16))

    @property
    def add_q16(self) -> Ticks:
        """What each interval has more than the one before; what 32 bits do not hold is beyond the wire's limits."""
        return np.where(self.counts <= MAX_COARSE_STEPS, self.add << COARSE_ADD_BITS, self.add)

    @property
    def last_interval_q16(self) -> Ticks:
        """The interval before the last step; with fewer than two steps, the first."""
        return np.asarray(self.interval_q16 + np.maximum(self.counts - 2, 0) * self.add_q16)

    @property
    def last_ticks(self) -> Ticks:
        """The last step of each move, from its segment's start; -1 without steps."""
        n = np.maximum(self.counts - 1, 0)
        last = self.first + ((n * self.interval_q16 + n * (n - 1) // 2 * self.add_q16) >> 16)
        return np.where(self.counts > 0, last, -1)

    @property
    def starts(self) -> Ticks:
        """Tick at which each segment starts, and the end of the last one, shape (segments + 1,)."""
        return np.concatenate([[0], np.cumsum(self.durations)])


def table_of(plan: SegmentPlan) -> SegmentTable:
    """Return the plan's segments as arrays."""
    joints = len(plan.start_usteps)
    flags = np.array([segment.duration_flags for segment in plan.segments], np.int64)
    rows = [
        (move.steps_dir, move.first_ticks, move.interval_q8 << 8, move.add)
        for segment in plan.segments
        for move in segment.moves[:joints]
    ]
    moves = np.array(rows, np.int64).reshape(len(flags), joints, 4)
    steps_dir, first, interval, add = np.moveaxis(moves, 2, 0)
    return SegmentTable(flags >> 1, flags & 1, steps_dir >> 1, steps_dir & 1, first, interval, add, plan.board)


def segment_bytes(table: SegmentTable) -> Ticks:
    """Return the bytes of each segment, shape (segments,), by the rules of docs/protocol.md."""
    size = _varuint_bytes(2 * table.durations + table.is_last)
    some, several = table.counts > 0, table.counts > 1
    moves = _varuint_bytes(2 * table.counts + table.positive) + some * _varuint_bytes(table.first)
    add = table.add
    zigzag = np.where(add >= 0, 2 * add, -2 * add - 1)
    moves = moves + several * (_varuint_bytes(table.interval_q16 >> 8) + _varuint_bytes(zigzag))
    resting = table.board.joints - table.counts.shape[1]  # a byte each
    total: Ticks = size + moves.sum(axis=1) + resting
    return total


def _varuint_bytes(numbers: Ticks) -> Ticks:
    size: Ticks = np.ones_like(numbers)
    for bits in (7, 14, 21, 28):
        size += numbers >> bits > 0
    return size
