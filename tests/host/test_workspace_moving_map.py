"""The free space over time against the map of resting obstacles, sample by sample, and against dense sampling."""

from dataclasses import replace

import numpy as np
import pytest

from moving_scenes import SAMPLE_S, clearance_at, random_moving_scene
from planarm.errors import SceneError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.model.moving import offset_cm
from planarm.workspace.cell_poses import DX, DY
from planarm.workspace.free_map import build_free_map
from planarm.workspace.moving_map import build_moving_map, packed, unpacked
from planarm.workspace.world import FREE


def at_rest(scene, time_s):
    """The scene with its obstacles resting where they are at a time."""
    rested = []
    for obstacle in scene.obstacles:
        dx, dy = offset_cm(obstacle.motion, time_s)
        x, y = obstacle.center_cm
        rested.append(replace(obstacle, center_cm=(x + dx, y + dy), motion=None))
    return replace(scene, obstacles=tuple(rested))


@pytest.mark.parametrize("seed", range(4))
def test_each_sample_is_the_map_of_obstacles_that_rest_there(seed):
    scene = random_moving_scene(np.random.default_rng(seed), count=4)
    blocked = 0
    for elbow in ("up", "down"):
        moving = build_moving_map(scene, elbow, between=False)
        for k in range(scene.moving.samples + 1):
            expected = build_free_map(at_rest(scene, k * SAMPLE_S), elbow=elbow).region == FREE
            assert (moving.nodes(k) == expected).all(), f"seed {seed}, sample {k}"
            blocked += int((~expected).sum())
    assert blocked > 0


@pytest.mark.parametrize("seed", range(2))
def test_what_may_stay_or_has_room_is_free_all_the_time(seed):
    rng = np.random.default_rng(seed)
    delay_s = 0.3
    scene = random_moving_scene(rng, count=4, samples=12, delay_s=delay_s)
    moving = build_moving_map(scene, "up")
    poses, arm = moving.poses, Arm.from_spec(scene.arm)
    kinds = {"stay": 0, "taken": 0}
    for _ in range(50):
        k, n = int(rng.integers(0, 12)), int(rng.integers(0, len(poses.cell)))
        iy, ix = divmod(int(poses.cell[n]), poses.columns)
        stays = unpacked(moving.stay[k], poses.columns)[iy, ix]
        q_rad = inverse_2r(arm, moving.tip_cm(int(poses.cell[n])), "up")
        assert poses.q_rad[n] == pytest.approx(q_rad)
        times = np.linspace(k * SAMPLE_S, (k + 1) * SAMPLE_S + delay_s, 40)
        spare = min(clearance_at(scene, q_rad, t) for t in times) - scene.margin_cm
        fastest = max(o.motion.fastest_cm_s if o.motion else 0.0 for o in scene.obstacles)
        slack = fastest * (SAMPLE_S + delay_s) / 39
        if stays:
            assert spare > 0.0
        else:
            assert spare <= slack
        if unpacked(moving.room[k], poses.columns)[iy, ix]:
            assert spare > poses.sway_cm[n]
        kinds["stay" if stays else "taken"] += 1
    assert min(kinds.values()) > 0


def test_half_of_any_move_stays_within_the_sway():
    scene = random_moving_scene(np.random.default_rng(3))

    poses, arm = build_moving_map(scene, "down", between=False).poses, Arm.from_spec(scene.arm)
    worst = 0.0
    for n in range(0, len(poses.cell), 7):
        for d in range(8):
            if not (poses.moves[n] >> d) & 1:
                continue
            m = poses.place[poses.cell[n] + DY[d] * poses.columns + DX[d]]
            way = poses.q_rad[n] + np.linspace(0.0, 0.5, 20)[:, None] * (poses.q_rad[m] - poses.q_rad[n])
            joints = forward(arm, way)
            moved = np.hypot(*np.moveaxis(joints - joints[0], -1, 0)).max()
            assert moved <= poses.sway_cm[n] + 1e-9
            worst = max(worst, moved / poses.sway_cm[n])
    assert worst > 0.9  # and the bound is no more than it has to be


def test_moves_that_the_joints_cannot_make_in_a_sample_do_not_exist():
    scene = random_moving_scene(np.random.default_rng(5))
    slow = replace(scene, moving=replace(scene.moving, sample_s=0.05))
    free, bound = (build_moving_map(slow, "up", between=False, limited=limited) for limited in (False, True))
    assert np.bitwise_count(bound.poses.moves).sum() < np.bitwise_count(free.poses.moves).sum()
    joint = scene.joints[0]
    most = 0.999 * scene.motion.acceleration_share * joint.max_acceleration_rad_s2 * 0.05**2 / 6.0
    assert (free.poses.moves & ~bound.poses.moves).any()
    for n in np.flatnonzero(bound.poses.moves)[::50]:
        ends = bound.poses.q_rad[bound.poses.place[bound.poses.cell[n] + 1]] if bound.poses.moves[n] & 1 else None
        if ends is not None:
            assert np.abs(ends - bound.poses.q_rad[n]).max() <= most


def test_planes_of_bits_are_the_booleans_they_came_from():
    nodes = np.random.default_rng(0).random((7, 201)) < 0.5
    assert (unpacked(packed(nodes), 201) == nodes).all()


def test_points_off_the_nodes_have_no_cell():
    moving = build_moving_map(random_moving_scene(np.random.default_rng(0)), "up", between=False)
    assert moving.tip_cm(moving.cell_at((4.0, -6.0))) == (4.0, -6.0)
    assert moving.cell_at((4.5, -6.0)) == -1
    assert moving.cell_at((400.0, 0.0)) == -1


def test_a_scene_without_the_table_has_no_moving_map():
    scene = replace(random_moving_scene(np.random.default_rng(0)), moving=None)
    with pytest.raises(SceneError, match=r"moving: missing: write a table \[moving\]"):
        build_moving_map(scene, "up")
