"""Bytes of compressed trains against the minimum over all ways to cut them, where that can be computed."""

import numpy as np
import pytest

from fewest_bytes import SHARE_OF_FRAME, FewestBytes
from motion_paths import joint, waves
from planarm.stepping.quantise import quantise
from planarm.stepping.segments import Coding, compress
from planarm.stepping.train import JointSteps, StepTrain
from planarm.trajectory.timing import time_path
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import MAX_SEGMENT_TICKS, SLICE_TICKS


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


def ours(train, coding):
    return sum(encoded_bytes(segment) + SHARE_OF_FRAME for segment in compress(train, coding).segments)


@pytest.fixture(scope="module")
def trains(sized):
    """(train, coding, oracle) of each seed."""
    made = [short_train(seed) for seed in range(sized(8, 150))]
    return [(train, coding, FewestBytes(train, coding)) for train, coding in made]


@pytest.mark.parametrize(
    "fast_ticks", [SLICE_TICKS, 4 * SLICE_TICKS, MAX_SEGMENT_TICKS], ids=["a slice", "four slices", "no limit"]
)
def test_bytes_are_within_five_percent_of_the_minimum(trains, fast_ticks, record_property):
    """On the line: each segment with its share of a frame. The minimum is of a slightly easier problem, see there."""
    limited = [Coding(start_stop_ticks=coding.start_stop_ticks, fast_ticks=fast_ticks) for _, coding, _ in trains]
    found = [ours(train, coding) for (train, _, _), coding in zip(trains, limited, strict=True)]
    least = [oracle.bytes_with(fast_ticks) for _, _, oracle in trains]
    assert all(a >= b for a, b in zip(found, least, strict=True)), list(zip(found, least, strict=True))
    record_property("over the minimum", sum(found) / sum(least) - 1.0)
    assert sum(found) <= 1.05 * sum(least), f"{100.0 * (sum(found) / sum(least) - 1.0):.1f} % over the minimum"
