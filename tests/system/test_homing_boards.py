"""Homing with limit switches on every board, three and four joints among them: what is told is what the plant knows."""

from dataclasses import replace

import numpy as np
import pytest

from board_scenes import START, scene_of
from planarm.link.arm_record import ArmSetup
from planarm.link.positions import Positions
from planarm.link.transport import open_transport
from planarm.operations.arm_moves import goto
from planarm.operations.homing import home, prove_steps
from planarm.scene import LimitSwitchSpec
from planarm.streaming.standing import look, pose_of, start_usteps

PORT = "/dev/ttyUNO"
BOARDS = [(3, "own"), (4, "cnc_shield")]
ABOVE = (True, False, True, False)
NEAR_DEG = 3.0
"""From the start to the switch."""
STALLED_S = 12.0
"""When a rotor is jammed; homing has long ended."""


@pytest.fixture
def positions(tmp_path):
    return Positions(tmp_path / "state" / "positions.json")


def switched(joints, wiring):
    """An arm with a switch on every joint, on alternate sides; a board's limit pins in their order."""
    scene = scene_of(joints, wiring)
    switches = tuple(
        LimitSwitchSpec(number, pin, np.radians(start + (NEAR_DEG if above else -NEAR_DEG)), above, 0.001)
        for number, (pin, start, above) in enumerate(zip(scene.board.limit_pins, START, ABOVE, strict=False), start=1)
    )
    return replace(scene, limit_switches=switches[:joints])


def arm_of(scene, faults=None):
    line = open_transport("sim://", 250_000, ArmSetup(scene, start_usteps(scene), faults))
    line.clock.wait_until(0.05)
    return line


def really_rad(line):
    line.arm.settle(0.2)
    return line.arm.record().q_rad[-1]


def go(line, scene, positions, pose_deg):
    return goto(
        line, scene, look(line, PORT, scene, positions), None, lambda _told: None, pose_rad=np.radians(pose_deg)
    )


@pytest.mark.parametrize(("joints", "wiring"), BOARDS)
def test_homing_finds_every_switch_and_loses_nothing(joints, wiring, positions):
    scene = switched(joints, wiring)
    line = arm_of(scene)
    homed = home(line, PORT, scene, positions)
    assert homed.known_by is None
    assert len(homed.touched) == joints
    standing = look(line, PORT, scene, positions)
    assert (standing.how, standing.usteps) == ("homed", homed.usteps)
    told_rad = pose_of(scene, standing.usteps)[0]
    np.testing.assert_allclose(told_rad, really_rad(line), atol=np.radians(0.1))
    at_switches = np.radians([s + (NEAR_DEG if above else -NEAR_DEG) for s, above in zip(START, ABOVE, strict=True)])
    np.testing.assert_allclose(told_rad, at_switches[:joints], atol=np.radians(0.2))
    go(line, scene, positions, START[:joints])
    proof = prove_steps(line, PORT, scene, positions)
    assert proof.lost_usteps == (0,) * joints
    assert line.arm.record().lost_full_steps == (0,) * joints


def test_a_jammed_rotors_loss_is_told_on_the_last_joint(positions, tmp_path, sized):
    joints, wiring = sized(3, 4), "own"
    joint = joints
    jam = tmp_path / "jam.toml"
    jam.write_text(f'[[faults]]\nkind = "mechanics.stall"\njoint = {joint}\nat_s = {STALLED_S}\nfor_s = 0.6\n')
    scene = switched(joints, wiring)
    line = arm_of(scene, jam)
    home(line, PORT, scene, positions)
    assert line.clock.now_s() < STALLED_S
    line.clock.wait_until(STALLED_S - 0.05)
    go(line, scene, positions, START[:joints])
    line.arm.settle(1.0)
    truth = line.arm.record().lost_full_steps
    assert truth[joint - 1] != 0
    proof = prove_steps(line, PORT, scene, positions)
    assert line.arm.record().lost_full_steps == truth, "the touching itself loses nothing"
    assert proof.lost_usteps == tuple(8 * lost for lost in truth)
    told_rad = pose_of(scene, look(line, PORT, scene, positions).usteps)[0]
    np.testing.assert_allclose(told_rad, really_rad(line), atol=np.radians(0.1))
