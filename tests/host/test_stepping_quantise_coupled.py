"""Steps of motors that move several joints, and of arms with one to four joints."""

from dataclasses import replace

import numpy as np
import pytest

from motion_paths import JointCurve, joint
from planarm.model.transmission import Transmission, motor_axes
from planarm.stepping.quantise import hysteresis_usteps, quantise
from planarm.stepping.segments import Coding, compress, expand
from planarm.trajectory.timing import time_path

TICKS_HZ = 16_000_000


def wave_path(joints, seed):
    """A sum of two sines in each joint, with reversals at different places."""
    rng = np.random.default_rng(seed)
    sizes, rates, phases = (rng.uniform(low, high, (joints, 2)) for low, high in ((0.1, 0.5), (1.0, 5.0), (0.0, 6.0)))

    def total(wave, power):
        def values(s):
            turned = wave(np.asarray(s)[:, None, None] * rates + phases)
            return list((sizes * rates**power * turned).sum(axis=2).T)

        return values

    return JointCurve(total(np.sin, 0), total(np.cos, 1), total(lambda x: -np.sin(x), 2), borders=(0.0, 1.5, 3.0))


def belts(joints):
    """Each motor stands in the base: it turns by the sum of the joints up to its own."""
    return tuple(tuple(float(j <= m) for j in range(joints)) for m in range(joints))


@pytest.mark.parametrize("count", [1, 2, 3, 4])
@pytest.mark.parametrize("belted", [False, True])
def test_every_motor_stands_on_its_nearest_micro_step(count, belted):
    specs = [replace(joint(1.5, 8.0), reversed=j % 2 == 1, zero_offset_rad=0.1 * j) for j in range(count)]
    coupling = belts(count) if belted else None
    motion = time_path(wave_path(count, seed=count), specs)
    train = quantise(motion, specs, coupling)
    transmission = Transmission.from_joints(specs, coupling)
    ticks = np.linspace(0, train.duration_ticks, 20_011).astype(np.int64)
    q, qd, _ = motion.sample(ticks / TICKS_HZ)
    planned, rates = transmission.usteps(q), np.abs(transmission.rates(qd))
    for m, axis in enumerate(motor_axes(specs, coupling)):
        after = np.concatenate([[0], np.cumsum(train.steps[m].directions, dtype=np.int64)])
        stands = train.start_usteps[m] + after[np.searchsorted(train.steps[m].ticks, ticks, side="right")]
        allowed = 0.5 + 0.5 / TICKS_HZ * rates[:, m].max() + hysteresis_usteps(axis, train.board) + 1e-6
        assert np.abs(stands - planned[:, m]).max() <= allowed
    plan = compress(train, Coding.of(motor_axes(specs, coupling)))
    assert expand(plan).end_usteps == train.end_usteps
