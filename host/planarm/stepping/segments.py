"""Compress a step train into the wire's segments, and check the result by expanding it again."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from planarm.errors import TimingError
from planarm.stepping.expand import expand
from planarm.stepping.greedy import ADD, COUNT, FIRST, INTERVAL, NEVER, cut
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.train import StepTrain, Ticks, require_steppable
from planarm.stepping.windows import EXACT_TO_1_US, Coding, tolerance_ticks, windows_of
from planarm_wire.messages import Move, Segment
from planarm_wire.steps import move_of

__all__ = ["Coding", "SegmentPlan", "compress", "expand"]


def compress(
    train: StepTrain,
    coding: Coding = EXACT_TO_1_US,
    latest_ticks: Sequence[int] = (),
    kept: Sequence[Segment] = (),
) -> SegmentPlan:
    """Return segments that make the train's steps: counts and directions exactly, times within their tolerance.

    The tolerance is `planarm.stepping.windows.tolerance_ticks`; no interval gets shorter than the train's shortest.
    `latest_ticks`, where given, tells of each joint how late its last step may be: what follows may be near. `kept`
    are the first segments, which make the train's first steps and stay as they are.

    Raises:
        TimingError: steps are too close to each other for the firmware.
    """
    require_steppable(train)
    if train.duration_ticks == 0:
        return SegmentPlan((), 0, train.start_usteps, wiring=train.wiring)
    windows = windows_of(train, coding, latest_ticks)
    before = expand(SegmentPlan(tuple(kept), 0, train.start_usteps, wiring=train.wiring))
    made = np.array([len(joint.ticks) for joint in before.steps], np.int64)
    last = np.array([joint.ticks[-1] if len(joint.ticks) else NEVER for joint in before.steps], np.int64)
    begin = before.duration_ticks
    ends, runs = cut(windows, made, last, begin, coding.fast_ticks, train.duration_ticks)
    segments = (*kept, *_segments(train, made.tolist(), [begin, *ends.tolist()], runs))
    plan = SegmentPlan(segments, train.duration_ticks, train.start_usteps, wiring=train.wiring)
    _require_same_steps(train, expand(plan), coding)
    return plan


def _segments(train: StepTrain, made: Sequence[int], borders: Sequence[int], runs: Ticks) -> tuple[Segment, ...]:
    """Return the wire's form of the runs; a run's direction is that of its first step in the train."""
    following = list(made)
    resting = (Move(0),) * (train.board.joints - len(train.steps))
    segments = []
    for k, (begin, end) in enumerate(pairwise(borders)):
        moves = []
        for j, run in enumerate(runs[k].tolist()):
            count = run[COUNT]
            positive = count > 0 and train.steps[j].directions[following[j]] > 0
            moves.append(move_of(count, positive, run[FIRST], run[INTERVAL] >> 8, run[ADD]))
            following[j] += count
        is_last = k == len(runs) - 1
        segments.append(Segment(2 * (end - begin) + int(is_last), (*moves, *resting)))
    return tuple(segments)


def _require_same_steps(wanted: StepTrain, made: StepTrain, coding: Coding) -> None:
    """Check that the expanded segments are the train's steps; compression is never trusted."""
    if made.duration_ticks != wanted.duration_ticks:
        raise TimingError(f"the segments last {made.duration_ticks} ticks, the motion {wanted.duration_ticks}")
    for number, (steps, expanded) in enumerate(zip(wanted.steps, made.steps, strict=True), start=1):
        if not np.array_equal(steps.directions, expanded.directions):
            raise TimingError(f"the segments do not make the steps of joint {number} in number and direction")
        moved = np.abs(expanded.ticks - steps.ticks) - tolerance_ticks(steps, coding)
        if len(moved) and moved.max() > 0:
            n = int(moved.argmax())
            raise TimingError(
                f"the segments make step {n} of joint {number} at tick {expanded.ticks[n]} instead of {steps.ticks[n]}"
            )
