"""Which arms fall when their drivers are released, and that a run says so."""

import numpy as np
import pytest

from host_scenes import least_scene
from planarm.dynamics.release import falls_on_release, held_without_current_nm
from planarm.scene import parse_scene
from planarm.stepping.plan import SegmentPlan
from planarm.streaming.plan_stream import warn_of_release
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
