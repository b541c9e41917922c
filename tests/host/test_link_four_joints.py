"""Three and four joints from steps to pins: padded segments, the four-joint image in sim://, its ledger."""

import numpy as np
import pytest

from planarm.link.exchange import stream_plan
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm.link.stream import StreamOptions
from planarm.link.stream_values import plain_config
from planarm.stepping.segments import compress, expand
from planarm.stepping.train import JointSteps, StepTrain
from planarm_wire.errors import WireError
from planarm_wire.wirings import board_of

LATEST_TICKS = {0: 0, 1: 0, 2: 192, 3: 192}  # 12 us of the joints that an interrupt steps


def steps_of(joint):
    ticks = 20_000 + np.arange(200) * (1500 + 37 * joint)
    return JointSteps(ticks, np.full(len(ticks), 1 if joint % 2 else -1, np.int8))


@pytest.mark.parametrize("joints", [3, 4])
def test_an_arm_with_more_joints_streams_to_the_board_that_has_them(joints):
    train = StepTrain((0,) * joints, tuple(steps_of(joint) for joint in range(joints)), 400_000)
    plan = compress(train)
    board = board_of(joints)
    assert {len(segment.moves) for segment in plan.segments} == {board.joints} == {4}
    made = expand(plan)
    transport = SimTransport(released_image(board.name))
    result = stream_plan(transport, plan.segments, None, StreamOptions(config=plain_config(board)))
    moved = [200 if joint % 2 else -200 for joint in range(joints)]
    assert list(result.ledger_after.position_usteps) == [*moved, *[0] * (4 - joints)]
    rises = []
    for pin in board.step_pins[:joints]:
        edges = transport.pins.edges(pin)
        rises.append(edges["cycle"][edges["level"] == 1])
    begin = rises[0][0] - made.steps[0].ticks[0]
    for joint, cycles in enumerate(rises):
        assert np.abs(cycles - begin - made.steps[joint].ticks).max() <= LATEST_TICKS[joint]


def test_no_board_steps_five_joints():
    with pytest.raises(WireError, match="5 joints; the wiring own has pins for 4"):
        board_of(5)
