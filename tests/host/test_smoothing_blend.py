"""Corner blends: geometry in closed form, angles and derivatives against plain kinematics, freedom by samples."""

import re
from math import hypot, pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host_scenes import make_scene, oracle_clearance_cm, random_obstacles
from motion_paths import tip_path, tip_points
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.scene import Obstacle
from planarm.search.grid_search import find_path
from planarm.search.path import Path
from planarm.smoothing.blend import bends_everywhere, blend_corners, stretched_place, way_points
from planarm.workspace.free_map import build_free_map

RIGHT_ANGLE = [(40.0, 0.0), (40.0, 20.0), (20.0, 20.0)]


def inner(path, count=400):
    """Parameters in the inside of pieces, and the distance to the nearest border for differences."""
    shares = (np.arange(count) + 0.5) / count
    s = path.borders_s[:-1, None] + np.diff(path.borders_s)[:, None] * shares
    return s.ravel()


def test_repeated_points_and_straight_runs_are_merged():
    points = [(0, 0), (1, 1), (1, 1), (3, 3), (3, 4), (3, 9), (2, 9), (2.5, 9)]
    assert way_points(np.array(points, float)).tolist() == [[0, 0], [3, 3], [3, 9], [2, 9], [2.5, 9]]


@pytest.mark.parametrize("points", [[], [(1.0, float("nan"))], [(1.0, 2.0, 3.0)]])
def test_what_is_no_path_is_refused(points):
    with pytest.raises(ValueError, match="finite points"):
        way_points(np.array(points, float))


def test_the_tolerance_must_be_positive():
    with pytest.raises(ValueError, match="tolerance"):
        tip_path(RIGHT_ANGLE, tolerance_cm=0.0)


@pytest.mark.parametrize("tolerance_cm", [0.1, 0.5, 2.0])
def test_a_corner_is_cut_as_far_as_the_tolerance_says(tolerance_cm):
    path = tip_path(RIGHT_ANGLE, tolerance_cm)
    tips = path.tip_cm(np.linspace(0.0, path.length_cm, 40_001))
    nearest = np.min(np.hypot(*(tips - RIGHT_ANGLE[1]).T))
    assert nearest == pytest.approx(tolerance_cm, abs=1e-4)
    # d = 4 tolerance / |v - u| with u and v at a right angle
    assert path.borders_s.tolist() == pytest.approx(
        [0.0, 20.0 - 4.0 * tolerance_cm / sqrt(2.0), 20.0 + 4.0 * tolerance_cm / sqrt(2.0), 40.0]
    )


def test_a_cut_takes_at_most_half_a_leg():
    path = tip_path([(40.0, 0.0), (40.0, 2.0), (38.0, 2.0), (38.0, 12.0)], tolerance_cm=5.0)
    # Corners at s = 2 and 4; the middle leg of 2 cm is shared, 0.998 cm to each.
    assert path.borders_s.tolist() == pytest.approx([0.0, 1.002, 2.998, 3.002, 4.998, 14.0])


def test_one_point_is_a_path_without_motion():
    path = tip_path([(30.0, 10.0), (30.0, 10.0)])
    arm = Arm((30.0, 20.0), (0.0, 0.0), ((-pi, pi), (-pi, pi)))
    assert path.length_cm == 0.0
    state = path.evaluate(np.zeros(1))
    assert state.q_rad[0] == pytest.approx(inverse_2r(arm, (30.0, 10.0), "up"), abs=1e-12)
    assert not state.dq_rad.any()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), elbow=st.sampled_from(["up", "down"]), tolerance_cm=st.floats(0.05, 3.0))
def test_joints_put_the_tip_on_the_path_and_their_derivatives_are_those_of_the_angles(seed, elbow, tolerance_cm):
    rng = np.random.default_rng(seed)
    base = (5.0, -3.0)
    free_map = build_free_map(make_scene(base=base, elbow=elbow, cell=10.0, limits=((-9.0, 9.0), (-pi, pi))))
    path = tip_path(tip_points(rng, 6) + base, tolerance_cm, free_map)
    arm = Arm((30.0, 20.0), base, ((-9.0, 9.0), (-pi, pi)))
    s = inner(path)
    q, dq, ddq = path.evaluate(s)
    assert forward(arm, q)[:, 2] == pytest.approx(path.tip_cm(s), abs=1e-9)
    assert (q[:, 1] < 0.0).all() if elbow == "up" else (q[:, 1] > 0.0).all()
    h = 1e-6  # far inside a piece: the shortest has 0.02 cm, its samples keep 2.5e-5 cm from the border
    left, right = path.evaluate(s - h), path.evaluate(s + h)
    assert dq == pytest.approx((right.q_rad - left.q_rad) / (2 * h), abs=1e-7)
    assert ddq == pytest.approx((right.dq_rad - left.dq_rad) / (2 * h), abs=1e-5)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_rates_run_on_at_borders_that_are_no_stops(seed):
    path = tip_path(tip_points(np.random.default_rng(seed), 7))
    inside = path.borders_s[1:-1]
    before, behind = path.evaluate(inside, "left"), path.evaluate(inside, "right")
    assert before.q_rad == pytest.approx(behind.q_rad, abs=1e-9)
    runs_on = ~np.isin(inside, path.stops_s)
    assert runs_on.any()
    assert before.dq_rad[runs_on] == pytest.approx(behind.dq_rad[runs_on], abs=1e-9)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_length_and_both_ends_are_those_of_the_way_points(seed):
    points = tip_points(np.random.default_rng(seed), 5)
    path = tip_path(points)
    assert path.length_cm == pytest.approx(sum(hypot(*leg) for leg in np.diff(points, axis=0)))
    assert path.tip_cm(path.borders_s[[0, -1]]) == pytest.approx(points[[0, -1]], abs=1e-9)


def test_turning_back_is_a_stop_that_reaches_the_corner():
    path = tip_path([(30.0, 0.0), (40.0, 0.0), (30.0, 0.1)])
    assert path.stops_s.tolist() == [10.0]
    assert path.tip_cm(np.array([10.0]))[0] == pytest.approx((40.0, 0.0))
    before, behind = path.evaluate(np.array([10.0]), "left"), path.evaluate(np.array([10.0]), "right")
    assert np.abs(before.dq_rad - behind.dq_rad).max() > 0.01


def test_the_angles_have_no_jump_where_the_turn_of_the_limits_ends():
    # Limits of -180 to 180 degrees: theta1 is told in that turn, and the path leaves it behind the base.
    scene = make_scene(limits=((-pi, 2 * pi), (-pi, pi)), cell=10.0)
    free_map = build_free_map(scene)
    points = np.array([(35.0 * np.cos(a), 35.0 * np.sin(a)) for a in np.linspace(0.5, 0.5 + 1.5 * pi, 30)])
    path = tip_path(points, free_map=free_map)
    q = path.evaluate(np.linspace(0.0, path.length_cm, 5000)).q_rad
    assert np.abs(np.diff(q, axis=0)).max() < 0.01
    assert np.ptp(q[:, 0]) == pytest.approx(1.5 * pi, rel=0.05)


def free_of(scene, path, margin_cm):
    arm = Arm.from_spec(scene.arm)
    q = path.evaluate(np.linspace(0.0, path.length_cm, 1500)).q_rad
    return min(oracle_clearance_cm(scene, arm, pose) for pose in q) > margin_cm


@pytest.mark.parametrize("seed", range(6))
def test_blends_of_searched_paths_are_free(seed):
    rng = np.random.default_rng(seed)
    scene = make_scene(random_obstacles(rng, 3, size=9.0), y=(0.0, 50.0), limits=((-pi / 2, 1.5 * pi), (-2.4, 2.4)))
    free_map = build_free_map(scene)
    for _ in range(20):
        start, goal = (tuple(float(v) for v in rng.integers((-45, 5), (45, 45))) for _ in range(2))
        found = find_path(free_map, start, goal, scene.planner)
        if found.path is not None and len(way_points(found.path.points_cm)) > 2:
            break
    else:
        pytest.fail("no path with corners found for this seed")
    assert free_of(scene, blend_corners(found.path, free_map, tolerance_cm=3.0), scene.margin_cm - 1e-9)


def test_a_blend_that_would_hit_is_made_smaller():
    # Seen along link 2, the pin stands 2.5 cm beyond the corner: inside the corner, before the largest parabola's 3 cm.
    points = np.array([(35.0, 26.0), (21.2, 21.2), (26.2, 7.1)])
    beyond = points[1] + 2.5 * np.array([0.9, -0.43])
    scene = make_scene([Obstacle("circle", tuple(beyond), 0.2)], cell=10.0)
    largest = tip_path(points, 3.0)
    made = blend_corners(Path.through(points, "up"), build_free_map(scene), 3.0)
    assert not free_of(scene, largest, scene.margin_cm)
    assert free_of(scene, made, scene.margin_cm - 1e-9)
    assert len(made.borders_s) == len(largest.borders_s) == 4
    assert 0.01 < np.diff(made.borders_s)[1] < np.diff(largest.borders_s)[1]


def test_a_corner_that_nothing_proves_stays_a_stop():
    # As with moves = "nodes", which lets a path run through an obstacle.
    free_map = build_free_map(make_scene([Obstacle("circle", (40.0, 20.0), 12.0)], cell=10.0))
    made = blend_corners(Path.through(np.array(RIGHT_ANGLE), "up"), free_map, 3.0)
    assert made.stops_s.tolist() == [20.0]
    assert made.borders_s.tolist() == [0.0, 20.0, 40.0]


@pytest.mark.parametrize(
    ("points", "place"),
    [
        ([(50.0, 0.0), (30.0, 10.0)], r"path 0.00 .* tip \(50.00, 0.00\)"),
        # Straight legs that touch the circle of full fold, 10 cm, and that of full stretch by a rounded corner.
        ([(-40.0, 10.001), (40.0, 10.001)], r"path 40.00 .* tip \(-?0.00, 10.00\)"),
        ([(29.0, 40.0), (30.0, 40.01), (30.0, 30.0)], r"tip \((29|30).\d+, (39|40).\d+\)"),
    ],
)
def test_full_stretch_and_full_fold_are_seen_with_their_place(points, place):
    path = tip_path(points, tolerance_cm=0.002)
    assert not bends_everywhere(path)
    assert re.search(place, stretched_place(path))


def test_a_path_with_a_bent_elbow_is_no_stretched_one():
    assert bends_everywhere(tip_path(RIGHT_ANGLE))


def test_without_a_tolerance_every_corner_is_a_stop():
    path = tip_path([(40.0, 0.0), (40.0, 10.0), (30.0, 10.0), (30.0, 20.0)], tolerance_cm=None)
    assert path.stops_s.tolist() == [10.0, 20.0]
    assert path.borders_s.tolist() == [0.0, 10.0, 20.0, 30.0]
