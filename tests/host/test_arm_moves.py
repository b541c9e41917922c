"""Zero, jog, goto, and the refusal to run from anywhere else: on the emulated board, judged by its pins."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from board_scenes import scene_of
from broken_runs import SCENE, board
from link_model import motion
from planarm.cli.main import main
from planarm.errors import LinkError, NoPathError, UsageError
from planarm.link.exchange import open_session, request
from planarm.link.positions import Positions
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm.operations.arm_moves import goto, jog
from planarm.plan_file import arm_hash
from planarm.scene import load_scene
from planarm.streaming.standing import look, pose_of, require_standing, settle_start, start_usteps, tell, usteps_at
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


@pytest.mark.parametrize(("joints", "wiring"), [(3, "own"), (4, "own"), (2, "cnc_shield"), (3, "cnc_shield")])
def test_an_arm_of_any_board_is_told_its_place_jogged_and_sent_to_a_pose(joints, wiring, positions):
    scene = scene_of(joints, wiring)
    line, start = SimTransport(released_image(scene.board.name), board=scene.board), start_usteps(scene)
    tell(line, PORT, scene, positions, start, "zeroed")
    standing = look(line, PORT, scene, positions)
    assert standing.usteps == start
    assert pose_of(scene, start)[0] == pytest.approx(np.array(scene.task.start_rad), abs=1e-3)
    plan, done = jog(line, scene, standing, joints - 1, np.radians(5.0), nothing)
    assert [len(plan.start_usteps), len(done.ledger_after.position_usteps)] == [joints, scene.board.joints]
    standing = look(line, PORT, scene, positions)
    assert standing.usteps[:-1] == start[:-1]
    assert (standing.usteps[-1] - start[-1]) / scene.joints[-1].usteps_per_rad == pytest.approx(
        np.radians(5.0), abs=1e-3
    )
    pose = np.array(scene.task.start_rad) + 0.1
    goto(line, scene, standing, None, nothing, pose)
    reached = pose_of(scene, look(line, PORT, scene, positions).usteps)[0]
    assert reached == pytest.approx(pose, abs=1e-3)
    made = sum(rises(line, pin) for pin in scene.board.step_pins)
    assert made == rises_of(joints, line, scene)


def rises_of(joints, line, scene):
    """Steps at the pins of the arm's own joints: those beyond them rest."""
    return sum(rises(line, pin) for pin in scene.board.step_pins[:joints])


def test_places_that_an_arm_cannot_be_told_by_are_refused(positions):
    three = scene_of(3)
    with pytest.raises(UsageError, match=r"3 links has not one pose at a point; give joint angles \(--deg\)"):
        usteps_at(three, (20.0, 20.0))
    line = SimTransport(released_image("uno_four"), board=three.board)
    tell(line, PORT, three, positions, start_usteps(three), "zeroed")
    with pytest.raises(UsageError, match="3 links has not one pose at a point; give --deg"):
        goto(line, three, look(line, PORT, three, positions), (20.0, 20.0), nothing)


def test_a_board_with_other_joints_is_told_of_before_anything(positions):
    two = SimTransport(released_image("uno"))
    with pytest.raises(LinkError, match=r"steps 2 joints, the plan is for the board uno_four with 4: flash"):
        look(two, PORT, scene_of(3), positions)


def test_a_scene_on_sim_is_asked_on_its_own_board(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("PLANARM_STATE", str(tmp_path))
    examples = SCENE.parents[2] / "examples"
    for name, zeros in (("three_links", [0] * 3), ("cnc_shield", [0] * 2)):
        with pytest.raises(SystemExit) as end:
            main(["status", str(examples / f"{name}.toml"), "--port", "sim://", "--json"])
        assert not end.value.code
        assert json.loads(capsys.readouterr().out)["usteps"] == zeros


@pytest.mark.parametrize("image", ["uno", "cnc_shield"])
def test_the_wiring_of_a_board_whose_drivers_are_on_is_told_by_its_answer_to_config(image, positions):
    scene = scene_of(2)
    line = SimTransport(released_image(image), board=scene.board)
    request(line, open_session(line), Enable(1))
    if image == "uno":
        tell(line, PORT, scene, positions, start_usteps(scene), "zeroed")
        assert look(line, PORT, scene, positions).usteps == start_usteps(scene)
        return
    with pytest.raises(LinkError, match=r"not for the wiring 'own' of the plan: flash its image.*--board uno "):
        look(line, PORT, scene, positions)
    with pytest.raises(LinkError, match="not for the wiring 'own'"):
        settle_start(RealPins(line), PORT, scene, start_usteps(scene), positions, vouched=True)


class RealPins:
    """A line whose pins nobody sees, as a real board's."""

    pins = None

    def __init__(self, line):
        self._line = line

    def __getattr__(self, name):
        return getattr(self._line, name)
