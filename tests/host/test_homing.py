"""Homing and the proof of lost steps, on the emulated arm: what is printed is what the plant knows."""

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

from broken_runs import SCENE, board
from planarm.cli.main import main
from planarm.errors import LinkError, SceneError
from planarm.link.arm_record import ArmSetup
from planarm.link.exchange import request
from planarm.link.positions import Positions
from planarm.link.transport import open_transport
from planarm.operations.arm_moves import goto
from planarm.operations.homing import Homed, Touched, home, prove_steps
from planarm.scene import LimitSwitchSpec, load_scene
from planarm.stepping.windows import start_stop_ticks
from planarm.streaming.standing import look, pose_of, usteps_at
from planarm_wire.messages import HOLD_CODE, MIN_HOMING_TICKS, Home

PORT = "/dev/ttyUNO"
MICROSTEPS = 16
SWITCHES = (
    LimitSwitchSpec(1, "A1", np.radians(61.0), True, 0.001),
    LimitSwitchSpec(2, "A2", np.radians(-65.0), False, 0.001),
)
MOTION_S = 3.0
"""When the motion begins that a fault is meant for; homing has long ended."""


@pytest.fixture(scope="module")
def scene():
    return replace(load_scene(SCENE), limit_switches=SWITCHES)


@pytest.fixture
def positions(tmp_path):
    return Positions(tmp_path / "state" / "positions.json")


def arm_of(scene, faults=None):
    """A board with the arm, standing where the host does not know it to."""
    line = open_transport("sim://", 250_000, ArmSetup(scene, usteps_at(scene, scene.task.goal_cm), faults))
    line.clock.wait_until(0.05)
    return line


def really_rad(line):
    line.arm.settle(0.2)
    return line.arm.record().q_rad[-1]


def test_homing_finds_the_switches_and_the_position(scene, positions):
    line = arm_of(scene)
    homed = home(line, PORT, scene, positions)
    assert homed.known_by is None
    assert homed.lost_usteps is None
    standing = look(line, PORT, scene, positions)
    assert (standing.how, standing.usteps) == ("homed", homed.usteps)
    np.testing.assert_allclose(pose_of(scene, standing.usteps)[0], really_rad(line), atol=np.radians(0.05))


def test_the_arm_leaves_its_switches_and_nothing_is_lost(scene, positions):
    line = arm_of(scene)
    home(line, PORT, scene, positions)
    for target in (scene.task.start_cm, scene.task.goal_cm):
        goto(line, scene, look(line, PORT, scene, positions), target, lambda _told: None)
    proof = prove_steps(line, PORT, scene, positions)
    assert proof.lost_usteps == (0, 0)
    assert all(abs(touch.play_usteps) <= 2 for touch in proof.touched)
    assert line.arm.record().lost_full_steps == (0, 0)


@pytest.mark.parametrize("joint", [1, 2])
def test_a_jammed_rotors_loss_is_told_and_the_count_mended(scene, positions, tmp_path, joint):
    """The plant counts what it lost by itself; the proof knows the device's count and the switches only."""
    jam = tmp_path / "jam.toml"
    jam.write_text(f'[[faults]]\nkind = "mechanics.stall"\njoint = {joint}\nat_s = {MOTION_S}\nfor_s = 1.0\n')
    line = arm_of(scene, jam)
    home(line, PORT, scene, positions)
    goto(line, scene, look(line, PORT, scene, positions), scene.task.start_cm, lambda _told: None)
    assert line.clock.now_s() < MOTION_S
    line.clock.wait_until(MOTION_S)
    goto(line, scene, look(line, PORT, scene, positions), scene.task.goal_cm, lambda _told: None)
    line.arm.settle(1.0)
    truth = line.arm.record().lost_full_steps
    assert truth[joint - 1] != 0
    proof = prove_steps(line, PORT, scene, positions)
    assert line.arm.record().lost_full_steps == truth, "the touching itself loses nothing"
    assert proof.lost_usteps == tuple(MICROSTEPS * lost for lost in truth)
    told_rad = pose_of(scene, look(line, PORT, scene, positions).usteps)[0]
    np.testing.assert_allclose(told_rad, really_rad(line), atol=np.radians(0.05))
    assert prove_steps(line, PORT, scene, positions).lost_usteps == (0, 0), "the count is mended"


def test_a_disturbed_byte_that_holds_does_not_pass_for_a_switch(scene, positions, monkeypatch):
    """HOLD ends homing wherever the joint is: the device is at ease, without a fault, and not at its switch."""
    line = arm_of(scene)
    begin_s, write, held = line.clock.now_s(), line.write, []

    def write_disturbed(data):
        write(data)
        if line.clock.now_s() > begin_s + 0.5 and not held:
            held.append(line.clock.now_s())
            write(bytes([HOLD_CODE]))

    monkeypatch.setattr(line, "write", write_disturbed)
    with pytest.raises(LinkError, match=r"joint 1: homing was broken off before its switch"):
        home(line, PORT, scene, positions)
    assert look(line, PORT, scene, positions).how is None


def test_losses_are_whole_turns_of_the_field_and_the_rest_is_the_switch():
    for counted, lost, play in ((1000, 0, 0), (1031, 0, 31), (1033, 64, -31), (870, -128, -2)):
        touch = Touched(1, counted, 1000, 64)
        assert (touch.lost_usteps, touch.play_usteps) == (lost, play)


def test_there_is_nothing_to_prove_before_homing(scene, positions):
    with pytest.raises(LinkError, match=r"nothing to compare with.*not known.*planarm home SCENE"):
        prove_steps(arm_of(scene), PORT, scene, positions)


@pytest.mark.parametrize(("acceleration_rad_s2", "fast_ticks"), [(1e5, MIN_HOMING_TICKS), (50.0, None)])
def test_homing_goes_at_the_start_stop_speed_but_no_faster_than_the_board_takes(
    scene, positions, monkeypatch, acceleration_rad_s2, fast_ticks
):
    joints = tuple(replace(axis, max_acceleration_rad_s2=acceleration_rad_s2) for axis in scene.joints)
    orders = []

    class TakenError(Exception):
        pass

    def take(transport, session, message):
        if isinstance(message, Home):
            orders.append(message)
            raise TakenError
        return request(transport, session, message)

    monkeypatch.setattr("planarm.operations.homing.request", take)
    with pytest.raises(TakenError):
        home(arm_of(scene), PORT, replace(scene, joints=joints), positions)
    assert [order.fast_ticks for order in orders] == [fast_ticks or start_stop_ticks(joints[0])]


def test_homing_needs_a_switch_on_every_joint(scene, positions):
    with pytest.raises(SceneError, match=r"limit_switches: joints \[2\] have none"):
        home(board(), PORT, replace(scene, limit_switches=SWITCHES[:1]), positions)


@pytest.mark.parametrize(("counted", "code", "said"), [(2775, 7, "+64 micro-steps lost"), (2713, 0, "no step lost")])
def test_the_proof_is_printed_and_a_loss_is_an_exit_code(monkeypatch, capsys, counted, code, said):
    """The words are those of docs/board.md."""
    homed = Homed((Touched(1, counted, 2711, 64), Touched(2, -900, -900, 64)), "homed")
    monkeypatch.setattr("planarm.link.transport.open_transport", lambda *_line, **_board: BytesIO())
    monkeypatch.setattr("planarm.operations.homing.prove_steps", lambda *_arm: homed)
    with pytest.raises(SystemExit) as left:
        main(["home", str(SCENE), "--prove", "--port", PORT])
    out = capsys.readouterr().out
    assert left.value.code == code
    assert f"joint 1: {said} (counted {counted} at the switch, which is at 2711; it repeats within " in out
    assert "lost_usteps" not in out, "the sentence has it"
