"""Bringing an arm up: lengths and zeros from touched points, plausibility, the dialogue and the file it writes."""

import json
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from planarm.bringup.arm_answers import ArmAnswers, JointAnswers, plausibility, scene_text
from planarm.bringup.calibrate import TouchedPoint, calibrate, calibrated_text, read_points
from planarm.bringup.guided import MOST_FOLDED_RAD, touching_poses
from planarm.bringup.nudge import Mover, plan_line
from planarm.bringup.person import ask_until, number, numbers, one_of
from planarm.bringup.setup import ask_arm, try_joints
from planarm.cli.main import main
from planarm.errors import UsageError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.transmission import Transmission
from planarm.notice import silent
from planarm.pipeline import plan_scene
from planarm.scene import BoardSpec, parse_scene
from planarm_wire.wirings import OWN, board_of, wirings

ARM = ArmAnswers("test arm", (20.0, 15.0))
LENGTHS = (20.0, 15.0, 10.0, 6.0)
TRUE_LENGTHS, TRUE_ZEROS = (20.37, 14.68), (0.031, -0.052)
POSES = np.radians([[20, -30], [60, -60], [100, -100], [140, -20], [80, -140], [40, -80]])


def touched(scene, lengths, zeros, poses, noise_cm=0.0, seed=3):
    """Points that an arm with these lengths and zeros touches, its motors standing where the scene thinks."""
    transmission, rng = Transmission.of(scene), np.random.default_rng(seed)
    usteps = np.round(transmission.usteps(poses)).astype(int)
    true = replace(Arm.from_spec(scene.arm), link_lengths_cm=lengths)
    tips = forward(true, usteps @ transmission.rad_per_ustep.T + np.array(zeros))[:, -1]
    tips = tips + rng.normal(0.0, noise_cm, tips.shape)
    return [TouchedPoint(tuple(map(int, u)), tuple(map(float, tip))) for u, tip in zip(usteps, tips, strict=True)]


def test_exact_points_give_lengths_and_zeros_back():
    scene = ARM.scene()
    found = calibrate(scene, touched(scene, TRUE_LENGTHS, TRUE_ZEROS, POSES[:4]))
    np.testing.assert_allclose(found.link_lengths_cm, TRUE_LENGTHS, atol=1e-9)
    np.testing.assert_allclose(found.zero_offsets_rad, TRUE_ZEROS, atol=1e-10)
    assert found.rms_mm < 1e-7 and max(found.before_mm) > 5.0


def test_errors_of_touching_show_in_the_standard_errors():
    """200 arms, 12 points each, touched to 0.1 mm: the lengths' errors over what is told of them spread by about 1."""
    scene, ratios = ARM.scene(), []
    poses = np.concatenate([POSES, POSES[::-1] * [1.0, 0.7]])
    for seed in range(200):
        found = calibrate(scene, touched(scene, TRUE_LENGTHS, TRUE_ZEROS, poses, 0.01, seed))
        ratios.append((found.link_lengths_cm[0] - TRUE_LENGTHS[0]) / found.lengths_std_cm[0])
    assert 0.8 < np.std(ratios) < 1.25


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (lambda scene: touched(scene, TRUE_LENGTHS, TRUE_ZEROS, POSES[:3]), "at least 4"),
        (lambda scene: touched(scene, TRUE_LENGTHS, TRUE_ZEROS, np.repeat(POSES[:1], 5, axis=0)), "too much alike"),
        (lambda scene: touched(scene, (30.0, 15.0), TRUE_ZEROS, POSES), "link 1 would be 30"),
    ],
)
def test_points_that_cannot_be_are_refused(points, said):
    with pytest.raises(UsageError, match=said):
        calibrate(ARM.scene(), points(ARM.scene()))


def test_the_calibrated_file_is_the_old_one_but_for_lengths_and_zeros():
    scene = ARM.scene()
    found = calibrate(scene, touched(scene, TRUE_LENGTHS, TRUE_ZEROS, POSES))
    before = scene_text(ARM)
    after = calibrated_text(before, found)
    new = parse_scene(after, "x")
    np.testing.assert_allclose(new.arm.link_lengths_cm, TRUE_LENGTHS, atol=1e-3)
    np.testing.assert_allclose([j.zero_offset_rad for j in new.joints], TRUE_ZEROS, atol=1e-5)
    again = calibrated_text(after, found)
    assert again == after, "a second time nothing is added"
    changed = set(after.splitlines()) - set(before.splitlines())
    assert len(changed) == 3 and "# joint to joint" in "".join(changed), "comments stay"


def test_calibrate_on_the_command_line(tmp_path, capsys):
    scene_file, points = tmp_path / "arm.toml", tmp_path / "touched.csv"
    scene_file.write_text(scene_text(ARM))
    rows = touched(ARM.scene(), TRUE_LENGTHS, TRUE_ZEROS, POSES)
    lines = [",".join(map(str, (*point.usteps, *point.tip_cm))) for point in rows]
    points.write_text("\n".join(["motor1_usteps,motor2_usteps,x_cm,y_cm", *lines]) + "\n")
    with pytest.raises(SystemExit) as left:
        main(["calibrate", str(scene_file), str(points), "-o", str(tmp_path / "new.toml"), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert left.value.code == 0
    np.testing.assert_allclose(told["link_lengths_cm"], TRUE_LENGTHS, atol=1e-6)
    assert parse_scene((tmp_path / "new.toml").read_text(), "new").arm.link_lengths_cm[0] == pytest.approx(20.37)


@pytest.mark.parametrize(
    ("text", "said"),
    [("a,b\n", "line 1: the head"), ("motor1_usteps,motor2_usteps,x_cm,y_cm\n1,2,x,4\n", "line 2"), ("", "line 1")],
)
def test_a_wrong_file_of_points_is_told_by_its_line(tmp_path, text, said):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(UsageError, match=said):
        read_points(tmp_path / "p.csv", 2)


def test_implausible_joints_are_told():
    weak = replace(JointAnswers(), holding_torque_nm=0.01)
    fast = replace(JointAnswers(), max_speed_deg_s=5000.0)
    coarse = replace(JointAnswers(), microsteps=1, gear_ratio=1.0)
    joints = (JointAnswers(), coarse, fast, weak)
    grave = [[remark.grave for remark in plausibility(ARM.with_joint(0, joint), 0)] for joint in joints]
    assert grave[0] == [False] * 3
    assert grave[1][0] and grave[2][1] and grave[3][2]


class Scripted:
    """A person with answers for some questions, who takes the default of all others."""

    def __init__(self, answers):
        self.answers, self.told, self.asked = list(answers), [], []

    def ask(self, question, default):
        self.asked.append(question)
        for n, (part, answer) in enumerate(self.answers):
            if part in question:
                del self.answers[n]
                return answer
        return default

    def tell(self, text):
        self.told.append(text)


def test_the_dialogue_asks_again_for_a_joint_that_cannot_work():
    person = Scripted([("Lengths", "20 15"), ("Largest speed", "50000"), ("Keep it", "no"), ("Largest speed", "90")])
    arm = ask_arm(person, "mine", "sim://")
    assert person.answers == []
    assert arm.joints[0].max_speed_deg_s == 90.0
    assert any("are the most" in text for text in person.told)
    assert arm.scene().arm.link_lengths_cm == (20.0, 15.0)


def test_answers_that_cannot_be_read_are_asked_for_again_and_then_given_up():
    person = Scripted([("How long", "x"), ("How long", "-3"), ("How long", "4")])
    assert ask_until(person, "How long", "1", number(0.0, 10.0)) == 4.0
    assert len(person.told) == 2
    with pytest.raises(UsageError, match="could not be read"):
        ask_until(Scripted([]), "How long", "x", number(0.0, 10.0))


def test_words_are_read():
    assert one_of(("up", "down"))("d") == "down"
    assert numbers(range(1, 3), 0.0, 9.0)("1 2") == (1.0, 2.0)
    with pytest.raises(ValueError, match="2 are needed"):
        numbers(range(2, 3), 0.0, 9.0)("1")
    with pytest.raises(ValueError, match="5 numbers given, 1 to 4 are needed"):
        numbers(range(1, 5), 0.0, 9.0)("1 2 3 4 5")


def test_a_nudge_turns_one_joint_slowly_and_is_certified():
    scene = ARM.scene()
    plan, certificate = plan_line(scene, np.array([1.0, -0.8]), np.array([1.0 + radians(10), -0.8]))
    assert certificate.ok, certificate.explain()
    moved = sum((m.steps_dir >> 1) * (1 if m.steps_dir & 1 else -1) for s in plan.segments for m in s.moves[:1])
    assert moved == pytest.approx(10 * ARM.joints[0].usteps_per_deg, abs=1)
    assert not any(m.steps_dir >> 1 for s in plan.segments for m in s.moves[1:2])
    assert plan.duration_ticks / 16e6 > 10.0 / (0.2 * 110.0)


@pytest.mark.parametrize(
    ("lengths", "wiring"),
    [(LENGTHS[:links], wiring) for links in range(1, len(LENGTHS) + 1) for wiring in wirings(links)],
)
def test_the_dialogue_makes_a_scene_of_any_arm_that_a_board_moves(lengths, wiring):
    person = Scripted([("Lengths", ", ".join(map(str, lengths))), ("Wiring", wiring)])
    arm = ask_arm(person, "mine", "sim://")
    scene = arm.scene()
    assert scene.arm.link_lengths_cm == lengths
    assert scene.board == board_of(len(lengths), wiring)
    assert ("Elbow" in "".join(person.asked)) == (len(lengths) == 2)
    told = "\n".join(person.told)
    assert f"flash --board {scene.board.name}" in told
    for joint, (step, direction) in enumerate(scene.board.joint_pins, start=1):
        assert f"joint {joint}: STEP {step}, DIR {direction}" in told
    if wiring == OWN and len(lengths) < 4:  # the others are as these, and take longer
        plan = plan_scene(scene, silent)
        assert plan.certificate.ok, plan.certificate.explain()


def test_polarity_and_stop_contact_are_asked_for_and_stand_in_the_scene():
    person = Scripted([("Lengths", "20 15"), ("while ENABLE (D8) is high", "yes"), ("stop contact", "yes")])
    arm = ask_arm(person, "mine", "sim://")
    assert person.answers == []
    assert arm.scene().board_spec == BoardSpec(stop_input=True, enable_active_high=True)
    assert ask_arm(Scripted([]), "mine", "sim://").scene().board_spec == BoardSpec()


def test_an_arm_of_five_links_is_asked_for_again():
    person = Scripted([("Lengths", "9 9 9 9 9"), ("Lengths", "9")])
    assert ask_arm(person, "mine", "sim://").links == 1
    assert any("1 to 4 are needed" in text for text in person.told)


@pytest.mark.parametrize("wiring", wirings(4))
def test_a_joint_that_does_not_turn_is_looked_for_at_the_pins_of_its_own_board(wiring):
    arm = ArmAnswers("four", LENGTHS, wiring=wiring)
    person = Scripted([("Which way did joint 4", "not"), ("Try again", "no")])
    try_joints(person, arm, Mover(lambda _plan, _certificate: None, (1.5, -0.8, -0.5, -0.5)))
    board = board_of(4, wiring)
    said = next(text for text in person.told if text.startswith("  Check"))
    assert all(pin in said for pin in (board.step_pins[3], board.dir_pins[3], board.enable_pin))


@pytest.mark.parametrize("lengths", [(20.0, 15.0), (20.0, 15.0, 10.0), (20.0, 15.0, 10.0, 6.0)])
def test_the_poses_to_touch_tell_more_of_the_arm_than_others(lengths):
    """More by the determinant of what is known than nine of ten choices at random; derivatives by differences."""
    scene, links = ArmAnswers("x", lengths).scene(), len(lengths)
    low, high = np.array(scene.arm.joint_limits_rad).T
    low[1:], high[1:] = -MOST_FOLDED_RAD, 0.0 if links == 2 else MOST_FOLDED_RAD

    def tips(poses, changes):
        changed = tuple(np.array(lengths) + changes[:links])
        return forward(replace(Arm.from_spec(scene.arm), link_lengths_cm=changed), poses + changes[links:])[:, -1]

    def known(poses):
        units = 1e-6 * np.eye(2 * links)
        columns = [(tips(poses, unit) - tips(poses, -unit)).ravel() / 2e-6 for unit in units]
        return np.linalg.slogdet(np.array(columns) @ np.array(columns).T)[1]

    poses = np.array(touching_poses(scene, 2 * links + 2))
    assert ((poses >= low) & (poses <= high)).all()
    y = forward(Arm.from_spec(scene.arm), poses)[..., 1]
    assert links != 2 or (y >= 0.0).all(), "its workspace is above the base"
    rng = np.random.default_rng(5)
    at_random = [known(rng.uniform(low, high, poses.shape)) for _ in range(200)]
    assert known(poses) > np.quantile(at_random, 0.9)


def test_joints_that_leave_no_pose_are_told():
    scene = replace(ARM.scene(), arm=replace(ARM.scene().arm, joint_limits_rad=((-1.0, 1.0), (0.5, 1.0))))
    with pytest.raises(UsageError, match="leave 0 poses"):
        touching_poses(scene, 6)
