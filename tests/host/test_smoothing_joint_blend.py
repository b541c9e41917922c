"""Polylines of poses: corners, stops, freedom, derivatives; and paths of the tip through full stretch."""

from itertools import pairwise
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host_scenes import make_scene, oracle_clearance_cm
from planarm.errors import NoPathError, TimingError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.scene import Obstacle
from planarm.search.path import Path
from planarm.smoothing.joint_blend import blend_poses
from planarm.smoothing.joint_spline import JointSpline, joined
from planarm.smoothing.smooth import smooth_path
from planarm.smoothing.tip_path import TipPath
from planarm.workspace.free_map import build_free_map
from planarm.workspace.joint_proof import joint_world

LIMITS = (-2 * pi, 2 * pi)


def arm_among(obstacles=(), links=(30.0, 20.0), limits=None):
    scene = make_scene(obstacles, links=links, limits=limits or (LIMITS,) * len(links))
    return scene, Arm.from_spec(scene.arm), joint_world(scene)


def inner(path, count=60):
    shares = (np.arange(count) + 0.5) / count
    return (path.borders_s[:-1, None] + np.diff(path.borders_s)[:, None] * shares).ravel()


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), joints=st.integers(2, 4), tolerance_cm=st.floats(0.05, 5.0))
def test_a_blended_polyline_is_smooth_ends_at_its_ends_and_keeps_the_tolerance(seed, joints, tolerance_cm):
    rng = np.random.default_rng(seed)
    _, arm, world = arm_among(links=tuple(rng.uniform(5.0, 30.0, joints)))
    poses = rng.uniform(-2.0, 2.0, (5, joints))
    path = blend_poses(poses, arm, world, tolerance_cm)
    s = inner(path)
    q, dq, ddq = path.evaluate(s)
    h = 1e-7
    assert dq == pytest.approx((path.evaluate(s + h).q_rad - path.evaluate(s - h).q_rad) / (2 * h), abs=1e-6)
    assert ddq == pytest.approx(
        (path.evaluate(s + h).dq_rad - path.evaluate(s - h).dq_rad) / (2 * h), rel=1e-4, abs=1e-4
    )
    assert path.evaluate(path.borders_s[[0, -1]]).q_rad == pytest.approx(poses[[0, -1]], abs=1e-12)
    borders = path.borders_s[1:-1]
    before, behind = path.evaluate(borders, "left"), path.evaluate(borders, "right")
    assert before.q_rad == pytest.approx(behind.q_rad, abs=1e-9)
    runs_on = ~np.isin(borders, path.stops_s)
    assert before.dq_rad[runs_on] == pytest.approx(behind.dq_rad[runs_on], abs=1e-9)
    # Some pose of the path is within the tolerance of each corner: the tip's position there.
    tips = path.tip_cm(np.linspace(0.0, path.borders_s[-1], 20_000))
    for corner in forward(arm, poses)[:, -1]:
        assert np.hypot(*(tips - corner).T).min() <= tolerance_cm + 0.01
    assert forward(arm, q)[:, -1] == pytest.approx(path.tip_cm(s), abs=1e-9)


def test_without_a_tolerance_every_corner_is_a_stop():
    _, arm, world = arm_among()
    path = blend_poses(
        np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]), arm, world, None
    )
    assert path.stops_s.tolist() == [1.0, 3.0]
    assert path.borders_s.tolist() == [0.0, 1.0, 3.0, 4.0]


def test_turning_back_is_a_stop_and_one_pose_is_no_motion():
    _, arm, world = arm_among()
    back = blend_poses(np.array([(0.0, 0.0), (1.0, 0.0), (0.2, 0.0)]), arm, world, 1.0)
    assert back.stops_s.tolist() == [1.0]
    still = blend_poses(np.array([(0.3, 0.4), (0.3, 0.4)]), arm, world, 1.0)
    assert still.borders_s.tolist() == [0.0]
    assert still.evaluate(np.zeros(1)).q_rad.tolist() == [[0.3, 0.4]]


def test_a_corner_beside_an_obstacle_is_cut_less():
    poses = np.array([(0.0, -1.0), (1.0, -1.0), (1.0, -0.2)])
    _, arm, open_world = arm_among()
    wide = blend_poses(poses, arm, open_world, 8.0)
    middle = wide.tip_cm(np.array([0.5 * (wide.borders_s[1] + wide.borders_s[2])]))[0]
    scene, arm, world = arm_among([Obstacle("circle", tuple(middle), 0.2)])
    made = blend_poses(poses, arm, world, 8.0)
    q = made.evaluate(np.linspace(0.0, made.borders_s[-1], 600)).q_rad
    assert min(oracle_clearance_cm(scene, arm, pose) for pose in q) > scene.margin_cm - 1e-9
    assert np.diff(made.borders_s)[1] < np.diff(wide.borders_s)[1]


def test_a_move_that_is_not_free_is_named():
    _, arm, world = arm_among([Obstacle("circle", (45.0, 0.0), 4.0)])
    with pytest.raises(NoPathError, match=r"from pose 1 to pose 2 .* at joint angles -?\d+\.\d\d, 0\.00 deg"):
        blend_poses(np.array([(-0.5, 0.0), (0.5, 0.0)]), arm, world, 1.0)


@pytest.mark.parametrize("poses", [np.zeros((0, 2)), np.zeros((2, 3)), np.array([(0.0, np.nan)])])
def test_what_are_no_poses_is_refused(poses):
    _, arm, world = arm_among()
    with pytest.raises(ValueError, match="finite angles"):
        blend_poses(poses, arm, world, 1.0)


def test_joined_paths_stop_in_between():
    _, arm, world = arm_among()
    one = blend_poses(np.array([(0.0, 0.0), (1.0, 0.0)]), arm, world, 1.0)
    two = blend_poses(np.array([(1.0, 0.0), (1.0, 2.0)]), arm, world, 1.0)
    both = joined([one, two])
    assert both.stops_s.tolist() == [1.0]
    assert both.evaluate(np.array([0.5, 2.0])).q_rad.tolist() == [[0.5, 0.0], [1.0, 1.0]]


THROUGH_STRETCH = {
    "starts stretched": [(50.0, 0.0), (30.0, 10.0)],
    "ends stretched, with a corner": [(30.0, 0.0), (35.0, 20.0), (30.0, 40.0)],
    "grazes the fold": [(-40.0, 10.0), (40.0, 10.0)],
}


@pytest.mark.parametrize("name", THROUGH_STRETCH)
@pytest.mark.parametrize("stop", [False, True])
def test_paths_through_full_stretch_are_followed_within_the_tolerance(name, stop):
    scene, arm, world = arm_among(limits=((-2 * pi, 3 * pi), (-pi, pi)))
    points = np.array(THROUGH_STRETCH[name])
    made = smooth_path(Path.through(points, "up"), build_free_map(scene), arm, world, 0.5, stop=stop)
    assert isinstance(made, JointSpline)
    tips = made.tip_cm(np.linspace(0.0, made.borders_s[-1], 20_000))
    legs = list(pairwise(points))
    off = np.min([off_segment(tips, a, b) for a, b in legs], axis=0)
    assert off.max() <= 0.5
    assert tips[[0, -1]] == pytest.approx(points[[0, -1]], abs=1e-6)
    assert len(made.stops_s) == (len(legs) - 1 if stop else 0)


def off_segment(tips, a, b):
    along = b - a
    share = np.clip((tips - a) @ along / (along @ along), 0.0, 1.0)
    return np.hypot(*(tips - a - share[:, None] * along).T)


def test_bent_paths_stay_paths_of_the_tip():
    scene, arm, world = arm_among(limits=((-2 * pi, 3 * pi), (-pi, pi)))
    made = smooth_path(Path.through(np.array([(40.0, 0.0), (20.0, 20.0)]), "up"), build_free_map(scene), arm, world)
    assert isinstance(made, TipPath)


def test_where_nothing_near_full_stretch_is_free_the_place_is_told():
    # A pin where the straight arm would end, with moves = "nodes" in mind.
    scene, arm, world = arm_among([Obstacle("circle", (48.0, 0.0), 1.0)], limits=((-2 * pi, 3 * pi), (-pi, pi)))
    with pytest.raises(TimingError, match=r"full stretch .* tip \(50.00, 0.00\) cm.*motion.tolerance_cm"):
        smooth_path(Path.through(np.array([(30.0, 10.0), (50.0, 0.0)]), "up"), build_free_map(scene), arm, world)
