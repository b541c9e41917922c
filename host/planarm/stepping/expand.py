"""Segments back to steps, in Python's own integers: the independent check of everything that makes segments."""

import numpy as np

from planarm.stepping.plan import SegmentPlan
from planarm.stepping.train import JointSteps, StepTrain


def expand(plan: SegmentPlan) -> StepTrain:
    """Return the steps that the segments stand for, on their ticks from the motion's start."""
    joints = len(plan.start_usteps)
    ticks: list[list[int]] = [[] for _ in range(joints)]
    directions: list[list[int]] = [[] for _ in range(joints)]
    begin = 0
    for segment in plan.segments:
        for j, move in enumerate(segment.moves):
            count, positive = divmod(move.steps_dir, 2)
            at_q16, interval_q16 = 0, move.interval_q16
            for _ in range(count):
                ticks[j].append(begin + move.first_ticks + at_q16 // 65536)
                directions[j].append(1 if positive else -1)
                at_q16 += interval_q16
                interval_q16 += move.add_q16
        begin += segment.duration_flags // 2
    steps = tuple(
        JointSteps(np.array(at, np.int64), np.array(signs, np.int8))
        for at, signs in zip(ticks, directions, strict=True)
    )
    return StepTrain(plan.start_usteps, steps, begin)
