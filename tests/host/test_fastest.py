"""The path optimised for time: its parts against oracles, and its result against shapely and the timing."""

from dataclasses import replace
from itertools import pairwise
from math import pi
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BSpline

from host_scenes import make_scene, oracle_clearance_cm
from live_runs import CountedTime
from planarm.fastest.cost import Problem, costs
from planarm.fastest.evolution import Evolution
from planarm.fastest.search import Budget, Task, find_fastest
from planarm.fastest.spline_basis import greville, span_basis, spread
from planarm.fastest.starts import short_ways
from planarm.fastest.task import scene_task
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.motions import motion
from planarm.pipeline import plan_scene, run_scene
from planarm.scene import Obstacle, load_scene
from planarm.smoothing.joint_spline import JointSpline
from planarm.trajectory.check import limit_use
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import joint_world

CASE_1 = load_scene(Path(__file__).resolve().parents[2] / "examples" / "table1_case1.toml")


def clock_of_evaluations():
    """A clock that stands still: only the number of evaluations ends the search."""
    return 0.0


def scene_between(start, goal, **changes):
    return replace(CASE_1, task=replace(CASE_1.task, start_cm=start, goal_cm=goal), **changes)


@pytest.mark.parametrize("controls", [4, 5, 8, 20])
def test_the_basis_is_scipy_s_clamped_spline(controls):
    rng = np.random.default_rng(controls)
    points = rng.normal(size=(controls, 3))
    basis = span_basis(controls)
    knots = np.concatenate([np.zeros(3), np.arange(controls - 2.0), np.full(3, controls - 3.0)])
    spline = BSpline(knots, points, 3)
    for s in np.linspace(0.0, controls - 3.0, 50, endpoint=False):
        p = int(s)
        made = sum(basis[p, k] @ points * (s - p) ** k for k in range(4))
        assert made == pytest.approx(spline(s), abs=1e-12)


def test_more_control_points_keep_ends_and_straight_lines():
    line = np.outer(greville(6), [2.0, -1.0]) + np.array([0.5, 0.2])
    assert spread(line, 13) == pytest.approx(np.outer(greville(13), [2.0, -1.0]) + np.array([0.5, 0.2]))


def test_evolution_finds_the_minimum_of_a_narrow_curved_valley():
    def rosenbrock(x):
        return (100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1.0 - x[:, :-1]) ** 2).sum(axis=1)

    search = Evolution(np.zeros(6), 0.3, np.random.default_rng(4))
    for _ in range(700):
        candidates = search.ask()
        search.tell(candidates, rosenbrock(candidates))
    assert search.mean == pytest.approx(np.ones(6), abs=1e-3)


def problem_of(scene, controls, extra_cm=0.0):
    task = scene_task(scene, scene.margin_cm, Limits.of_joints(scene.joints))
    start, goal = task.ends_rad[0]
    limits = task.limits
    return Problem(
        task.world,
        span_basis(controls),
        start,
        goal,
        limits.speeds_rad_s,
        limits.accelerations_rad_s2,
        task.box_cm,
        extra_cm,
        limits.accelerations_rad_s2 / limits.share,
        np.inf,
    )


@pytest.mark.parametrize(("wiggle", "too_long"), [(0.03, 0.02), (0.15, 0.1)])
@pytest.mark.parametrize("seed", range(4))
def test_a_cost_is_the_duration_and_what_is_missing(seed, wiggle, too_long):
    rng = np.random.default_rng(seed)
    scene = make_scene([Obstacle("circle", (25.0, 30.0), 8.0)], start=(40.0, 10.0), goal=(-10.0, 40.0))
    problem = problem_of(scene, 8)
    line = problem.start_rad + np.outer(greville(8), problem.goal_rad - problem.start_rad)
    controls = line.copy()
    controls[1:-1] += rng.normal(0.0, wiggle, (6, 2))
    judged = np.empty((1, 3))
    costs(problem, controls[1:-1].reshape(1, -1), judged)
    cost, duration, missing = judged[0]
    spline = JointSpline(
        Arm.from_spec(scene.arm),
        np.arange(6.0),
        np.einsum("pkc,cj->pkj", problem.basis, controls),
        np.zeros(0),
    )
    exact = fastest_motion(spline, Limits.of_joints(scene.joints))
    assert exact.duration_s * 0.995 <= duration <= exact.duration_s * (1.0 + too_long)
    q = spline.evaluate(np.linspace(0.0, 5.0, 61)).q_rad
    arm = Arm.from_spec(scene.arm)
    room = [oracle_clearance_cm(scene, arm, pose) - scene.margin_cm for pose in q]
    beyond = np.maximum(0.0, np.maximum(problem.world.low_rad - q, q - problem.world.high_rad)).max(axis=1) * 30.0
    short = np.maximum(beyond, np.maximum(0.0, -np.array(room)))
    tips = forward(arm, q)[:, -1]
    outside = np.maximum(np.abs(tips) - 50.0, 0.0).max(axis=1)
    assert missing == pytest.approx(np.maximum(short, outside).sum(), abs=1e-9)
    assert cost >= duration
    assert (cost == duration) == (missing == 0.0)


def test_short_ways_start_and_end_right_stay_free_and_differ():
    scene = scene_between((45.0, 5.0), (-45.0, 5.0))
    task = scene_task(scene, scene.margin_cm, Limits.of_joints(scene.joints))
    (start, goal), world = task.ends_rad[0], task.world
    arm = Arm.from_spec(scene.arm)
    ways = short_ways(world, start, goal, task.limits.speeds_rad_s)
    found = [next(ways) for _ in range(3)]
    for way in found:
        assert way[0].tolist() == start.tolist()
        assert way[-1].tolist() == goal.tolist()
        assert min(oracle_clearance_cm(scene, arm, pose) for pose in way[1:-1]) > scene.margin_cm
    middles = [way[len(way) // 2] for way in found]
    assert max(np.abs(a - b).max() for a in middles for b in middles) > 0.2


def test_a_wall_all_around_leaves_no_short_way():
    scene = make_scene(
        [Obstacle("polygon", vertices_cm=((-3, 22), (3, 22), (3, 60), (-3, 60)))], limits=((0, pi), (-2, 0))
    )
    world = joint_world(scene)
    assert list(short_ways(world, np.array([0.3, -0.5]), np.array([2.8, -0.5]), np.ones(2))) == []


def free_and_inside(scene, spline, count=1500):
    """By shapely and plain kinematics, at dense samples."""
    arm = Arm.from_spec(scene.arm)
    q = spline.evaluate(np.linspace(spline.borders_s[0], spline.borders_s[-1], count)).q_rad
    tips = forward(arm, q)[:, -1]
    box = np.array([scene.workspace.x_cm, scene.workspace.y_cm])
    assert min(oracle_clearance_cm(scene, arm, pose) for pose in q) > scene.margin_cm
    assert (tips >= box[:, 0] - 1e-3).all()
    assert (tips <= box[:, 1] + 1e-3).all()
    for j, (low, high) in enumerate(scene.arm.joint_limits_rad):
        assert (q[:, j] >= low - 1e-6).all()
        assert (q[:, j] <= high + 1e-6).all()
    return q


PAIRS = {
    # Best motions known, for thin links: 2.170 and 1.997 s (joint splines optimised for time, all of the acceleration).
    "around the base": ((45.0, 5.0), (-45.0, 5.0), 2.25),
    "over two obstacles": ((25.0, 42.0), (-25.0, 42.0), 2.05),
}


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("width", [0.01, 0.8])
def test_the_two_known_tasks_are_solved_in_time(name, width, sized):
    start, goal, wanted_s = PAIRS[name]
    scene = scene_between(
        start, goal, arm=replace(CASE_1.arm, link_width_cm=width, joint_limits_rad=((-pi / 2, 1.5 * pi), (-pi, pi)))
    )
    limits = Limits.of_joints(scene.joints, 1.0)
    task = scene_task(scene, scene.margin_cm + 0.015, limits)
    spline = find_fastest(task, [], Budget(1e9, sized(6_000, 40_000)), 1, clock_of_evaluations, lambda _share, _s: None)
    assert spline is not None
    made = fastest_motion(spline, limits)
    # 0.8 cm wide links have 0.4 cm less room at every obstacle.
    assert made.duration_s <= (wanted_s if width < 0.1 else wanted_s + 0.05)
    assert limit_use(made, limits).largest <= 1.0 + 1e-9
    q = free_and_inside(scene, spline)
    assert (q[:, 1] <= 1e-9).all()  # elbow up all the way
    arm = Arm.from_spec(scene.arm)
    assert q[[0, -1]] == pytest.approx(np.stack([inverse_2r(arm, p, "up") for p in (start, goal)]), abs=1e-9)


def test_the_same_seed_and_evaluations_give_the_same_spline_and_progress_rises():
    scene = scene_between((45.0, 5.0), (-45.0, 5.0))
    task = scene_task(scene, scene.margin_cm, Limits.of_joints(scene.joints))
    told = []

    def run():
        return find_fastest(task, [], Budget(1e9, 4000), 7, clock_of_evaluations, lambda *now: told.append(now))

    one, two = run(), run()
    assert one is not None
    assert two is not None
    assert np.array_equal(one.coefficients, two.coefficients)
    half = told[: len(told) // 2]
    assert all(a[0] <= b[0] and a[1] >= b[1] for a, b in pairwise(half))


def test_a_budget_that_is_used_up_at_once_finds_nothing():
    task = scene_task(CASE_1, CASE_1.margin_cm, Limits.of_joints(CASE_1.joints))
    now_s = iter([100.0])  # the budget begins at the first reading, after which a long time has passed
    told = []
    assert find_fastest(task, [], Budget(1.0), 1, lambda: next(now_s, 1e6), lambda *now: told.append(now)) is None
    assert told == []


def test_either_elbow_may_pass_through_full_stretch():
    scene = make_scene(elbow="either", start=(35.0, 20.0), goal=(35.0, -20.0))
    task = scene_task(scene, scene.margin_cm, Limits.of_joints(scene.joints))
    assert len(task.ends_rad) == 4
    assert isinstance(task, Task)
    spline = find_fastest(task, [], Budget(1e9, 12_000), 1, clock_of_evaluations, lambda _share, _s: None)
    assert spline is not None
    one_sided = scene_task(replace(scene, arm=replace(scene.arm, elbow="up")), scene.margin_cm, task.limits)
    bent = find_fastest(one_sided, [], Budget(1e9, 12_000), 1, clock_of_evaluations, lambda _share, _s: None)
    assert bent is not None
    assert fastest_motion(spline, task.limits).duration_s < fastest_motion(bent, task.limits).duration_s * 1.001


def test_the_pipeline_makes_a_certified_plan_that_is_faster(monkeypatch):
    monkeypatch.setattr(motion, "time", CountedTime())  # however busy the computer is
    scene = scene_between((45.0, 5.0), (-45.0, 5.0))
    timed = replace(scene, planner=replace(scene.planner, objective="time", budget_s=0.2))
    told = []
    plan = plan_scene(timed, lambda stage, share: told.append((stage, share)))
    assert plan.certificate.ok, plan.certificate.explain()
    assert ("optimise", 1.0) in told
    by_length = plan_scene(scene, lambda _stage, _share: None)
    assert plan.trajectory.duration_s < 0.95 * by_length.trajectory.duration_s
    assert plan.path.points_cm[[0, -1]] == pytest.approx(np.array([(45.0, 5.0), (-45.0, 5.0)]), abs=1e-6)


def test_a_plan_for_time_runs_on_the_emulated_board(tmp_path):
    timed = replace(CASE_1, planner=replace(CASE_1.planner, objective="time", budget_s=0.3))
    summary = run_scene(timed, "sim://", tmp_path, lambda _stage, _share: None)
    assert summary["steps_at_pins"] == summary["steps_planned"]
    assert summary["objective"] == "time"
    assert (tmp_path / "summary.json").exists()
