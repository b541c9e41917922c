"""Scenes for planners on a roadmap: any number of links, ends as joint angles, `[roadmap]` and `[dc_motors]`."""

from math import pi

import pytest

from planarm.errors import SceneError
from planarm.scene import DcMotorSpec, RoadmapSpec, parse_scene

SCENE = """
[arm]
link_lengths_cm = {lengths}
link_width_cm = 2
elbow = "either"
base_cm = [5, 1]
[workspace]
x_cm = [-100, 100]
y_cm = [-100, 100]
[planner]
algorithm = "{algorithm}"
[task]
{task}
{rest}
"""
JOINT = "[[joints]]\nmax_speed_deg_s = 120\nmax_acceleration_deg_s2 = 400\n"


def scene_of(lengths=(30, 25, 15), task="start_deg = [0, 90, 0]\ngoal_deg = [90, 0, 0]", rest="", algorithm=""):
    text = SCENE.format(lengths=list(lengths), algorithm=algorithm or "mpd_star_lite", task=task, rest=rest)
    return parse_scene(text + len(lengths) * JOINT, "roadmap.toml")


def test_three_links_with_angles_for_ends():
    scene = scene_of()
    assert scene.task.start_rad == pytest.approx((0.0, pi / 2, 0.0))
    assert scene.task.start_cm == pytest.approx((5 + 30, 1 + 40))
    assert scene.task.goal_cm == pytest.approx((5, 1 + 70))
    assert len(scene.arm.joint_limits_rad) == len(scene.joints) == len(scene.coupling) == 3
    assert scene.planner.on_roadmap
    assert scene.planner.neighbours == 12
    assert scene.roadmap == RoadmapSpec()
    assert scene.dc_motors == DcMotorSpec.usual(3)


def test_two_links_take_points_as_well():
    scene = scene_of((30, 20), "start_cm = [49, 2]\ngoal_cm = [1, 45]")
    assert (scene.task.start_rad, scene.task.goal_rad) == (None, None)


def test_units_become_si():
    rest = "[dc_motors]\ninductance_mh = [1, 2, 3]\nrotor_inertia_g_cm2 = [10, 10, 10]\n[roadmap]\nedge_s = 1.5"
    scene = scene_of(rest=rest)
    assert scene.dc_motors is not None
    assert scene.dc_motors.inductance_h == pytest.approx((1e-3, 2e-3, 3e-3))
    assert scene.dc_motors.rotor_inertia_kg_m2 == pytest.approx((1e-6,) * 3)
    assert scene.roadmap.edge_s == 1.5


@pytest.mark.parametrize(
    ("changed", "key", "words"),
    [
        ({"lengths": (30,) * 9, "task": ""}, "arm.link_lengths_cm", "1 to 8 lengths"),
        ({"algorithm": "taut"}, "arm.link_lengths_cm", "2 lengths (planner.algorithm 'taut'; mpd_star_lite"),
        ({"task": "start_cm = [1, 2]\ngoal_deg = [0, 0, 0]"}, "task.start_deg", "give 3 angles"),
        ({"task": "start_deg = [0, 0]\ngoal_deg = [0, 0, 0]"}, "task.start_deg", "3 numbers, one for each link"),
        (
            {"task": "start_deg = [300, 0, 0]\ngoal_deg = [0, 0, 0]"},
            "task.start_deg",
            "joint 1 within arm.joint_limits",
        ),
        (
            {"lengths": (30, 20), "task": "start_cm = [9, 9]\nstart_deg = [0, 0]\ngoal_deg = [0, 9]"},
            "task.start_deg",
            "given by task.start_cm already",
        ),
        (
            {"lengths": (30, 20), "task": "start_deg = [0, 0]\ngoal_deg = [0, 9]", "algorithm": "taut"},
            "task.start_deg",
            "give task.start_cm and task.goal_cm",
        ),
        ({"rest": "[roadmap]\nnodes = 1"}, "roadmap.nodes", "a whole number from 2 to 200000"),
        ({"rest": "[roadmap]\ncost = 'watts'"}, "roadmap.cost", "one of 'consumed'"),
        ({"rest": "[dc_motors]\nresistance_ohm = [1, 2]"}, "dc_motors.resistance_ohm", "3 numbers"),
        ({"rest": "[dc_motors]\ninductance_h = [1, 2, 3]"}, "dc_motors.inductance_h", "'inductance_mh' expected"),
        ({"rest": "[dc_motors]\ngear_ratio = [0, 2, 3]"}, "dc_motors.gear_ratio", "above 0"),
    ],
)
def test_what_is_wrong_is_named(changed, key, words):
    with pytest.raises(SceneError) as caught:
        scene_of(**changed)
    assert caught.value.key == key
    assert words in str(caught.value)
