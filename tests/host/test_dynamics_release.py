"""Which arms fall when their drivers are released, and that a run says so."""

from dataclasses import replace

import numpy as np
import pytest

from host_scenes import least_scene
from planarm.dynamics.release import falls_on_release, held_without_current_nm
from planarm.scene import BoardSpec, LimitSwitchSpec, parse_scene
from planarm.stepping.plan import SegmentPlan
from planarm.streaming.plan_stream import LOOKED_AT_RAD, poses_along, warn_of_release, warn_of_switches
from planarm_wire.messages import Move, Segment

LEVEL, UPRIGHT = np.array([0.0, 0.0]), np.array([np.pi / 2, 0.0])
HEAVY = """
[mechanics]
gravity = true
link_masses_kg = [1.0, 0.5]
end_masses_kg = [0, 0.25]
coulomb_friction_nm = [0.1, 0.2]
"""


def scene_with(rest, first="", second=""):
    return parse_scene(least_scene(first, second) + rest, "arm.toml")


def test_a_level_arm_falls_and_an_upright_one_stands():
    scene = scene_with(HEAVY)
    falling = falls_on_release(scene, (UPRIGHT, LEVEL))
    assert falling is not None and falling.joint == 1
    # Links of 30 and 20 cm, masses in their middles, a payload at the tip.
    assert falling.gravity_nm == pytest.approx(9.80665 * (1.0 * 0.15 + 0.5 * 0.40 + 0.25 * 0.50))
    assert falling.held_nm == pytest.approx(0.1 + 0.022)
    assert falling.q_rad == (0.0, 0.0)
    assert falls_on_release(scene, (UPRIGHT,)) is None


def test_gears_and_friction_hold():
    geared = scene_with(HEAVY, "gear_ratio = 300", "gear_ratio = 300")
    assert held_without_current_nm(geared) == pytest.approx([0.1 + 300 * 0.022, 0.2 + 300 * 0.022])
    assert falls_on_release(geared, (LEVEL,)) is None


def test_an_arm_that_lies_flat_does_not_fall():
    assert falls_on_release(scene_with(HEAVY.replace("true", "false")), (LEVEL,)) is None


def test_a_coupled_motor_holds_both_joints():
    coupled = scene_with(HEAVY + "[transmission]\ncoupling = [[1, 0], [1, 1]]")
    assert held_without_current_nm(coupled) == pytest.approx([0.1 + 2 * 0.022, 0.2 + 0.022])


def test_a_plan_that_ends_level_is_warned_about():
    scene = scene_with(HEAVY)
    quarter = round(scene.joints[0].usteps_per_rad * np.pi / 2)
    down = SegmentPlan(
        (Segment(2 * 10_000_000 + 1, (Move(2 * quarter, 0, 1 << 18), Move(0))),), 10_000_000, (quarter, 0)
    )
    told: list[str] = []
    warn_of_release(scene, down, told.append)
    (text,) = told
    assert text.startswith(
        "joint 1 falls when the drivers are released: at [0.0, 0.0] degrees gravity pulls with 4.66 N m"
    )
    assert "0.12 N m" in text and "brake" in text
    rests = SegmentPlan((), 0, (quarter, 0))
    warn_of_release(scene, rests, told.append)
    assert len(told) == 1


def test_a_plan_that_falls_only_on_its_way_is_warned_about_with_the_worst_pose():
    """Both ends stand or hang upright; half way the arm is level."""
    scene = scene_with(HEAVY)
    half = round(scene.joints[0].usteps_per_rad * np.pi)
    over = SegmentPlan(
        (Segment(2 * 10_000_000 + 1, (Move(2 * half, 0, 1 << 18), Move(0))),), 10_000_000, (half // 2, 0)
    )
    told: list[str] = []
    warn_of_release(scene, over, told.append)
    (text,) = told
    angle = float(text.split("at [")[1].split(",")[0])
    assert abs(angle) <= np.degrees(LOOKED_AT_RAD)
    idle = replace(scene, board_spec=BoardSpec(idle_release_s=60.0))
    warn_of_release(idle, over, told.append)
    assert told[1].endswith("; board.idle_release_s releases them 60 s after the motion")


def test_poses_along_a_plan_hold_its_ends_and_leave_no_gap():
    scene = scene_with(HEAVY)
    turns = round(scene.joints[0].usteps_per_rad)
    segments = tuple(
        Segment(20_000_000, (Move(2 * turns + 1, 0, 1 << 18), Move(2 * turns, 0, 1 << 18))) for _ in range(2)
    )
    q_rad = poses_along(scene, SegmentPlan(segments, 20_000_000, (7, 0)))
    zero = 7 / scene.joints[0].usteps_per_rad
    assert q_rad[0] == pytest.approx([zero, 0.0])
    assert q_rad[-1] == pytest.approx([zero + 2.0, -2.0], abs=1e-2)
    assert np.abs(np.diff(q_rad, axis=0)).max() <= LOOKED_AT_RAD + 1e-9
    assert poses_along(scene, SegmentPlan((), 0, (7, 0))) == pytest.approx(np.array([[zero, 0.0]]))


@pytest.mark.parametrize(("above", "at", "warned"), [(True, 0.5, True), (True, -0.1, False), (True, 1.5, False)])
def test_a_plan_that_presses_a_switch_is_warned_about_and_one_that_leaves_it_is_not(above, at, warned):
    scene = replace(scene_with(HEAVY), limit_switches=(LimitSwitchSpec(1, "A1", at, above, 0.0),))
    turn = round(scene.joints[0].usteps_per_rad)
    plan = SegmentPlan((Segment(20_000_000 + 1, (Move(2 * turn + 1, 0, 1 << 18), Move(0))),), 10_000_000, (0, 0))
    told: list[str] = []
    warn_of_switches(scene, plan, told.append)
    assert bool(told) == warned
    assert all("joint 1 presses its limit switch on the way, at 57.3 degrees" in text for text in told)
