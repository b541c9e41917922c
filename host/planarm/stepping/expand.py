"""Segments back to steps, all at once: the independent check of everything that makes segments.

`planarm_wire.steps` says the same step by step, in Python's own integers; a test holds both together.
"""

import numpy as np

from planarm.stepping.plan import SegmentPlan
from planarm.stepping.train import JointSteps, StepTrain
from planarm_wire.steps import add_q16


def expand(plan: SegmentPlan) -> StepTrain:
    """Return the steps that the segments stand for, on their ticks from the motion's start.

    64 bits hold every term: n < 2^15 steps, intervals below 2^32 and adds below 2^31 in size, in ticks / 2^16; in a
    slow move n < 2^7, 2^40 and 2^39.
    """
    durations = np.array([segment.duration_flags >> 1 for segment in plan.segments], np.int64)
    begins = np.cumsum(durations) - durations
    steps = []
    for j in range(len(plan.start_usteps)):
        moves = [segment.moves[j] for segment in plan.segments]
        table = np.array([(m.steps_dir, m.first_ticks, m.interval_q8 << 8, add_q16(m)) for m in moves], np.int64)
        steps_dir, first, interval, add = table.reshape(-1, 4).T
        counts = steps_dir >> 1
        run = np.repeat(np.arange(len(counts)), counts)
        n = np.arange(len(run)) - (np.cumsum(counts) - counts)[run]
        since_first = (n * interval[run] + n * (n - 1) // 2 * add[run]) >> 16
        signs = np.where(steps_dir & 1, 1, -1).astype(np.int8)
        steps.append(JointSteps((begins + first)[run] + since_first, signs[run]))
    return StepTrain(plan.start_usteps, tuple(steps), int(durations.sum()), plan.wiring)
