"""How far compression may move each step: windows that always leave a way through.

A step may be early or late by its tolerance. But a late step pushes the next one, so the windows are tightened: the
latest tick of a step leaves room for the least gap to the latest tick of the next. Exact ticks keep all gaps, so they
stay inside, and from any choice up to some step the rest can be chosen.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple, Self

import numpy as np

from planarm.scene import JointSpec
from planarm.stepping.train import Directions, JointSteps, StepTrain, Ticks, least_reversal_ticks, timing_share
from planarm_wire.boards import Board
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import (
    MAX_SEGMENT_STEPS,
    MIN_DIR_SETUP_TICKS,
    SLICE_TICKS,
    TICKS_HZ,
)
from planarm_wire.steps import LONGEST_INTERVAL_TICKS


@dataclass(frozen=True, slots=True)
class Coding:
    """What compression must keep to.

    A step may be moved by the greater of `share` of the shorter interval around it and `ticks`, the latter at most
    `most_share` of that interval: 1 us is much where steps are 20 us apart, and the arm's distance from the plan,
    `planarm.stepping.quantise.timing_usteps`, has to hold there, too.

    Attributes:
        ticks: 16 are 1 us.
        share: of the shorter interval.
        most_share: of the shorter interval, the most that `ticks` may be.
        fast_ticks: a segment may be no longer than this where any motor is above its start-stop speed: its allowances
            hold for all of it.
        start_stop_ticks: of each motor, the interval at that speed; a motor that is not listed has none, is never fast.
    """

    ticks: int = 16
    share: float = 0.02
    most_share: float = 0.04
    fast_ticks: int = 4 * SLICE_TICKS
    start_stop_ticks: tuple[int, ...] = ()

    @classmethod
    def of(cls, axes: Sequence[JointSpec]) -> Self:
        """Return the coding for motors with these axes' accelerations, on the board of so many."""
        share = timing_share(len(axes))
        return cls(share=share, start_stop_ticks=tuple(start_stop_ticks(axis) for axis in axes))


def start_stop_ticks(axis: JointSpec) -> int:
    """Return the interval at a motor's start-stop speed, sqrt(2 a) micro-steps/s.

    From rest, with all of its acceleration, a motor has that speed after one micro-step: it may start or stop at it.
    """
    return int(TICKS_HZ / sqrt(2.0 * axis.max_acceleration_rad_s2 * axis.usteps_per_rad))


EXACT_TO_1_US = Coding()


class Windows(NamedTuple):
    """The steps of all joints, one joint after the other."""

    steps: Ticks
    """Shape (steps of all joints, 7), with the columns below."""
    first: Ticks
    """Index of each joint's first step, then the number of all, shape (joints + 1,)."""
    least_interval: Ticks
    """Least interval of each joint in one direction, shape (joints,)."""


LOW, HIGH, GAP, SETUP, RUN_END, TICK, FAST = 0, 1, 2, 3, 4, 5, 6
"""Columns of a step: earliest and latest tick; least ticks since the joint's step before; least ticks since the start
of the step's segment, above 0 for the first step, since DIR may change at START; index after the last step that may
share a run with this one; the exact tick; how many of the joint's intervals up to this step are those of a fast motor.
"""


def tolerance_ticks(steps: JointSteps, coding: Coding = EXACT_TO_1_US) -> Ticks:
    """Return by how much compression may move each step, shape (n,)."""
    gaps = np.diff(steps.ticks)
    if not len(gaps):
        return np.full(len(steps.ticks), coding.ticks, np.int64)
    shorter = np.minimum(np.append(gaps[0], gaps), np.append(gaps, gaps[-1]))
    most = np.minimum(coding.ticks, coding.most_share * shorter)
    tolerance: Ticks = np.maximum(most, coding.share * shorter).astype(np.int64)
    return tolerance


def least_interval_ticks(steps: JointSteps, board: Board) -> int:
    """Return the shortest interval between steps in one direction: compression makes none shorter."""
    along = np.diff(steps.ticks)[np.diff(steps.directions) == 0]
    return int(along.min()) if len(along) else board.min_interval_ticks


def windows_of(train: StepTrain, coding: Coding = EXACT_TO_1_US, latest_ticks: Sequence[int] = ()) -> Windows:
    """Return the windows of all steps; `latest_ticks` tells how late each joint's last step may be, where given."""
    first = np.cumsum([0, *(len(joint.ticks) for joint in train.steps)], dtype=np.int64)
    least = np.array([least_interval_ticks(joint, train.board) for joint in train.steps], np.int64)
    steps = np.empty((first[-1], 7), np.int64)
    reversal_ticks = least_reversal_ticks(train.board)
    for j, joint in enumerate(train.steps):
        part = steps[first[j] : first[j + 1]]
        tolerance = tolerance_ticks(joint, coding)
        part[:, TICK] = joint.ticks
        part[:, LOW] = joint.ticks - tolerance
        part[:, HIGH] = np.minimum(joint.ticks + tolerance, train.duration_ticks - 1)
        if len(part) and j < len(latest_ticks):
            part[-1, HIGH] = min(part[-1, HIGH], latest_ticks[j])
        _tighten(joint.ticks, joint.directions, least[j], reversal_ticks, part)
        part[:, RUN_END] += first[j]
        start_stop = coding.start_stop_ticks[j] if j < len(coding.start_stop_ticks) else 0
        part[:, FAST] = np.cumsum(np.diff(joint.ticks, prepend=-(1 << 62)) < start_stop)
    return Windows(steps, first, least)


@kernel
def _tighten(ticks: Ticks, directions: Directions, least_interval: int, reversal: int, steps: Ticks) -> None:
    """Fill the other columns of one joint's steps, and tighten their windows."""
    count = ticks.shape[0]
    for n in range(count):
        turns = n == 0 or directions[n] != directions[n - 1]
        steps[n, GAP] = reversal if turns else least_interval
        steps[n, SETUP] = MIN_DIR_SETUP_TICKS if n == 0 else 0
    for n in range(count - 1, -1, -1):
        if n + 1 < count:
            steps[n, HIGH] = min(steps[n, HIGH], steps[n + 1, HIGH] - steps[n + 1, GAP])
        ends = n + 1 == count or directions[n + 1] != directions[n]
        ends = ends or steps[n + 1, LOW] - steps[n, HIGH] > LONGEST_INTERVAL_TICKS
        steps[n, RUN_END] = n + 1 if ends else steps[n + 1, RUN_END]
    for n in range(count):
        steps[n, RUN_END] = min(steps[n, RUN_END], n + MAX_SEGMENT_STEPS)
