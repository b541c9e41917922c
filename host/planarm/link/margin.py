"""Whether the line carries a plan, by what it was seen to carry, before the motion starts.

The device's queue is filled first. The bytes that it took, over the time until they were acknowledged, are what line,
window, computer and disk carry together; the quickest answer is the least that any order takes. With these the motion
is gone through beforehand: a message is sent when the device has told of room for it, comes when the line has carried
it, and is read when the board has time. The device slows down by itself where less path is queued than a stop takes; so
the path clock is told to run at the greatest rate at which that never happens.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from planarm_wire.board_budget import (
    LEAST_SHARE,
    LINE_LOAD,
    STEP_INTERRUPT_TICKS,
    STRETCHED_JOINT_TICKS,
    work_ticks,
)
from planarm_wire.boards import Board
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import (
    MAX_PAYLOAD_BYTES,
    MIN_LEAD_TICKS,
    NEED_UNIT_TICKS,
    SLICE_TICKS,
    STARVING_TICKS,
    TICKS_HZ,
    Segment,
)
from planarm_wire.rates import MESSAGE_SEGMENTS, QUEUED_HEAD_BYTES, SEGMENTS_FRAME_BYTES, Allowance
from planarm_wire.steps import duration_ticks, step_count

FRAME_BYTES = SEGMENTS_FRAME_BYTES + 2
"""With a byte in fifty stuffed."""
USABLE_SHARE = 0.9
"""Of what was seen: a line has bad moments."""
QUESTIONS_BYTES_S = 140.0
"""A QUERY of seven bytes every 50 ms, at least so often, keeps the person informed; a slow line feels that."""
TURNS = 2
"""Round trips from room in the queue to its filling: a question that comes too early is followed by another."""
LEAST_SEEN_BYTES = 300
FULL_PERCENT = 100

SLICE_END_TICKS = STARVING_TICKS + SLICE_TICKS
"""What the device must hold beyond a stop's need, seen from where a slice begins."""
PREPARED_TICKS = MIN_LEAD_TICKS
"""By how much more path than a stop takes the device must hold when it prepares a slice: firmware/core/motion.cpp looks
at the end of the slice, which it prepares so long, by its own clock, before its start."""


@dataclass(frozen=True, slots=True)
class SeenLine:
    """What was seen while the queue was filled.

    Attributes:
        bytes_s: that the device took; None when that was too little to tell.
        round_trip_s: from a frame's first byte to its acknowledgement, at least.
    """

    bytes_s: float | None
    round_trip_s: float

    @classmethod
    def of(cls, took_bytes: int, in_s: float, round_trip_s: float) -> "SeenLine":
        """Return what so many bytes in so long a time tell."""
        return cls(took_bytes / in_s if took_bytes >= LEAST_SEEN_BYTES and in_s > 0.0 else None, round_trip_s)


@dataclass(frozen=True, slots=True)
class Margin:
    """What a plan asks of the line, and what the line was seen to carry.

    Attributes:
        asked_bytes_s: by the plan, on average up to the segment that is hardest to bring in time.
        seen: of the line.
        percent: the rate of the path clock at which the line carries the plan.
        motion_s: the plan's duration.
    """

    asked_bytes_s: float
    seen: SeenLine
    percent: int
    motion_s: float

    def __str__(self) -> str:
        return (
            f"the line was seen to carry {self.seen.bytes_s or 0.0:.0f} bytes/s and to answer after"
            f" {1e3 * self.seen.round_trip_s:.1f} ms, the plan asks for {self.asked_bytes_s:.0f} bytes/s and some to"
            f" spare: the motion runs at {self.percent} % of its speed and takes"
            f" {self.motion_s * FULL_PERCENT / self.percent:.1f} s instead of {self.motion_s:.1f} s"
        )


def line_margin(
    segments: Sequence[Segment],
    sent_segments: int,
    seen: SeenLine,
    board: Board,
    allowances: Sequence[Allowance] = (),
) -> Margin:
    """Hold a plan against the line.

    Args:
        segments: the plan's.
        sent_segments: how many are in the queue already.
        seen: what the line was seen to carry.
        board: that is to execute it.
        allowances: one a segment, or none.
    """
    supply = _Supply(segments, sent_segments, seen, allowances, board)
    percent = FULL_PERCENT
    if seen.bytes_s is not None and not supply.suffices(FULL_PERCENT):
        fits, percent_fails = 1, FULL_PERCENT
        while percent_fails - fits > 1:
            middle = (fits + percent_fails) // 2
            if supply.suffices(middle):
                fits = middle
            else:
                percent_fails = middle
        percent = fits
    return Margin(supply.asked_bytes_s(), seen, percent, supply.starts[-1] / TICKS_HZ)


def fill_queue(segments: Sequence[Segment], board: Board) -> int:
    """Return how many of the first segments a board's queue holds."""
    filled = list(accumulate(map(_queued_bytes, segments)))
    return bisect_right(filled, board.queue_bytes)


class _Supply:
    """A motion's segments on their way to the device."""

    def __init__(
        self,
        segments: Sequence[Segment],
        sent: int,
        seen: SeenLine,
        allowances: Sequence[Allowance],
        board: Board,
    ) -> None:
        sizes = [encoded_bytes(segment) for segment in segments]
        durations = [duration_ticks(segment) for segment in segments]
        self.starts = list(accumulate(durations, initial=0))
        self._sent, self._seen = sent, seen
        self._line_bytes = [size + FRAME_BYTES / MESSAGE_SEGMENTS for size in sizes]
        self._queued = list(accumulate(map(_queued_bytes, segments), initial=0.0))
        self._needs = [NEED_UNIT_TICKS * -(-one.need_ticks // NEED_UNIT_TICKS) for one in allowances]
        self._needs = self._needs or [0.0] * len(segments)
        self._board = board
        joints = sum(any(moves) for moves in zip(*(map(step_count, one.moves) for one in segments), strict=True))
        self._work = [_work_ticks(board, joints, one, ticks) for one, ticks in zip(segments, durations, strict=True)]

    def asked_bytes_s(self) -> float:
        """Return what the line must carry on average up to the segment that is hardest to bring before it starts."""
        asked, missing = 0.0, 0.0
        for start, size in zip(self.starts[self._sent : -1], self._line_bytes[self._sent :], strict=True):
            missing += size
            asked = max(asked, missing * TICKS_HZ / max(start, 1))
        return asked

    def suffices(self, percent: int) -> bool:
        """Whether the device never slows down for want of segments when its path clock runs at this rate."""
        assert self._seen.bytes_s is not None, "asked when something was seen"
        rate = percent / FULL_PERCENT
        ticks_a_byte = TICKS_HZ / max(1.0, USABLE_SHARE * self._seen.bytes_s - QUESTIONS_BYTES_S)
        turn_ticks = TURNS * self._seen.round_trip_s * TICKS_HZ
        margin = SLICE_END_TICKS + PREPARED_TICKS * rate
        stretched_ticks = 0 if percent == FULL_PERCENT else STRETCHED_JOINT_TICKS * self._board.joints
        line = board = 0.0
        running = 0
        for k in range(self._sent, len(self._needs)):
            begun = bisect_left(self._queued, self._queued[k + 1] - self._board.queue_bytes) - 1
            room = self.starts[begun] / rate if begun >= 0 else 0.0
            line = max(line, room + turn_ticks) + self._line_bytes[k] * ticks_a_byte
            board = max(board, line) + self._work[k] + stretched_ticks
            path, before = board * rate, running
            while running < k and self.starts[running + 1] <= path:
                running += 1
            free = self._board.queue_bytes - (self._queued[k] - self._queued[running])
            need = max(self._needs[before : running + 1])
            if free >= MAX_PAYLOAD_BYTES and self.starts[k] - path < need + margin:
                return False
        return True


def _queued_bytes(segment: Segment) -> float:
    return encoded_bytes(segment) + QUEUED_HEAD_BYTES / MESSAGE_SEGMENTS


def _work_ticks(board: Board, joints: int, segment: Segment, ticks: int) -> float:
    """Return how long the board takes to read a segment beside the interrupts of one like it."""
    costs = STEP_INTERRUPT_TICKS[board.name]
    stepping = sum(cost * step_count(move) for cost, move in zip(costs, segment.moves, strict=True))
    load = LINE_LOAD + stepping / max(ticks, 1)
    return work_ticks(joints, (ticks - 1) // SLICE_TICKS) / max(1.0 - load, LEAST_SHARE)
