"""Why there is no path: what is named really closes the way, and what is advised really opens it."""

import json
from dataclasses import replace
from math import hypot

import numpy as np
import pytest

from host_scenes import make_scene, oracle_distance_cm, random_obstacles
from planarm.cli.main import main
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.model.shapes import shape_of
from planarm.scene import Obstacle
from planarm.search.diagnosis import diagnose
from planarm.search.grid_search import find_path
from planarm.search.passage import closing_obstacles, passes, widest_margin_cm
from planarm.search.result import SearchStatus
from planarm.workspace.free_map import build_free_map
from planarm.workspace.world import FREE

LOW = Obstacle("polygon", vertices_cm=((0.0, 12.0), (1.0, 12.0), (1.0, 27.0), (0.0, 27.0)))
HIGH = Obstacle("polygon", vertices_cm=((0.0, 29.0), (1.0, 29.0), (1.0, 52.0), (0.0, 52.0)))
ASIDE = Obstacle("circle", (-45.0, 2.0), 4.0)
WAY = {"y": (0.0, 50.0), "start": (40.0, 20.0), "goal": (-30.0, 25.0)}


def free_at(scene, margin, point, side="up"):
    free_map = build_free_map(scene, margin, side)
    row, column = (
        int(np.argmin(abs(axis - v))) for axis, v in zip((free_map.y_cm, free_map.x_cm), point[::-1], strict=True)
    )
    return free_map.region[row, column] == FREE


def test_one_wall_that_closes_the_way_is_named_and_one_aside_is_not():
    wall = Obstacle("polygon", vertices_cm=((0.0, 5.0), (1.0, 5.0), (1.0, 52.0), (0.0, 52.0)))
    found = diagnose(make_scene((ASIDE, wall), **WAY), 0.4)
    assert (found.status, found.cause, found.opening) == (SearchStatus.NO_PATH, "passage", ((2,),))
    assert any("obstacles[2]" in sentence for sentence in found.advice)


def test_two_walls_that_close_it_together_are_named_together():
    found = diagnose(make_scene((LOW, ASIDE, HIGH), **WAY), 0.775)
    assert found.opening == ((1, 3),)
    assert found.room_cm is None


def narrow_scenes(rng, count):
    """Scenes of a thick arm whose only fault is its thickness."""
    while count:
        start, goal = (tuple(map(float, rng.integers(-40, 41, 2))) for _ in range(2))
        scene = make_scene(random_obstacles(rng, 5), width=5.0, start=start, goal=goal)
        result = find_path(build_free_map(scene, scene.margin_cm, "up"), start, goal, scene.planner)
        if result.status is not SearchStatus.NO_PATH or not passes(scene, 0.0, "up"):
            continue
        found = diagnose(scene, scene.margin_cm)
        if found.cause == "passage" and found.room_cm is not None:
            count -= 1
            yield scene, found


def test_a_passage_that_is_too_narrow_tells_how_much_is_missing(sized):
    for scene, found in narrow_scenes(np.random.default_rng(3), sized(4, 40)):
        assert passes(scene, found.room_cm, "up"), scene
        assert not passes(scene, found.room_cm + 0.01, "up"), scene
        assert found.short_cm == pytest.approx(scene.margin_cm - found.room_cm)
        (told,) = [sentence for sentence in found.advice if sentence.startswith("arm.link_width_cm = ")]
        thin_cm = float(told.split()[2])
        thin = replace(scene, arm=replace(scene.arm, link_width_cm=thin_cm))
        assert passes(thin, thin.margin_cm, "up"), scene
        assert thin_cm == pytest.approx(2.0 * found.room_cm, abs=2e-3)


@pytest.mark.parametrize("name", ["start", "goal"])
def test_a_blocked_end_names_its_obstacles_how_far_and_the_nearest_free_cell(name):
    scene = make_scene((ASIDE, Obstacle("circle", (30.0, 15.0), 6.0)), y=WAY["y"], **{name: (33.0, 17.0)})
    found = diagnose(scene, 0.4)
    assert found.status == (SearchStatus.START_BLOCKED if name == "start" else SearchStatus.GOAL_BLOCKED)
    assert (found.cause, found.blocking) == ("obstacle", (2,))
    arm = Arm.from_spec(scene.arm)
    joints = forward(arm, inverse_2r(arm, [33.0, 17.0], "up"))
    exact = min(oracle_distance_cm((joints[i], joints[i + 1]), shape_of(scene.obstacles[1])) for i in range(2))
    assert found.room_cm == pytest.approx(exact, abs=1e-9)
    free_map = build_free_map(scene, 0.4, "up")
    nodes = [
        (x, y) for j, y in enumerate(free_map.y_cm) for i, x in enumerate(free_map.x_cm) if not free_map.region[j, i]
    ]
    assert hypot(found.nearest_cm[0] - 33.0, found.nearest_cm[1] - 17.0) == pytest.approx(
        min(hypot(x - 33.0, y - 17.0) for x, y in nodes)
    )


@pytest.mark.parametrize(
    ("point", "cause", "reachable"),
    [((40.0, 40.0), "beyond_reach", 50.0), ((3.0, 4.0), "inner_hole", 10.0)],
)
def test_an_end_out_of_reach_tells_the_nearest_point_within(point, cause, reachable):
    found = diagnose(make_scene(start=point), 0.4)
    assert found.cause == cause
    assert hypot(*found.reachable_cm) == pytest.approx(reachable)
    assert found.reachable_cm[0] * point[1] == pytest.approx(found.reachable_cm[1] * point[0])
    assert found.nearest_cm is not None


def test_a_pose_that_is_free_on_the_other_side_only_is_told():
    """An obstacle where the elbow would be."""
    arm = Arm.from_spec(make_scene().arm)
    elbow = forward(arm, inverse_2r(arm, [30.0, 20.0], "up"))[1]
    scene = make_scene((Obstacle("circle", tuple(elbow), 4.0),), start=(30.0, 20.0))
    found = diagnose(scene, 0.4)
    assert found.blocking == (1,)
    assert any('arm.elbow = "down"' in sentence for sentence in found.advice)


def test_a_start_with_one_elbow_and_a_goal_with_the_other_only_is_told_apart():
    arm = Arm.from_spec(make_scene().arm)
    start, goal = (30.0, 20.0), (-30.0, 20.0)
    blocks = (
        Obstacle("circle", tuple(forward(arm, inverse_2r(arm, start, "down"))[1]), 4.0),
        Obstacle("circle", tuple(forward(arm, inverse_2r(arm, goal, "up"))[1]), 4.0),
    )
    found = diagnose(make_scene(blocks, elbow="either", start=start, goal=goal), 0.4)
    assert (found.status, found.cause) == (SearchStatus.ELBOW, "elbow")
    assert any("joint" in sentence for sentence in found.advice)


def test_an_unlucky_draw_of_chaos_a_star_is_no_closed_passage():
    scene = make_scene(y=WAY["y"])
    planners = [replace(scene.planner, algorithm="chaos_a_star", neighbours=8, seed=seed) for seed in range(60)]
    lost = [one for one in planners if find_path(build_free_map(scene), (49.0, 2.0), (1.0, 45.0), one).path is None]
    found = diagnose(replace(scene, planner=lost[0]), scene.margin_cm)
    assert found.cause == "draw"


def test_random_closed_scenes_are_explained_and_every_answer_holds(sized):
    """Never a traceback; taking away what is named opens the way; with a little more room than told it stays closed."""
    rng = np.random.default_rng(11)
    explained = 0
    for number in range(sized(40, 600)):
        scene = make_scene(
            random_obstacles(rng, int(rng.integers(4, 12)), size=14.0),
            elbow=str(rng.choice(["up", "down", "either"])),
            start=tuple(map(float, rng.integers(-45, 46, 2))),
            goal=tuple(map(float, rng.integers(-45, 46, 2))),
        )
        margin = scene.margin_cm
        found = diagnose(scene, margin)
        json.dumps(found.fields(), allow_nan=False)
        explained += found.cause != "passage"
        for one in found.opening:
            assert passes(scene, margin, found.elbow, [k - 1 for k in one]), number
            assert len(one) == 1 or not any(passes(scene, margin, found.elbow, [k - 1]) for k in one), number
        if found.cause == "passage" and not passes(scene, margin, found.elbow) and found.room_cm is not None:
            assert found.room_cm < margin
            assert passes(scene, found.room_cm, found.elbow), number
        if found.nearest_cm is not None:
            assert free_at(scene, margin, found.nearest_cm, found.elbow), number
    assert explained > 0


def test_closing_and_widest_of_an_open_way_is_the_margin_itself():
    scene = make_scene((ASIDE,), **WAY)
    assert widest_margin_cm(scene, 0.4, "up") > 0.4 - 0.006
    assert all(one in ((0,),) for one in closing_obstacles(scene, 0.4, "up"))


def write_scene(tmp_path, start):
    text = (
        f"""
[arm]
link_lengths_cm = [30, 20]
link_width_cm = 0.8
elbow = "up"
[workspace]
x_cm = [-50, 50]
y_cm = [0, 50]
[[obstacles]]
shape = "polygon"
vertices_cm = [[0, 5], [1, 5], [1, 52], [0, 52]]
[task]
start_cm = {start}
goal_cm = [-30, 25]
"""
        + 2 * "[[joints]]\nmax_speed_deg_s = 110\nmax_acceleration_deg_s2 = 570\n"
    )
    target = tmp_path / "scene.toml"
    target.write_text(text)
    return target


@pytest.mark.parametrize(
    ("start", "code", "status", "cause"),
    [
        ([40, 20], 3, "no path", "passage"),
        ([1, 40], 2, "start blocked", "obstacle"),
        ([50, 20], 2, "start blocked", "beyond_reach"),
    ],
)
def test_the_command_says_what_would_help_in_words_and_in_fields(capsys, tmp_path, start, code, status, cause):
    scene = write_scene(tmp_path, start)
    words = ["plan", str(scene), "-o", str(tmp_path / "x.plan")]
    with pytest.raises(SystemExit) as left:
        main(words)
    told = capsys.readouterr()
    assert (left.value.code, told.out) == (code, "")
    assert "What would help:" in told.err and "Traceback" not in told.err
    with pytest.raises(SystemExit) as left:
        main([*words, "--json"])
    error = json.loads(capsys.readouterr().out)["error"]
    assert left.value.code == error["exit_code"] == code
    assert (error["status"], error["cause"]) == (status, cause)
    assert error["advice"]
