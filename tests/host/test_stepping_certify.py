"""The certificate: green for what the planners make, red for every single thing that is changed afterwards."""

import json
from dataclasses import asdict, replace
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host_scenes import make_scene, oracle_distance_cm, random_obstacles
from planarm.model.arm import Arm
from planarm.model.shapes import obstacle_set, shape_of
from planarm.scene import Obstacle
from planarm.search.grid_search import find_path
from planarm.smoothing.blend import blend_corners
from planarm.stepping.certify import Certificate, Check, certify
from planarm.stepping.clearance import clearances_cm, joint_positions_cm
from planarm.stepping.quantise import quantisation_bound_cm
from planarm.stepping.schedule import schedule
from planarm.stepping.segments import expand
from planarm.stepping.train import StepTrain
from planarm.trajectory.timing import time_path
from planarm.workspace.free_map import build_free_map

CASE_1 = tuple(Obstacle("circle", at, 10.0) for at in ((35.0, 18.0), (7.0, 35.0), (-13.0, 35.0), (-30.0, 20.0)))
"""Paper C, Table I, case 1, as circles."""


def planned(scene):
    """(trajectory, train, segments) of a scene, as the pipeline makes them."""
    margin_cm = scene.margin_cm + quantisation_bound_cm(Arm.from_spec(scene.arm), scene.joints)
    free_map = build_free_map(scene, margin_cm)
    found = find_path(free_map, scene.task.start_cm, scene.task.goal_cm, scene.planner)
    assert found.path is not None, found.reason
    path = blend_corners(found.path, free_map)
    return schedule(scene, lambda limit: time_path(path, scene.joints, speed_cap=limit))


@pytest.fixture(scope="module")
def scene():
    return make_scene(CASE_1, y=(0.0, 50.0))


@pytest.fixture(scope="module")
def plan(scene):
    return planned(scene)


def red(certificate):
    return [check.name for check in certificate.checks if check.verdict == "red"]


def test_a_plan_of_the_planners_is_green_with_every_check(scene, plan):
    certificate = certify(scene, *plan)
    assert red(certificate) == []
    assert certificate.ok
    names = [check.name for check in certificate.checks]
    assert len(set(names)) == len(names)
    for word in ("timing", "interval", "reversal", "speed", "acceleration", "deviation", "clearance", "limits", "goal"):
        assert any(word in name for name in names), word
    assert certificate.explain() == f"all {len(names)} checks hold"


@pytest.mark.parametrize("seed", range(8))
def test_plans_among_random_obstacles_are_green(seed):
    rng = np.random.default_rng(seed)
    scene = make_scene(random_obstacles(rng, 3), y=(0.0, 50.0), clearance=0.3)
    free_map = build_free_map(scene, scene.margin_cm + 0.02)
    ys, xs = np.nonzero(free_map.region == 0)
    picked = rng.choice(len(xs), 2, replace=False)
    start, goal = ((float(free_map.x_cm[xs[i]]), float(free_map.y_cm[ys[i]])) for i in picked)
    scene = replace(scene, task=replace(scene.task, start_cm=start, goal_cm=goal))
    if find_path(free_map, start, goal, scene.planner).path is None:
        scene = replace(scene, task=replace(scene.task, goal_cm=start))  # walled in: no motion is green, too
    certificate = certify(scene, *planned(scene))
    assert certificate.ok, certificate.explain()


def test_a_certificate_is_plain_data(scene, plan):
    certificate = certify(scene, *plan)
    rows = json.loads(json.dumps([asdict(check) for check in certificate.checks]))
    assert Certificate(tuple(Check(**row) for row in rows)) == certificate


def test_without_checks_nothing_is_certified():
    assert not Certificate(()).ok
    assert "no checks" in Certificate(()).explain()


def test_a_red_check_tells_value_limit_place_and_setting(scene, plan):
    far = replace(scene, task=replace(scene.task, goal_cm=(1.0, 45.5)))
    certificate = certify(far, *plan)
    assert red(certificate) == ["tip error at the goal"]
    words = certificate.explain()
    for word in ("0.498", "cm", "limit 0.0137", "tip (1.00", "task.goal_cm"):
        assert word in words


def mutated(plan, change):
    """The plan with changed segments."""
    trajectory, train, segments = plan
    changed = change(list(segments.segments))
    return trajectory, train, replace(segments, segments=tuple(changed))


def with_move(segments, k, j, **fields):
    moves = list(segments[k].moves)
    moves[j] = replace(moves[j], **fields)
    segments[k] = replace(segments[k], moves=tuple(moves))
    return segments


def busy(segments, joint=0):
    """Index of a segment in which the joint makes many steps."""
    return max(range(len(segments)), key=lambda k: segments[k].moves[joint].steps_dir)


def swapped(segments):
    k = len(segments) // 3
    segments[k], segments[k + 1] = segments[k + 1], segments[k]
    return segments


def turned(segments):
    k = busy(segments)
    return with_move(segments, k, 0, steps_dir=segments[k].moves[0].steps_dir ^ 1)


def one_step_more(segments):
    k = busy(segments)
    return with_move(segments, k, 0, steps_dir=segments[k].moves[0].steps_dir + 2)


def one_step_fewer(segments):
    k = busy(segments, 1)
    return with_move(segments, k, 1, steps_dir=segments[k].moves[1].steps_dir - 2)


def earlier(segments):
    k = busy(segments)
    return with_move(segments, k, 0, first_ticks=segments[k].moves[0].first_ticks - 300)


def later_but_longer(segments):
    k = len(segments) // 2
    segments[k] = replace(segments[k], duration_flags=segments[k].duration_flags + 2 * 5000)
    return segments


def shorter_intervals(segments):
    k = busy(segments)
    return with_move(segments, k, 0, interval_q8=segments[k].moves[0].interval_q8 // 2)


def bent(segments):
    k = busy(segments)
    move = segments[k].moves[0]
    return with_move(segments, k, 0, add=move.add + 20 * (256 if move.steps_dir >> 1 <= 128 else 65536))


def doubled(segments):
    k = busy(segments)
    return [*segments[: k + 1], *segments[k:]]


def unflagged(segments):
    segments[-1] = replace(segments[-1], duration_flags=segments[-1].duration_flags & ~1)
    return segments


def flagged_early(segments):
    segments[3] = replace(segments[3], duration_flags=segments[3].duration_flags | 1)
    return segments


def too_short(segments):
    k = busy(segments)
    segments[k] = replace(segments[k], duration_flags=2 * 1000)
    return segments


def without_last(segments):
    return segments[:-1]


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (swapped, "timing error"),
        (turned, "end position"),
        (one_step_more, "end position"),
        (one_step_fewer, "end position"),
        (earlier, "timing error"),
        (later_but_longer, "duration"),
        (shorter_intervals, "step interval"),
        (bent, "timing error"),
        (doubled, "end position"),
        (unflagged, "wire limits"),
        (flagged_early, "wire limits"),
        (too_short, "wire limits"),
        (without_last, "duration"),
    ],
)
def test_every_change_of_the_segments_turns_it_red(scene, plan, change, name):
    certificate = certify(scene, *mutated(plan, change))
    assert not certificate.ok
    assert any(name in found for found in red(certificate)), red(certificate)


@pytest.mark.parametrize(
    ("field", "value", "name"),
    [
        ("max_speed_rad_s", 1.0, "joint 2 planned speed"),
        ("max_speed_rad_s", 1.0, "joint 2 step interval"),
        ("max_acceleration_rad_s2", 7.9, "joint 2 planned acceleration"),
        ("max_acceleration_rad_s2", 7.6, "joint 2 acceleration of the steps"),
        ("microsteps", 32, "joint 2 deviation"),
    ],
)
def test_every_tightened_limit_of_a_joint_turns_it_red(scene, plan, field, value, name):
    one, two = scene.joints
    certificate = certify(replace(scene, joints=(one, replace(two, **{field: value}))), *plan)
    assert any(name in found for found in red(certificate)), red(certificate)


def test_an_obstacle_in_the_way_turns_it_red(scene, plan):
    tip = plan[0].path.tip_cm(np.array([30.0]))[0]
    x, y = (float(v) for v in tip)
    moved = replace(scene, obstacles=(*scene.obstacles[1:], Obstacle("square", (x + 0.8, y), 1.0)))
    certificate = certify(moved, *plan)
    assert red(certificate) == ["clearance of the links' centre lines"]
    check = next(check for check in certificate.checks if check.verdict == "red")
    assert "obstacles[4]" in check.where


def least_clearance_cm(scene, q_rad):
    positions = joint_positions_cm(np.array(scene.arm.link_lengths_cm), scene.arm.base_cm, q_rad)
    return clearances_cm(positions, obstacle_set([shape_of(o) for o in scene.obstacles]))[0].min()


def test_clearance_is_exact_to_the_micro_step(scene, plan):
    # The least clearance plus half the links' width is what may be asked for, and no more.
    found = next(check for check in certify(scene, *plan).checks if check.name.startswith("clearance"))
    for extra, verdict in ((-1e-9, "green"), (1e-9, "red")):
        wide = replace(scene, arm=replace(scene.arm, link_width_cm=2.0 * (found.value + extra)))
        again = next(check for check in certify(wide, *plan).checks if check.name.startswith("clearance"))
        assert again.verdict == verdict
    # It is the planner's clearance along the path, less at most a micro-step of each joint.
    q = plan[0].sample(np.linspace(0.0, plan[0].duration_s, 4000))[0]
    planned_cm = least_clearance_cm(scene, q)
    assert planned_cm - 0.03 <= found.value <= planned_cm


def test_clearance_holds_between_micro_steps():
    # Coarse steps, 1000 a turn: 0.3 cm at full reach. The oracle moves from pose to pose and looks in between.
    fine = make_scene(CASE_1[:1], y=(0.0, 50.0))
    joints = tuple(replace(one, microsteps=1) for one in fine.joints)
    coarse = replace(fine, joints=joints)
    trajectory, train, segments = planned(coarse)
    found = next(
        check for check in certify(coarse, trajectory, train, segments).checks if check.name.startswith("clearance")
    )
    made = expand(segments)
    ticks = np.unique(np.concatenate([steps.ticks for steps in made.steps]))
    poses = np.column_stack(
        [
            start
            + np.concatenate([[0], np.cumsum(steps.directions)])[np.searchsorted(steps.ticks, ticks, side="right")]
            for start, steps in zip(made.start_usteps, made.steps, strict=True)
        ]
    )
    shares = np.linspace(0.0, 1.0, 9)[:, None, None]
    q = ((1.0 - shares) * poses[:-1] + shares * poses[1:]) / joints[0].usteps_per_rad
    true_cm = least_clearance_cm(coarse, q.reshape(-1, 2))
    assert coarse.margin_cm <= found.value <= true_cm
    assert found.value >= true_cm - 0.5 * (50.0 + 20.0) / joints[0].usteps_per_rad


def test_tighter_joint_limits_turn_it_red_and_rounding_amber(scene, plan):
    made = expand(plan[2])
    steps = np.concatenate([[made.start_usteps[0]], made.start_usteps[0] + np.cumsum(made.steps[0].directions)])
    largest = steps.max() / scene.joints[0].usteps_per_rad
    for limit, verdict in ((largest + 1e-9, "green"), (largest - 1e-4, "amber"), (largest - 1e-3, "red")):
        arm = replace(scene.arm, joint_limits_rad=((-pi, float(limit)), (-pi, pi)))
        certificate = certify(replace(scene, arm=arm), *plan)
        check = next(check for check in certificate.checks if check.name == "joint 1 distance to its limits")
        assert check.verdict == verdict
        assert certificate.ok == (verdict != "red")


def test_a_floor_that_is_too_high_turns_it_red(scene, plan):
    # The lowest point of the whole motion is the tip at its start, 2 cm high.
    assert certify(replace(scene, arm=replace(scene.arm, floor=True)), *plan).ok
    wide = replace(scene, arm=replace(scene.arm, floor=True, link_width_cm=4.1), obstacles=())
    assert red(certify(wide, *plan)) == ["height above the floor"]


def test_a_motion_that_is_not_the_planned_one_turns_it_red(scene, plan):
    trajectory, train, segments = plan
    slower = replace(trajectory, t_s=trajectory.t_s * 1.01, s_dot=trajectory.s_dot / 1.01)
    assert any("deviation" in name for name in red(certify(scene, slower, train, segments)))


def test_a_plan_that_starts_elsewhere_turns_it_red(scene, plan):
    trajectory, train, segments = plan
    shifted = tuple(n + 3 for n in train.start_usteps)
    moved = StepTrain(shifted, train.steps, train.duration_ticks)
    certificate = certify(scene, trajectory, moved, replace(segments, start_usteps=shifted))
    assert "tip error at the start" in red(certificate)


def test_no_motion_is_green():
    still = make_scene(start=(30.0, 20.0), goal=(30.0, 20.0))
    trajectory, train, segments = planned(still)
    assert segments.segments == ()
    certificate = certify(still, trajectory, train, segments)
    assert certificate.ok, certificate.explain()


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_distances_of_links_are_those_of_shapely(seed):
    rng = np.random.default_rng(seed)
    obstacles = random_obstacles(rng, 4, size=20.0, keep_off=0.0)
    a, b = rng.uniform(-40.0, 40.0, (2, 20, 2))
    b[:5] = a[:5] + rng.uniform(-1.0, 1.0, (5, 2))
    b[5] = a[5]
    for obstacle in obstacles:
        shape = shape_of(obstacle)
        wanted = [oracle_distance_cm(segment, shape) for segment in zip(a, b, strict=True)]
        found, _ = clearances_cm(np.stack([a, b], axis=1), obstacle_set([shape]))
        assert found == pytest.approx(np.array(wanted), abs=1e-9)
