"""The hard reference motion: how much of it the device's queue holds, and how hard it is."""

import numpy as np

from planarm.stepping.segments import Coding, compress
from planarm.stepping.stopping import held_until
from planarm.stepping.table import segment_bytes, table_of
from planarm_wire.messages import TICKS_HZ
from reference_motion import least_held_ticks, reference_train

QUEUE_HOLDS_S = 0.250


def test_the_motion_is_hard():
    train, axes = reference_train()
    gaps = [np.diff(steps.ticks).min() for steps in train.steps]
    reversals = [int((np.diff(steps.directions) != 0).sum()) for steps in train.steps]
    assert min(gaps) <= TICKS_HZ // 20_000 + 1
    assert min(reversals) >= 4
    assert len(axes) == 2


def test_the_queue_holds_a_quarter_of_a_second_of_it():
    """From wherever the queue is filled; what the plans reckon with is less, by what may be empty of it."""
    train, axes = reference_train()
    plan = compress(train, Coding.of(axes))
    held_ticks = least_held_ticks(plan.segments)
    assert held_ticks >= QUEUE_HOLDS_S * TICKS_HZ
    table = table_of(plan)
    reckoned = held_until(table.starts, segment_bytes(table), table.board.queue_bytes) - table.starts[1:]
    full = table.starts[1:] + held_ticks < table.starts[-1]
    assert reckoned[full].min() < held_ticks
