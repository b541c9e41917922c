"""Both joints at 50,000 steps/s at once: planned, certified, streamed at the default baud, held against the pins."""

from pathlib import Path

import numpy as np
import pytest

from planarm.link.exchange import stream_plan
from planarm.link.transport import open_transport
from planarm.pipeline import plan_scene
from planarm.scene import load_scene
from planarm.stepping.expand import expand
from planarm.streaming.plan_stream import options_for
from planarm_wire.messages import STEP_PINS, TICKS_HZ, State

SCENE = Path(__file__).resolve().parents[2] / "examples/fast_arm.toml"
RATE_HZ = 50_000
STEPS = 16
MOST_OF_THE_LINE = 0.4


@pytest.fixture(scope="module")
def plan():
    return plan_scene(load_scene(SCENE), lambda _stage, _share: None)


def value_of(plan, name):
    return next(check.value for check in plan.certificate.checks if check.name == name)


def stretches_at_rate(ticks):
    """Where a joint steps at the rate, no 16 steps of it more than 1 % slower: (begin, end) of each stretch, in ticks.

    Single intervals are longer than others where one segment goes over into the next.
    """
    fast = ticks[STEPS:] - ticks[:-STEPS] <= 1.01 * STEPS * TICKS_HZ / RATE_HZ
    borders = np.flatnonzero(np.diff(np.concatenate(([False], fast, [False]))))
    return [(ticks[first], ticks[end - 1 + STEPS]) for first, end in borders.reshape(-1, 2)]


def test_both_joints_step_at_50_000_a_second_at_the_same_time(plan):
    joints = [joint.ticks for joint in expand(plan.segments).steps]
    first, second = map(stretches_at_rate, joints)
    begin, end = max(
        ((max(a[0], b[0]), min(a[1], b[1])) for a in first for b in second), key=lambda both: both[1] - both[0]
    )
    assert (end - begin) / TICKS_HZ > 0.2
    for ticks in joints:
        made = np.count_nonzero((ticks >= begin) & (ticks < end))
        assert made == pytest.approx((end - begin) / TICKS_HZ * RATE_HZ, rel=0.001)


def test_the_line_has_room(plan):
    """The line is that of the default baud; the share is of its bytes, in the worst quarter of a second."""
    assert plan.scene.link.baud == 250_000
    assert plan.certificate.ok, plan.certificate.explain()
    assert value_of(plan, "peak share of the line") < MOST_OF_THE_LINE


def test_it_streams_without_starving_and_every_step_is_on_its_tick(plan):
    line = open_transport("sim://", plan.scene.link.baud)
    told = []
    result = stream_plan(line, plan.segments.segments, told.append, options_for(plan.scene, plan.segments))
    running = [one for one in told if one.state is not State.READY]
    assert result.path_clock_percent == 100
    assert {one.state for one in running} == {State.RUNNING}
    assert min(one.rate_percent for one in running) == 100
    assert result.least_queued > 10, "the queue was filled again before it ran low"
    begin = None
    for pin, joint in zip(STEP_PINS, expand(plan.segments).steps, strict=True):
        edges = line.pins.edges(pin)
        rises = edges["cycle"][edges["level"] == 1]
        begin = rises[0] - joint.ticks[0] if begin is None else begin
        np.testing.assert_array_equal(rises - begin, joint.ticks)
    line.close()
