"""Start and goal that the arm cannot hold: each error names the cause, the figures and what to change."""

from math import pi, radians
from pathlib import Path

import pytest

from host_scenes import FULL_TURN, make_scene
from planarm.errors import SceneError
from planarm.scene import Obstacle, load_scene
from planarm.workspace.check_task import check_task
from planarm.workspace.free_map import build_free_map

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
DISC = Obstacle("circle", (30.0, 30.0), 4.0)
HEXAGON = Obstacle("hexagon", (-20.0, 20.0), 4.0)

# (changes to the scene, key named, words that the message has)
WRONG = [
    ({"start": (48.0, 20.0)}, "task.start_cm", ["[48, 20]", "52.000 cm", "out of reach", "50 cm", "link_lengths_cm"]),
    ({"goal": (3.0, 4.0)}, "task.goal_cm", ["[3, 4]", "5.000 cm", "inner hole of 10.000 cm", "link_lengths_cm"]),
    (
        {"goal": (0.0, 15.0), "limits": (FULL_TURN[0], (-radians(90), 0.0))},
        "task.goal_cm",
        ["15.000 cm", "inner hole of 36.056 cm", "joint_limits_deg"],  # hypot(30, 20) at 90 degrees
    ),
    (
        {"start": (49.5, 0.0), "limits": (FULL_TURN[0], (-pi, -radians(60)))},
        "task.start_cm",
        # cos theta2 = (49.5^2 - 1300) / 1200; 43.589 = sqrt(1300 + 600) at 60 degrees
        ["49.500 cm", "joint 2 at -16.56 degrees", "end at -60.00", "43.589 cm", "joint_limits_deg"],
    ),
    (
        {"goal": (-30.0, 20.0), "limits": ((0.0, radians(90)), FULL_TURN[1])},
        "task.goal_cm",
        ["joint 1 at", "limits are [0, 90]", "arm.elbow", "joint_limits_deg"],
    ),
    (
        {"goal": (27.0, 30.0), "obstacles": (HEXAGON, DISC)},
        "task.goal_cm",
        ["obstacles[2] (circle)", "1.000 cm", "more than 1.4 cm", "link_width_cm", "workspace.clearance_cm"],
    ),
    (
        {"start": (-20.0, 20.0), "obstacles": (HEXAGON, DISC)},
        "task.start_cm",
        ["obstacles[1] (hexagon)", "0.000 cm", "more than 1.4 cm"],
    ),
    (
        {"start": (-49.0, 2.0), "floor": True, "elbow": "up"},
        "task.start_cm",
        ["above the floor y = 0", "more than 1.4 cm", "arm.elbow", "arm.floor = false"],
    ),
]


@pytest.mark.parametrize(("changes", "key", "words"), WRONG, ids=[f"{w[1]}-{i}" for i, w in enumerate(WRONG)])
def test_wrong_tasks_name_the_cause_and_what_to_change(changes, key, words):
    scene = make_scene(**{"start": (38.0, 5.0), "goal": (5.0, 40.0), "clearance": 1.0, **changes})
    with pytest.raises(SceneError) as caught:
        check_task(scene, build_free_map(scene))
    assert caught.value.key == key
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("case", [1, 2])
def test_the_tasks_of_table_1_can_be_held(case):
    scene = load_scene(EXAMPLES / f"table1_case{case}.toml")
    check_task(scene, build_free_map(scene))


def test_the_map_s_own_margin_counts():
    scene = make_scene([DISC], start=(30.0, 5.0), goal=(26.0, 30.0))
    check_task(scene, build_free_map(scene))
    with pytest.raises(SceneError, match=r"2\.000 cm from obstacles\[1\] \(circle\), more than 2\.1 cm"):
        check_task(scene, build_free_map(scene, 2.1))


def test_the_other_elbow_may_reach_where_one_does_not():
    """A disc on the elbow-up side of the tip only."""
    scene = make_scene([Obstacle("circle", (8.0, 28.0), 6.0)], elbow="either", start=(30.0, 25.0), goal=(30.0, 25.0))
    check_task(scene, build_free_map(scene, elbow="down"))
    with pytest.raises(SceneError, match=r"obstacles\[1\]"):
        check_task(scene, build_free_map(scene, elbow="up"))
