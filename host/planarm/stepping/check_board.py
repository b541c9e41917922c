"""Certificate: what the line has to bring and the board has to do, against what they can."""

from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from planarm.scene import LinkSpec
from planarm.stepping.certificate import Check, at_least, at_most
from planarm.stepping.stopping import Slices
from planarm.stepping.table import SegmentTable, segment_bytes
from planarm.stepping.train import Floats, StepTrain, Ticks
from planarm_wire.board_budget import (
    LATEST_READ_TICKS,
    LEAST_SHARE,
    LINE_LOAD,
    LINE_PASS_TICKS,
    PREPARED_SLICES,
    READ_JOINT_TICKS,
    READ_SLOWED_JOINT_TICKS,
    READ_SLOWED_TICKS,
    READ_TICKS,
    SLICE_JOINT_TICKS,
    SLOWED_ANEW_TICKS,
    SLOWED_JOINT_TICKS,
    SLOWED_SPARE_TICKS,
    SLOWED_TICKS,
    STEP_INTERRUPT_TICKS,
    UNSEEN_SLICES,
    WAITING_LINE_LOAD,
    work_ticks,
)
from planarm_wire.messages import (
    HOST_WINDOW_BYTES,
    MIN_LEAD_TICKS,
    SLICE_TICKS,
    TICKS_HZ,
)
from planarm_wire.rates import QUEUED_HEAD_BYTES, SEGMENTS_FRAME_BYTES, SHARED_PAYLOAD_BYTES

BITS_PER_BYTE = 10
"""On the line: start bit, eight bits, stop bit."""

LOAD_WINDOW_TICKS = 80_000
MOST_LOAD = 0.78
AMBER_LOAD = 0.6
"""Share of the processor that interrupts may take in any 5 ms; the rest is the main program's, which prepares steps."""

LINE_WINDOW_S = 0.25
AMBER_LINE_SHARE = 0.4
"""Peak share of the line over any quarter of a second; above it a lost frame is hard to make good in time."""

FLUSH_S = 0.0041
"""The Uno's USB bridge (ATmega16U2) keeps a reply for up to 4.1 ms."""
REPLY_BYTES = 40


def check_board(table: SegmentTable, made: StepTrain, link: LinkSpec) -> list[Check]:
    """Check the interrupt load, the line's peak, and that segments come and are read in time."""
    if not len(table.durations):
        return []
    return [
        _check_load(table, made),
        _check_slowed(table, made),
        _check_peak(table, link),
        *_check_margin(table, link),
        *_check_supply(table, link),
    ]


class _Interrupts(NamedTuple):
    """The step interrupts of a motion, in their order."""

    ticks: Ticks
    """Shape (steps,)."""
    until: Ticks
    """What those before each have taken, and all of them last; shape (steps + 1,)."""

    def within(self, starts: Ticks, window_ticks: int) -> Ticks:
        """Return what those take that come in a window from each of the ticks on; shape (starts,)."""
        first, last = (np.searchsorted(self.ticks, at, side="left") for at in (starts, starts + window_ticks))
        taken: Ticks = self.until[last] - self.until[first]
        return taken


def _interrupts(table: SegmentTable, made: StepTrain) -> _Interrupts:
    each = STEP_INTERRUPT_TICKS[table.board.name]
    every = np.concatenate([steps.ticks for steps in made.steps])
    order = np.argsort(every, kind="stable")
    cost = np.repeat(each[: len(made.steps)], [len(steps.ticks) for steps in made.steps])[order]
    return _Interrupts(every[order], np.concatenate([[0], np.cumsum(cost)]))


def _check_load(table: SegmentTable, made: StepTrain) -> Check:
    """Check the share of the processor that interrupts take in every 5 ms, a busy line included."""
    interrupts = _interrupts(table, made)
    ticks = interrupts.ticks
    within = interrupts.within(ticks, LOAD_WINDOW_TICKS)
    load = LINE_LOAD + (int(within.max()) if len(ticks) else 0) / LOAD_WINDOW_TICKS
    where = _time(int(ticks[within.argmax()])) if len(ticks) else ""
    setting = "joints.microsteps or joints.max_speed_deg_s"
    return at_most("interrupt load in any 5 ms", load, MOST_LOAD, "", where, setting, amber=AMBER_LOAD)


def _check_slowed(table: SegmentTable, made: StepTrain) -> Check:
    """Check that the board prepares slices in time while it slows down: a hold would end in a missed step otherwise.

    It is asked of all of the path at nearly the planned pace, where least time is left: an override may keep it so. The
    line waits then, and what steps take is what those take that come while a slice is prepared.
    """
    slices = Slices.of(table.durations.tolist())
    segment, count = slices.segment, np.bincount(slices.segment)
    moving = (table.counts > 0).sum(axis=1)[segment]
    anew = np.diff(slices.durations, prepend=slices.durations[0]) != 0
    within_segment = np.diff(segment, append=len(count)) == 0
    # A segment is read while the slice before is made, where there is time.
    reading = READ_SLOWED_TICKS + READ_SLOWED_JOINT_TICKS * table.counts.shape[1]
    work = SLOWED_TICKS + (SLOWED_JOINT_TICKS + SLOWED_ANEW_TICKS * anew) * moving
    work = work + reading // count[segment] + LINE_PASS_TICKS // UNSEEN_SLICES * within_segment
    taken = _interrupts(table, made).within(slices.starts - MIN_LEAD_TICKS, MIN_LEAD_TICKS)
    ahead_ticks, k = _ahead_of(slices, work, WAITING_LINE_LOAD + taken / MIN_LEAD_TICKS)
    where = f"segment {k}, {_time(int(table.starts[k]))}"
    setting = "joints.microsteps or joints.max_speed_deg_s"
    ahead_s = (ahead_ticks - SLOWED_SPARE_TICKS) / TICKS_HZ
    return at_least("time to spare in a stop", ahead_s, 0.0, "s", where, setting)


def _share_of_frame(table: SegmentTable) -> Floats:
    """Return each segment's share of its frame: half where the frame is sure to hold two of its size."""
    return np.where(2 * segment_bytes(table) + QUEUED_HEAD_BYTES <= SHARED_PAYLOAD_BYTES, 0.5, 1.0)


def _frame_bytes(table: SegmentTable) -> Floats:
    """Return each segment's bytes on the line, with its share of a frame: header, head, checks and delimiter."""
    return np.asarray(segment_bytes(table), np.float64) + _share_of_frame(table) * SEGMENTS_FRAME_BYTES


def _carried_bytes_s(link: LinkSpec) -> float:
    """Return what the line carries.

    That is less than its rate: at most HOST_WINDOW_BYTES are on their way until a reply has come back, and that takes
    their own time, the bridge's flush and the reply's time.
    """
    turn_s = (HOST_WINDOW_BYTES + REPLY_BYTES) / (link.baud / BITS_PER_BYTE) + FLUSH_S
    return HOST_WINDOW_BYTES / turn_s


def _check_margin(table: SegmentTable, link: LinkSpec) -> list[Check]:
    """Check how many times over the line carries what is asked of it up to any segment's start.

    What the queue holds at the start is not asked; where it holds all, there is nothing to check. The line that a plan
    meets is measured before it moves.
    """
    begun = _begun_before(table)
    later = np.flatnonzero(begun >= 0)
    name, setting = "bandwidth margin of the line", "link.baud or joints.microsteps"
    if not len(later):
        return []
    first = int(later[0])
    missing = np.cumsum(_frame_bytes(table)[first:])
    asked_bytes_s = missing * TICKS_HZ / np.maximum(table.starts[first:-1], 1)
    worst = int(asked_bytes_s.argmax())
    margin = _carried_bytes_s(link) / float(asked_bytes_s[worst])
    where = f"segment {first + worst}, {_time(int(table.starts[first + worst]))}"
    return [at_least(name, margin, 1.0, "times", where, setting)]


def _check_peak(table: SegmentTable, link: LinkSpec) -> Check:
    """Check the largest share of the line in any LINE_WINDOW_S, against what it carries."""
    line_bytes_s = link.baud / BITS_PER_BYTE
    budget = _carried_bytes_s(link) / line_bytes_s
    starts, total = table.starts[:-1], np.concatenate([[0.0], np.cumsum(_frame_bytes(table))])
    until = np.searchsorted(starts, starts + int(LINE_WINDOW_S * TICKS_HZ), side="left")
    sent: Floats = total[until] - total[np.arange(len(starts))]
    worst = int(sent.argmax())
    share = float(sent[worst]) / LINE_WINDOW_S / line_bytes_s
    where = _time(int(starts[worst]))
    setting = "link.baud or joints.microsteps"
    amber = min(AMBER_LINE_SHARE, budget)
    return at_most("peak share of the line", share, budget, "", where, setting, amber=amber)


def _check_supply(table: SegmentTable, link: LinkSpec) -> list[Check]:
    """Check that the line brings every segment before it starts, and the board reads it.

    The device holds queue_bytes of segments, so a segment is sent when those that fill them have begun. Its main
    program reads them one by one in the time that the interrupts of the running segment leave.
    """
    starts: list[int] = table.starts.tolist()
    line_ticks = (_frame_bytes(table) * BITS_PER_BYTE * TICKS_HZ / link.baud).tolist()
    loads: list[float] = _interrupt_loads(table).tolist()
    joints = table.counts.shape[1]
    work = [work_ticks(joints, (ticks - 1) // SLICE_TICKS) for ticks in table.durations.tolist()]
    line_tick = board_tick = 0.0
    line, board = [(float(starts[-1]), 0)], [(float(starts[-1]), 0)]
    before: list[int] = _begun_before(table).tolist()
    for k, begun in enumerate(before):
        if begun < 0:
            continue  # sent before the start
        line_tick = max(line_tick, float(starts[begun])) + line_ticks[k]
        board_tick = max(board_tick, line_tick)
        running = min(k, bisect_right(starts, board_tick) - 1)
        board_tick += work[k] / max(1.0 - loads[running], LEAST_SHARE)
        line.append((starts[k] - line_tick, k))
        board.append((starts[k] - board_tick - LATEST_READ_TICKS, k))
    board.append(_ahead_of_preparing(table))
    checks = []
    for name, found, setting in (
        ("time ahead of the line", line, "link.baud or joints.microsteps"),
        ("time ahead of the board", board, "joints.microsteps or joints.max_speed_deg_s"),
    ):
        ahead_ticks, k = min(found)
        where = f"segment {k}, {_time(starts[k])}" if len(found) > 1 else ""
        checks.append(at_least(name, ahead_ticks / TICKS_HZ, 0.0, "s", where, setting))
    return checks


def _ahead_of_preparing(table: SegmentTable) -> tuple[float, int]:
    """Return the least time by which a slice of a segment is prepared before it begins, and the segment.

    That takes its time also where the queue held everything at the start. What the board has to do on a segment is due
    by its first slice.
    """
    moving = (table.counts > 0).sum(axis=1)
    slices = Slices.of(table.durations.tolist())
    first = np.diff(slices.segment, prepend=-1) != 0
    moved = moving[slices.segment]
    work = np.where(first, READ_TICKS + READ_JOINT_TICKS * moved, SLICE_JOINT_TICKS * moved)
    return _ahead_of(slices, work, _interrupt_loads(table)[slices.segment])


def _ahead_of(slices: Slices, work: Ticks, loads: Floats) -> tuple[float, int]:
    """Return the least time by which slices are ready that take so much work each, and the segment where it is.

    `loads` is what interrupts leave no time for while each is prepared. The board prepares a slice MIN_LEAD_TICKS
    before its start, and no more than PREPARED_SLICES ahead.
    """
    starts = slices.starts
    takes = work / np.maximum(1.0 - loads, LEAST_SHARE)
    freed = np.concatenate([np.full(PREPARED_SLICES - 1, starts[0] - MIN_LEAD_TICKS), starts])[: len(starts)]
    begun = np.maximum(starts - MIN_LEAD_TICKS, freed)
    until = np.cumsum(takes)
    ahead = starts - until - np.maximum.accumulate(begun - (until - takes))
    k = int(ahead.argmin())
    return float(ahead[k]), int(slices.segment[k])


def _begun_before(table: SegmentTable) -> Ticks:
    """Return for each segment the last of those that must have begun before the queue has room for it; -1: none."""
    heads = QUEUED_HEAD_BYTES * _share_of_frame(table)
    total = np.concatenate([[0.0], np.cumsum(np.asarray(segment_bytes(table), np.float64) + heads)])
    begun: Ticks = np.searchsorted(total, total[1:] - table.board.queue_bytes, side="left") - 1
    return begun


def _interrupt_loads(table: SegmentTable) -> Floats:
    """Return the share of the processor that interrupts take while each segment runs and the line is busy."""
    each = np.array(STEP_INTERRUPT_TICKS[table.board.name][: table.counts.shape[1]])
    loads: Floats = LINE_LOAD + table.counts @ each / np.maximum(table.durations, 1)
    return loads


def _time(tick: int) -> str:
    return f"{tick / TICKS_HZ:.6f} s"
