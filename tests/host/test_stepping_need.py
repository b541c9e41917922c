"""The path time to rest that is told with each segment, against the device's rule walked from docs/protocol.md."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from host_scenes import make_scene
from motion_paths import joint, waves
from planarm.model.transmission import Transmission, motor_axes
from planarm.stepping.stopping import allowances, device_slice_ticks
from planarm.stepping.windows import start_stop_ticks
from planarm.trajectory.timing import time_path
from planarm_wire.messages import NEED_UNIT_TICKS, SLICE_TICKS, STARVING_TICKS, TICKS_HZ
from planarm_wire.rates import MAX_CODE, MESSAGE_SEGMENTS, head_of, rate_value
from stretch_motion import ONE, slice_ticks, slowed

FINE_TICKS = 1000
"""How far apart speeds are looked at; what is rounded by that is allowed for."""


class Told:
    """A random motion in segments of random lengths, in messages of random numbers of them, and the device's stops."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        one = joint(speed=rng.uniform(0.5, 6.0), acceleration=float(10 ** rng.uniform(0.3, 1.8)))
        scene = replace(make_scene(), joints=(one, one))
        motion = time_path(waves(rng), scene.joints)
        self.durations = []
        longest = SLICE_TICKS * rng.choice([1, 2, 4, 8])
        while sum(self.durations) < motion.duration_s * TICKS_HZ:
            self.durations.append(int(rng.integers(6000, longest + 1)))
        told, self.heads = allowances(motion, scene, self.durations), []
        while len(self.heads) < len(told):
            count = int(rng.integers(1, MESSAGE_SEGMENTS + 1))
            some = told[len(self.heads) : len(self.heads) + count]
            self.heads += [head_of(some)] * len(some)
        ticks = np.arange(0, sum(self.durations) + FINE_TICKS, FINE_TICKS)
        rates_hz = np.abs(Transmission.of(scene).rates(motion.sample(ticks / TICKS_HZ)[1]))
        axes = motor_axes(scene.joints, scene.coupling)
        self.over = (rates_hz * [start_stop_ticks(axis) for axis in axes] / TICKS_HZ).max(axis=1)

    def is_calm(self, begin, length, stretch):
        """All over a slice, at the least of its stretches."""
        part = self.over[begin // FINE_TICKS : -(-(begin + length) // FINE_TICKS) + 1]
        return part.max() <= stretch / ONE

    def slices(self, segment, begin, left, stretch, slows):
        """Segment, start and length of the device's slices from within a segment on; with `slows` up to its rest."""
        for k in range(segment, len(self.durations)):
            left = left if k == segment else self.durations[k]
            while left:
                length = slice_ticks(left, stretch)
                if slows and self.is_calm(begin, length, stretch):
                    return
                yield k, begin, length, left
                stretch = slowed(stretch, rate_value(self.heads[k][0]), length) if slows else stretch
                begin, left = begin + length, left - length

    def stops(self):
        """For each slice at the planned pace: its segment, and the path that a stop from its start takes."""
        for k, begin, _, left in self.slices(0, 0, self.durations[0], ONE, slows=False):
            yield k, sum(length for _, _, length, _ in self.slices(k, begin, left, ONE, slows=True))


def test_a_stop_from_any_slice_is_over_within_what_is_told(sized):
    """What is told to the slice before a stop holds it, with the path that the device keeps besides.

    It takes more than is told alone hardly ever, where the message's rates let the device cut in another way.
    """
    beyond = []
    for seed in range(sized(12, 1500)):
        told = Told(seed)
        stops = list(told.stops())
        needs = [NEED_UNIT_TICKS * need if need < MAX_CODE else np.inf for _, _, need in told.heads]
        beyond += [stop - needs[before] for (before, _), (_, stop) in pairwise(stops)]
        beyond += [stop - needs[k] for k, stop in stops]
    assert max(beyond) <= STARVING_TICKS
    assert np.mean(np.array(beyond) > 0) < 1e-3
    assert np.mean(np.array(beyond) > -2 * SLICE_TICKS) > 0.1, "what is told is no more than it has to be"


@pytest.mark.parametrize("stretch", [1.0, 1.9, 2.0, 3.0, 4.0, 15.9, 16.0])
@pytest.mark.parametrize("left", [1, SLICE_TICKS // 2, SLICE_TICKS - 1, SLICE_TICKS, SLICE_TICKS + 1, 85_000, 10**6])
def test_slices_are_cut_as_the_protocol_says(stretch, left):
    assert device_slice_ticks(left, stretch) == slice_ticks(left, int(stretch * ONE))
