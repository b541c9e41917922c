"""The hard reference motions: how much of them the device's queue holds, and how hard they are."""

import numpy as np
import pytest

from planarm.stepping.segments import Coding, compress
from planarm.stepping.stopping import held_until
from planarm.stepping.table import segment_bytes, table_of
from planarm_wire.messages import TICKS_HZ
from reference_motion import least_held_ticks, reference_train

QUEUE_HOLDS_S = {2: 0.270, 4: 0.120}
"""By the number of joints."""


@pytest.mark.parametrize(("joints", "usteps_hz"), [(2, 20_000), (4, 15_000)])
def test_the_motion_is_hard(joints, usteps_hz):
    train, axes = reference_train(joints)
    gaps = [np.diff(steps.ticks).min() for steps in train.steps]
    reversals = [int((np.diff(steps.directions) != 0).sum()) for steps in train.steps]
    assert min(gaps) <= TICKS_HZ // usteps_hz + 1
    assert min(reversals) >= 4
    assert len(axes) == joints


@pytest.mark.parametrize("joints", [2, 4])
def test_the_queue_holds_so_much_of_it(joints):
    """From wherever the queue is filled; what the plans reckon with is less, by what may be empty of it."""
    train, axes = reference_train(joints)
    plan = compress(train, Coding.of(axes))
    held_ticks = least_held_ticks(plan.segments, train.board.queue_bytes)
    assert held_ticks >= QUEUE_HOLDS_S[joints] * TICKS_HZ
    table = table_of(plan)
    reckoned = held_until(table.starts, segment_bytes(table), table.board.queue_bytes) - table.starts[1:]
    full = table.starts[1:] + held_ticks < table.starts[-1]
    assert reckoned[full].min() < held_ticks
