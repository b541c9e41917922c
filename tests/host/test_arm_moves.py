"""Zero, jog, goto, and the refusal to run from anywhere else: on the emulated board, judged by its pins."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from broken_runs import SCENE, board
from link_model import motion
from planarm.cli.main import main
from planarm.errors import LinkError, NoPathError, UsageError
from planarm.link.exchange import open_session, request
from planarm.link.positions import Positions
from planarm.operations.arm_moves import goto, jog
from planarm.plan_file import arm_hash
from planarm.scene import load_scene
from planarm.streaming.standing import look, pose_of, require_standing, tell, usteps_at
from planarm_wire.messages import Enable, Segments

PORT = "/dev/ttyUNO"


def nothing(_told):
    pass


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENE)


@pytest.fixture
def positions(tmp_path):
    return Positions(tmp_path / "state" / "positions.json")


def rises(line, pin):
    return int((line.pins.edges(pin)["level"] == 1).sum())


def test_a_board_that_was_told_nothing_is_refused_until_it_is(scene, positions):
    line, start = board(), usteps_at(scene, scene.task.start_cm)
    with pytest.raises(LinkError, match=r"not known.*planarm home SCENE.*planarm zero SCENE"):
        require_standing(look(line, PORT, scene, positions), scene, start)
    tell(line, PORT, scene, positions, start, "zeroed")
    standing = look(line, PORT, scene, positions)
    assert (standing.usteps, standing.how) == (start, "zeroed")
    require_standing(standing, scene, start)
    elsewhere = usteps_at(scene, scene.task.goal_cm)
    with pytest.raises(LinkError, match=r"stands at \(42\.\d+, 12\.\d+\) cm.*planarm goto SCENE 3[56]\.\d+ 2[34]\.\d+"):
        require_standing(standing, scene, elsewhere)
    line.uno.reset()
    line.clock.wait_until(line.clock.now_s() + 0.1)
    assert look(line, PORT, scene, positions).how is None, "another boot knows nothing"


@pytest.mark.parametrize("faulted", [False, True])
def test_zero_drops_what_a_program_that_died_has_left_in_the_queue(scene, positions, faulted):
    line, start = board(), usteps_at(scene, scene.task.start_cm)
    session = open_session(line)
    request(line, session, Enable(1))
    for _ in range(1 + faulted):  # segments after a motion's last are a fault
        session.send(Segments(0, 0, 0, motion(1)), line.clock.now_s())
        line.clock.wait_until(line.clock.now_s() + 0.01)
        line.read(4096, 0.0)
    tell(line, PORT, scene, positions, start, "zeroed")
    standing = look(line, PORT, scene, positions)
    assert (standing.usteps, standing.how) == (start, "zeroed")


def test_goto_goes_to_the_point_and_back(scene, positions):
    line, start = board(), usteps_at(scene, scene.task.start_cm)
    tell(line, PORT, scene, positions, start, "zeroed")
    for target in ((38.0, 21.0), scene.task.start_cm):
        goto(line, scene, look(line, PORT, scene, positions), target, nothing)
        at = look(line, PORT, scene, positions).usteps
        assert np.hypot(*(np.array(pose_of(scene, at)[1]) - target)) < 0.02
    assert look(line, PORT, scene, positions).usteps == start
    assert rises(line, "D9") > 0


def test_goto_needs_to_know_where_it_begins(scene, positions):
    line = board()
    with pytest.raises(LinkError, match="not known"):
        goto(line, scene, look(line, PORT, scene, positions), (38.0, 21.0), nothing)
    with pytest.raises(UsageError, match="out of the arm's reach"):
        usteps_at(scene, (99.0, 0.0))


def test_a_jog_turns_one_joint_by_its_angle(scene, positions):
    line = board()
    standing = look(line, PORT, scene, positions)
    jog(line, scene, standing, 1, np.radians(-9.0), nothing)
    assert rises(line, "D9") == 0
    assert rises(line, "D10") == round(9.0 * scene.joints[1].usteps_per_rad * np.pi / 180.0)
    assert look(line, PORT, scene, positions).usteps[1] == -rises(line, "D10")


def test_a_jog_of_a_known_arm_keeps_clear_of_obstacles(scene, positions):
    line, start = board(), usteps_at(scene, scene.task.start_cm)
    tell(line, PORT, scene, positions, start, "zeroed")
    with pytest.raises(NoPathError, match="cannot be proved free"):
        jog(line, scene, look(line, PORT, scene, positions), 0, np.radians(75.0), nothing)
    assert rises(line, "D9") == 0


def test_positions_are_kept_by_port_boot_and_arm(scene, positions):
    arm = arm_hash(asdict(scene))
    assert positions.how(PORT, 1, arm) is None
    positions.remember(PORT, 1, arm, "homed")
    assert positions.how(PORT, 1, arm) == "homed"
    assert positions.how(PORT, 2, arm) is None
    assert positions.how("/dev/ttyOTHER", 1, arm) is None
    assert positions.how(PORT, 1, "another arm") is None
    for boot in range(100, 160):
        positions.remember(PORT, boot, arm, "zeroed")
    assert positions.how(PORT, 1, arm) is None, "the oldest are dropped"
    positions.path.write_text("{")
    assert positions.how(PORT, 159, arm) is None


@pytest.mark.parametrize("words", [["status"], ["zero"], ["zero", "--at", "40", "15"], ["jog", "1", "2.5"]])
def test_commands_on_the_emulator(words, capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("PLANARM_STATE", str(tmp_path))
    command, *more = words
    with pytest.raises(SystemExit) as left:
        main([command, str(SCENE), *more, "--port", "sim://", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert left.value.code == 0
    assert len(told["usteps"]) == 2
    assert (told["known_by"] == "zeroed") == (command == "zero")


def test_stop_and_doctor_on_the_emulator(capsys):
    for words in (["stop", "--port", "sim://"], ["doctor", "--port", "sim://"]):
        with pytest.raises(SystemExit) as left:
            main([*words, "--json"])
        told = json.loads(capsys.readouterr().out)
        assert left.value.code == 0
        assert told.get("state", told.get("board", {}).get("state")) in ("idle", "ready")
