"""How far compression may move each step: windows that always leave a way through.

A step may be early or late by its tolerance. But a late step pushes the next one, so the windows are tightened: the
latest tick of a step leaves room for the least gap to the latest tick of the next. Exact ticks keep all gaps, so they
stay inside, and from any choice up to some step the rest can be chosen.
"""

from typing import NamedTuple

import numpy as np

from planarm.stepping.train import MIN_REVERSAL_TICKS, Directions, JointSteps, StepTrain, Ticks
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import MAX_INTERVAL_TICKS, MAX_SEGMENT_STEPS, MIN_DIR_SETUP_TICKS, MIN_INTERVAL_TICKS

TOLERANCE_TICKS = 6
TOLERANCE_SHARE = 0.02
"""A step may be moved by TOLERANCE_TICKS, or by this share of the shorter of the two intervals around it if larger."""


class Windows(NamedTuple):
    """The steps of all joints, one joint after the other."""

    steps: Ticks
    """Shape (steps of all joints, 6), with the columns below."""
    first: Ticks
    """Index of each joint's first step, then the number of all, shape (joints + 1,)."""
    least_interval: Ticks
    """Least interval of each joint in one direction, shape (joints,)."""


LOW, HIGH, GAP, SETUP, RUN_END, TICK = 0, 1, 2, 3, 4, 5
"""Columns of a step: earliest and latest tick; least ticks since the joint's step before; least ticks since the start
of the step's segment, above 0 where DIR may change; index after the last step that may share a run with this one; the
exact tick."""


def tolerance_ticks(steps: JointSteps) -> Ticks:
    """Return by how much compression may move each step, shape (n,)."""
    gaps = np.diff(steps.ticks)
    if not len(gaps):
        return np.full(len(steps.ticks), TOLERANCE_TICKS, np.int64)
    shorter = np.minimum(np.append(gaps[0], gaps), np.append(gaps, gaps[-1]))
    tolerance: Ticks = np.maximum(TOLERANCE_TICKS, (TOLERANCE_SHARE * shorter).astype(np.int64))
    return tolerance


def least_interval_ticks(steps: JointSteps) -> int:
    """Return the shortest interval between steps in one direction: compression makes none shorter."""
    along = np.diff(steps.ticks)[np.diff(steps.directions) == 0]
    return int(along.min()) if len(along) else MIN_INTERVAL_TICKS


def windows_of(train: StepTrain) -> Windows:
    """Return the windows of all steps."""
    first = np.cumsum([0, *(len(joint.ticks) for joint in train.steps)], dtype=np.int64)
    least = np.array([least_interval_ticks(joint) for joint in train.steps], np.int64)
    steps = np.empty((first[-1], 6), np.int64)
    for j, joint in enumerate(train.steps):
        part = steps[first[j] : first[j + 1]]
        tolerance = tolerance_ticks(joint)
        part[:, TICK] = joint.ticks
        part[:, LOW] = joint.ticks - tolerance
        part[:, HIGH] = np.minimum(joint.ticks + tolerance, train.duration_ticks - 1)
        _tighten(joint.ticks, joint.directions, least[j], part)
        part[:, RUN_END] += first[j]
    return Windows(steps, first, least)


@kernel
def _tighten(ticks: Ticks, directions: Directions, least_interval: int, steps: Ticks) -> None:
    """Fill the other columns of one joint's steps, and tighten their windows."""
    count = ticks.shape[0]
    for n in range(count):
        turns = n == 0 or directions[n] != directions[n - 1]
        steps[n, GAP] = MIN_REVERSAL_TICKS if turns else least_interval
        steps[n, SETUP] = MIN_DIR_SETUP_TICKS if turns else 0
    for n in range(count - 1, -1, -1):
        if n + 1 < count:
            steps[n, HIGH] = min(steps[n, HIGH], steps[n + 1, HIGH] - steps[n + 1, GAP])
        ends = n + 1 == count or steps[n + 1, SETUP] > 0 or ticks[n + 1] - ticks[n] > MAX_INTERVAL_TICKS
        steps[n, RUN_END] = n + 1 if ends else steps[n + 1, RUN_END]
    for n in range(count):
        steps[n, RUN_END] = min(steps[n, RUN_END], n + MAX_SEGMENT_STEPS)
