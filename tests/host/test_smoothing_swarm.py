"""Motions in time: along nodes, by a swarm; what is judged of them, and how late they may be."""

from dataclasses import replace

import numpy as np
import pytest

from host_scenes import make_scene
from moving_scenes import QUARTER, SAMPLE_S, clearance_at, random_moving_scene, replace_moving
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.scene import MovingSpec, Obstacle, ObstacleMotion
from planarm.search.moving.space_time import search_space_time
from planarm.smoothing.swarm import PAPER, SwarmSettings, fly
from planarm.smoothing.timed_spline import delay_margin_s, from_nodes, judge, tip_length_cm
from planarm.workspace.moving_map import build_moving_map

SMALL = SwarmSettings(particles=20, iterations=25)


def found(seed, **settings):
    """A random scene with a path of more than 12 samples, its map and that path."""
    while True:
        scene = random_moving_scene(np.random.default_rng(seed), samples=45, **settings)
        moving = build_moving_map(scene, "up")
        start, goal = moving.cell_at(scene.task.start_cm), moving.cell_at(scene.task.goal_cm)
        if start != goal and min(start, goal) >= 0 and moving.nodes(0).ravel()[start]:
            path = search_space_time(moving, start, goal).path
            if path is not None and path.arrival > 12:
                return scene, moving, path
        seed += 1


def test_the_motion_along_nodes_rests_on_each_at_its_sample():
    scene, _, path = found(0)
    spline = from_nodes(Arm.from_spec(scene.arm), path, SAMPLE_S)
    state = spline.evaluate(SAMPLE_S * np.arange(path.arrival + 1.0), "left")
    assert state.q_rad == pytest.approx(path.q_rad, abs=1e-12)
    assert state.dq_rad[1:] == pytest.approx(0.0, abs=1e-12)
    assert spline.evaluate(np.array([0.0])).dq_rad == pytest.approx(0.0)
    assert tip_length_cm(spline) == pytest.approx(path.length_cm, rel=0.02)


@pytest.mark.parametrize("settings", [SMALL, replace(PAPER, particles=20, iterations=25)], ids=["default", "paper"])
def test_a_swarm_gives_a_shorter_motion_that_is_free_at_every_time(settings):
    shortened = 0
    for seed in (10, 200, 3000):
        scene, moving, path = found(seed, count=4, delay_s=0.1)
        result = fly(scene, moving, path, np.random.default_rng(seed), settings)
        assert result.length_cm <= path.length_cm
        assert result.curve_cm[0] == path.length_cm
        assert all(b <= a for a, b in zip(result.curve_cm, result.curve_cm[1:], strict=False))
        assert result.curve_cm[-1] == result.length_cm
        if result.spline is None:
            assert result.length_cm == path.length_cm
            continue
        shortened += 1
        times = np.linspace(0.0, path.arrival * SAMPLE_S, 80)
        state = result.spline.evaluate(times)
        for time_s, q_rad in zip(times, state.q_rad, strict=True):
            for late in (0.0, 0.1):
                assert clearance_at(scene, q_rad, time_s + late) > scene.margin_cm, f"seed {seed}"
        share = scene.motion.acceleration_share
        for joint, speeds, bends in zip(scene.joints, state.dq_rad.T, state.ddq_rad.T, strict=True):
            assert np.abs(speeds).max() <= joint.max_speed_rad_s
            assert np.abs(bends).max() <= share * joint.max_acceleration_rad_s2
        tips = forward(Arm.from_spec(scene.arm), state.q_rad)[:, -1]
        assert tips[0] == pytest.approx(path.points_cm[0])
        assert tips[-1] == pytest.approx(path.points_cm[-1])
        assert np.hypot(*np.diff(tips, axis=0).T).sum() <= result.length_cm + 1e-9
    assert shortened > 0 or settings is not SMALL


def test_the_same_seed_flies_the_same_way():
    scene, moving, path = found(10)
    one, two = (fly(scene, moving, path, np.random.default_rng(3), SMALL) for _ in range(2))
    assert one.curve_cm == two.curve_cm


def test_without_via_points_the_path_is_kept():
    scene, moving, path = found(10)
    result = fly(scene, moving, path, np.random.default_rng(3), replace(SMALL, via_points=0))
    assert result.spline is None
    assert result.length_cm == path.length_cm


def test_a_swarm_that_may_not_pass_keeps_the_path():
    """Joints just strong enough for the moves from node to node leave no curve that keeps its times and is faster."""
    scene, moving, path = found(10)
    weak = replace(scene, joints=tuple(replace(j, max_speed_rad_s=1e-3) for j in scene.joints))
    result = fly(weak, moving, path, np.random.default_rng(3), SMALL)
    assert result.spline is None
    assert result.feasible == 0


def sweeper(speed_cm_s, samples=40):
    """A disc that comes up to a resting arm and stops 1 cm off its margin, or goes on."""
    motion = ObstacleMotion((0.0, 20.0 / speed_cm_s), ((0.0, 0.0), (0.0, 20.0)), False)
    scene = make_scene(
        [Obstacle("circle", (24.0, -16.0), 4.0, motion=motion)],
        links=(15.0, 15.0), limits=QUARTER, x=(-32.0, 32.0), y=(-32.0, 32.0), cell=2.0,
        start=(26.0, 0.0), goal=(26.0, 12.0),
    )  # fmt: skip
    return replace_moving(scene, MovingSpec(SAMPLE_S, samples, 0.0))


def test_the_delay_margin_is_the_largest_for_which_every_pose_stays_free():
    scene = sweeper(4.0)
    moving = build_moving_map(scene, "up")
    path = search_space_time(moving, moving.cell_at((26.0, 0.0)), moving.cell_at((26.0, 12.0))).path
    assert path is not None
    spline = from_nodes(Arm.from_spec(scene.arm), path, SAMPLE_S)
    margin = delay_margin_s(moving, spline)
    assert 0.05 < margin < scene.moving.horizon_s
    times = np.linspace(0.0, path.arrival * SAMPLE_S, 160)
    poses = spline.evaluate(times).q_rad

    def least(delay):
        return min(clearance_at(scene, q, t + late) for t, q in zip(times, poses, strict=True) for late in (0.0, delay))

    assert least(margin) > scene.margin_cm
    # Poses move at most about 6 cm/s and the disc 4 cm/s, so looking every 38 ms misses at most 0.2 cm.
    assert least(margin + 0.05) <= scene.margin_cm + 0.2


def test_a_motion_that_is_not_free_or_too_fast_is_judged_by_name():
    scene = sweeper(4.0)
    moving = build_moving_map(scene, "up")
    path = search_space_time(moving, moving.cell_at((26.0, 0.0)), moving.cell_at((26.0, 12.0))).path
    arm = Arm.from_spec(scene.arm)
    spline = from_nodes(arm, path, SAMPLE_S)
    assert not judge(scene, moving, spline).problem
    slow = from_nodes(arm, path, 40.0 * SAMPLE_S)
    verdict = judge(scene, moving, slow)
    assert verdict.problem == "obstacles[1] would touch a link"
    assert verdict.obstacle == 1
    fast = from_nodes(arm, path, 0.01 * SAMPLE_S)
    assert judge(scene, moving, fast).problem == "a joint would be too fast"
    assert judge(scene, moving, fast, limited=False).problem in ("", "obstacles[1] would touch a link")
    low = replace(scene, arm=replace(scene.arm, joint_limits_rad=((0.0, 6.2), (-0.1, 0.0))))
    assert "leave its limits" in judge(low, moving, spline).problem
