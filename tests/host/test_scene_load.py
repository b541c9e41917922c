"""Scenes that are right: every key, every default, and the conversion of units."""

from math import pi, radians
from pathlib import Path

import pytest

from host_scenes import least_scene
from planarm.errors import SceneError
from planarm.scene import MotionSpec, Obstacle, PlannerSpec, load_scene, parse_scene, with_planner

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

LEAST = least_scene()


def test_the_least_scene_has_the_documented_defaults():
    scene = parse_scene(LEAST, "arms/least.toml")
    assert (scene.name, scene.source) == ("least", "arms/least.toml")
    assert scene.arm.base_cm == (0.0, 0.0)
    assert scene.arm.joint_limits_rad == ((-pi / 2, 3 * pi / 2), (-pi, pi))
    assert scene.arm.floor is False
    assert (scene.workspace.cell_cm, scene.workspace.clearance_cm) == (1.0, 0.0)
    assert scene.obstacles == ()
    assert scene.planner == PlannerSpec("taut", 56, "run", 1, "proved")
    assert scene.motion == MotionSpec("blend", 0.5, 0.8)
    assert (scene.link.port, scene.link.baud) == ("sim://", 250_000)
    joint = scene.joints[0]
    assert (joint.steps_per_rev, joint.microsteps, joint.gear_ratio, joint.driver) == (200, 16, 1.0, "a4988")
    assert scene.margin_cm == 0.4


def test_degrees_become_radians_and_nothing_else_changes():
    scene = parse_scene(LEAST, "least.toml")
    assert scene.joints[0].max_speed_rad_s == pytest.approx(pi)
    assert scene.joints[1].max_acceleration_rad_s2 == pytest.approx(4 * pi)
    assert scene.arm.link_lengths_cm == (30.0, 20.0)
    assert all(isinstance(length, float) for length in scene.arm.link_lengths_cm)


def test_every_shape_is_read():
    named = "".join(
        f'[[obstacles]]\nshape = "{shape}"\ncenter_cm = [1, 2]\ndiameter_cm = 3\n'
        for shape in ("circle", "square", "diamond", "triangle", "hexagon")
    )
    polygon = '[[obstacles]]\nshape = "polygon"\nvertices_cm = [[0, 0], [4, 0], [1, 1], [0, 4]]\n'
    obstacles = parse_scene(LEAST + named + polygon, "shapes.toml").obstacles
    assert [o.shape for o in obstacles] == ["circle", "square", "diamond", "triangle", "hexagon", "polygon"]
    assert obstacles[0] == Obstacle("circle", (1.0, 2.0), 3.0)
    assert obstacles[5].vertices_cm == ((0.0, 0.0), (4.0, 0.0), (1.0, 1.0), (0.0, 4.0))


def test_the_margin_is_half_the_width_plus_the_clearance():
    scene = parse_scene(LEAST.replace("[task]", "clearance_cm = 0.25\n[task]"), "least.toml")
    assert scene.margin_cm == pytest.approx(0.65)


def test_table_1_case_1_is_the_paper_s_arm_on_the_shipped_motors():
    scene = load_scene(EXAMPLES / "table1_case1.toml")
    assert (scene.arm.link_lengths_cm, scene.arm.elbow) == ((30.0, 20.0), "up")
    assert [o.center_cm for o in scene.obstacles] == [(35, 18), (7, 35), (-13, 35), (-30, 20)]  # paper C, Table I
    assert {(o.shape, o.diameter_cm) for o in scene.obstacles} == {("circle", 10.0)}
    assert (scene.task.start_cm, scene.task.goal_cm) == ((49, 2), (1, 45))
    for joint in scene.joints:
        assert joint.usteps_per_rad == pytest.approx(16_000 / (2 * pi))
        assert joint.max_speed_rad_s == pytest.approx(2.0)
        assert joint.max_acceleration_rad_s2 == pytest.approx(10.0)


def test_table_1_case_2_has_a_square_and_two_circles():
    scene = load_scene(EXAMPLES / "table1_case2.toml")
    assert [(o.shape, o.center_cm) for o in scene.obstacles] == [
        ("square", (41, 10)),  # paper C, Table I
        ("circle", (7, 40)),
        ("circle", (-16, 33)),
    ]


def test_the_inner_radius_of_the_paper_is_the_limit_of_joint_2():
    low, high = load_scene(EXAMPLES / "table1_case1.toml").arm.joint_limits_rad[1]
    assert (low, high) == (-radians(138.5904), radians(138.5904))
    assert high == pytest.approx(pi - 0.7227342478, abs=1e-6)  # acos(-3/4): r = 20 cm with links of 30 and 20


def test_another_algorithm_brings_its_own_neighbourhood():
    scene = load_scene(EXAMPLES / "table1_case1.toml")
    changed = with_planner(scene, algorithm="modified_a_star")
    assert (changed.planner.algorithm, changed.planner.neighbours) == ("modified_a_star", 24)
    assert with_planner(changed, neighbours=48, seed=7).planner == PlannerSpec(
        "modified_a_star", 48, "run", 7, "proved"
    )
    assert with_planner(scene, seed=9).planner.neighbours == 56
    assert with_planner(scene) == scene
    assert changed.arm is scene.arm


@pytest.mark.parametrize(
    ("algorithm", "neighbours"),
    [("a_star", [8]), ("modified_a_star", [24, 48]), ("chaos_a_star", [8, 20, 44, 68]), ("chs", [12, 28, 48, 80, 56])],
)
def test_every_neighbourhood_of_every_algorithm_is_taken(algorithm, neighbours):
    scene = parse_scene(LEAST, "least.toml")
    for count in neighbours:
        assert with_planner(scene, algorithm=algorithm, neighbours=count).planner.neighbours == count


def test_the_grid_is_made_of_multiples_of_the_cell():
    scene = parse_scene(LEAST.replace("[task]", "cell_cm = 0.1\n[task]"), "least.toml")
    assert (scene.workspace.columns, scene.workspace.rows) == (range(-500, 501), range(0, 501))


def test_the_motion_table_is_read():
    scene = parse_scene(LEAST + '[motion]\ncorners = "stop"\ntolerance_cm = 0.2\nacceleration_share = 1\n', "m.toml")
    assert scene.motion == MotionSpec("stop", 0.2, 1.0)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('corners = "round"', r"motion.corners: 'round' given, one of 'blend', 'stop' expected"),
        ("tolerance_cm = 0", r"motion.tolerance_cm: 0 given"),
        ("tolerance_mm = 3", r"motion.tolerance_mm: wrong unit: 'tolerance_cm' expected"),
        ("acceleration_share = 1.2", r"motion.acceleration_share: 1.2 given, .* at most 1"),
    ],
)
def test_a_wrong_motion_table_is_refused(line, words):
    with pytest.raises(SceneError, match=words):
        parse_scene(LEAST + "[motion]\n" + line, "m.toml")
