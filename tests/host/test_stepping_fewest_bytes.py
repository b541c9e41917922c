"""Bytes of compressed trains against the minimum over all ways to cut them, where that can be computed."""

import numpy as np
import pytest

from fewest_bytes import SHARE_OF_FRAME, fewest_bytes
from motion_paths import joint, waves
from planarm.stepping.quantise import quantise
from planarm.stepping.segments import Coding, compress
from planarm.stepping.train import JointSteps, StepTrain
from planarm.trajectory.timing import time_path
from planarm_wire.codec import encoded_bytes


def short_train(seed):
    """(train, coding): ten to twenty-seven steps of both joints out of a fast motion, with few or many steps a turn."""
    rng = np.random.default_rng(seed)
    one = joint(8.0, 60.0, int(rng.choice([800, 3200, 16_000])))
    whole = quantise(time_path(waves(rng), [one, one]), [one, one])
    at = np.sort(np.concatenate([steps.ticks for steps in whole.steps]))
    first = rng.integers(0, len(at) - 40)
    begin, end = at[first] - 1, at[first + int(rng.integers(10, 28))]
    parts = [(steps, (steps.ticks >= begin) & (steps.ticks < end)) for steps in whole.steps]
    steps = tuple(JointSteps(one.ticks[part] - begin + 400, one.directions[part]) for one, part in parts)
    return StepTrain((0, 0), steps, int(end - begin) + 800), Coding.of([one, one])


@pytest.mark.parametrize("capped", [True, False])
def test_bytes_are_within_five_percent_of_the_minimum(capped, sized):
    """On the line: each segment with its share of a frame. The minimum is of a slightly easier problem, see there."""
    ours, least = [], []
    for seed in range(sized(8, 150)):
        train, coding = short_train(seed)
        coding = coding if capped else Coding(start_stop_ticks=(0, 0))
        segments = compress(train, coding).segments
        ours.append(sum(encoded_bytes(segment) + SHARE_OF_FRAME for segment in segments))
        least.append(fewest_bytes(train, coding))
    assert all(a >= b for a, b in zip(ours, least, strict=True)), list(zip(ours, least, strict=True))
    assert sum(ours) <= 1.05 * sum(least)
