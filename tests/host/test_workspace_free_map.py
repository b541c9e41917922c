"""The free map: the reconstruction's counts, the regions, and shapely as the oracle of every node."""

from math import acos, pi, radians, sqrt
from pathlib import Path

import numpy as np
import pytest

from host_scenes import FULL_TURN, make_scene, oracle_clearance_cm, random_obstacles
from planarm.errors import SceneError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.scene import Obstacle, load_scene
from planarm.workspace.free_map import BLOCKED_CELL, MIXED, WHOLE, build_free_map
from planarm.workspace.world import BEYOND_REACH, FREE, INNER_HOLE, LIMIT, OBSTACLE, build_world, clearances_cm

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
INNER_20_CM = ((radians(-90), radians(270)), (-acos(-0.75), acos(-0.75)))  # |theta2| at r = 20 for 30 + 20 cm


def poses(scene, free_map):
    """Joint angles at the nodes, NaN out of reach: shape [iy, ix, 2]."""
    return inverse_2r(Arm.from_spec(scene.arm), np.dstack(np.meshgrid(free_map.x_cm, free_map.y_cm)), scene.arm.elbow)


@pytest.mark.parametrize(("case", "free"), [(1, 2129), (2, 2708)])
def test_the_reconstruction_of_table_1_has_its_free_cells(case, free):
    """The counts of the reconstruction behind Table II's A* lengths: nodes on whole cm, margin 0.4 cm."""
    free_map = build_free_map(load_scene(EXAMPLES / f"table1_case{case}.toml"))
    assert free_map.margin_cm == 0.4
    assert free_map.region.shape == (51, 101)
    assert free_map.free_nodes == free


def test_nodes_lie_on_multiples_of_the_cell_whatever_the_workspace():
    free_map = build_free_map(make_scene(x=(-1.05, 0.95), y=(20.0, 20.61), cell=0.3))
    assert free_map.x_cm == pytest.approx([-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9])
    assert free_map.y_cm == pytest.approx([20.1, 20.4])


@pytest.mark.parametrize("elbow", ["up", "down"])
@pytest.mark.parametrize("seed", range(3))
def test_every_node_against_shapely(elbow, seed):
    rng = np.random.default_rng(seed)
    base = (float(rng.uniform(-3, 3)), float(rng.uniform(-3, 3)))
    scene = make_scene(random_obstacles(rng, 4), elbow=elbow, base=base, cell=4.0, limits=INNER_20_CM)
    arm = Arm.from_spec(scene.arm)
    free_map = build_free_map(scene)
    seen = set()
    for iy, y in enumerate(free_map.y_cm):
        for ix, x in enumerate(free_map.x_cm):
            r = np.hypot(x - base[0], y - base[1])
            region = free_map.region[iy, ix]
            seen.add(int(region))
            if not 20.0 <= r <= 50.0:
                assert region == (INNER_HOLE if r < 20.0 else BEYOND_REACH)
                continue
            q = inverse_2r(arm, (x, y), elbow)
            assert forward(arm, q)[-1] == pytest.approx((x, y), abs=1e-6)
            assert (q[1] <= 0) == (elbow == "up")
            clearance = oracle_clearance_cm(scene, arm, q)
            assert region == (FREE if clearance > scene.margin_cm else OBSTACLE)
    assert seen == {FREE, BEYOND_REACH, INNER_HOLE, OBSTACLE}


@pytest.mark.parametrize("elbow", ["up", "down"])
@pytest.mark.parametrize("limits", [FULL_TURN, INNER_20_CM])
def test_cells_free_as_a_whole_hold_no_pose_that_is_not_free(elbow, limits):
    rng = np.random.default_rng(7)
    scene = make_scene(random_obstacles(rng, 3), elbow=elbow, limits=limits, cell=1.0, y=(-20.0, 50.0))
    free_map, world = build_free_map(scene), build_world(scene)
    assert np.all(free_map.region[free_map.whole] == FREE)
    at = np.argwhere(free_map.whole)
    tips = np.column_stack([free_map.x_cm[at[:, 1]], free_map.y_cm[at[:, 0]]])
    l1, l2 = scene.arm.link_lengths_cm
    for dx, dy in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), *rng.uniform(-0.5, 0.5, (20, 2))]:
        corner = tips + np.array([dx, dy])
        r = np.linalg.norm(corner, axis=1)
        assert r.min() >= world.arm.r_min_cm
        assert r.max() <= world.arm.r_max_cm
        theta2 = np.arccos((r**2 - l1**2 - l2**2) / (2 * l1 * l2)) * (-1 if elbow == "up" else 1)
        psi = np.arctan2(l2 * np.sin(theta2), l1 + l2 * np.cos(theta2))
        q = np.column_stack([np.arctan2(corner[:, 1], corner[:, 0]) - psi, theta2])
        assert clearances_cm(world, q).min() > scene.margin_cm
    assert free_map.whole.sum() > 0.6 * free_map.free_nodes


def test_three_values_for_cells():
    free_map = build_free_map(load_scene(EXAMPLES / "table1_case1.toml"))
    assert np.array_equal(free_map.cells == WHOLE, free_map.whole)
    assert np.array_equal(free_map.cells == BLOCKED_CELL, free_map.region != FREE)
    assert np.array_equal(free_map.cells == MIXED, (free_map.region == FREE) & ~free_map.whole)
    assert all((free_map.cells == value).any() for value in (WHOLE, MIXED, BLOCKED_CELL))


def test_the_margin_can_only_take_nodes_away():
    scene = load_scene(EXAMPLES / "table1_case2.toml")
    wide, narrow = build_free_map(scene, 1.5), build_free_map(scene, 0.4)
    assert np.all((wide.region != FREE) | (narrow.region == FREE))
    assert wide.free_nodes < narrow.free_nodes


def test_a_limit_of_joint_1_forbids_by_itself():
    narrow = ((radians(10), radians(100)), FULL_TURN[1])
    scene = make_scene(limits=narrow)
    free_map = build_free_map(scene)
    theta1 = poses(scene, free_map)[..., 0]
    reached = ~np.isnan(theta1)
    within = (theta1 >= narrow[0][0]) & (theta1 <= narrow[0][1])
    assert np.array_equal(free_map.region == LIMIT, reached & ~within)
    assert np.array_equal(free_map.region == FREE, reached & within)


def test_limits_of_joint_2_are_tip_distances():
    free_map = build_free_map(make_scene(elbow="down", limits=(FULL_TURN[0], (radians(30), radians(120)))))
    x, y = np.meshgrid(free_map.x_cm, free_map.y_cm)
    r = np.hypot(x, y)
    nearest, farthest = sqrt(1300 - 600), sqrt(1300 + 600 * sqrt(3))  # law of cosines at 120 and 30 degrees
    assert np.array_equal(free_map.region == INNER_HOLE, r < nearest)
    assert np.array_equal(free_map.region == LIMIT, (r > farthest) & (r <= 50.0))
    assert np.array_equal(free_map.region == BEYOND_REACH, r > 50.0)


def test_the_floor_keeps_elbow_and_tip_above_it():
    scene = make_scene(floor=True, y=(0.0, 50.0))
    arm, free_map = Arm.from_spec(scene.arm), build_free_map(scene)
    q = poses(scene, free_map)
    reached = ~np.isnan(q[..., 0])
    heights = forward(arm, q[reached])[:, 1:, 1].min(axis=1)
    assert np.array_equal(free_map.region[reached] == LIMIT, heights <= 0.4)


def test_clearances_of_poses_against_shapely():
    rng = np.random.default_rng(3)
    scene = make_scene(random_obstacles(rng, 5))
    arm, world = Arm.from_spec(scene.arm), build_world(scene)
    q = rng.uniform(-pi, pi, (200, 2))
    expected = [oracle_clearance_cm(scene, arm, pose) for pose in q]
    assert clearances_cm(world, q) == pytest.approx(expected, abs=1e-9)


def test_equal_links_have_a_singular_point_instead_of_a_hole():
    free_map = build_free_map(make_scene(links=(20.0, 20.0)))
    assert np.count_nonzero(free_map.region == INNER_HOLE) == 1
    assert free_map.region[50, 50] == INNER_HOLE


def test_the_map_cannot_be_written_to():
    free_map = build_free_map(make_scene())
    with pytest.raises(ValueError, match="read-only"):
        free_map.region[0, 0] = FREE


def test_either_elbow_asks_for_a_side():
    scene = make_scene(elbow="either")
    with pytest.raises(SceneError, match=r"arm\.elbow"):
        build_free_map(scene)
    assert [build_free_map(scene, elbow=side).elbow for side in ("up", "down")] == ["up", "down"]


def test_limits_without_a_pose_on_the_elbow_side_are_a_scene_error():
    scene = make_scene([Obstacle("circle", (30.0, 0.0), 2.0)], limits=(FULL_TURN[0], (0.1, 1.0)), elbow="up")
    with pytest.raises(SceneError, match="no pose has its elbow 'up'"):
        build_free_map(scene)


@pytest.mark.parametrize("seed", range(12))
def test_blocks_judged_at_once_agree_with_single_poses(seed):
    """Every node of random maps on fine cells, where most cells are settled in large blocks, against single poses."""
    rng = np.random.default_rng(seed)
    elbow, cell = str(rng.choice(["up", "down"])), float(rng.choice([0.2, 0.5, 1.0]))
    limits1 = FULL_TURN[0] if seed % 3 else (float(rng.uniform(-1.5, 0.5)), float(rng.uniform(1.0, 4.0)))
    limits2 = FULL_TURN[1] if seed % 2 else (-2.2, 2.2)
    base = tuple(float(v) for v in rng.uniform(-4.0, 4.0, 2))
    floor, base = seed % 4 == 1, (base[0], abs(base[1]))
    scene = make_scene(
        random_obstacles(rng, int(rng.integers(1, 12))),
        elbow=elbow,
        limits=(limits1, limits2),
        base=base,
        floor=floor,
        cell=cell,
        x=(-52.0, 40.0),
        y=(-30.0, 52.0),
    )
    free_map, world = build_free_map(scene), build_world(scene)
    q = poses(scene, free_map)
    x, y = np.meshgrid(free_map.x_cm, free_map.y_cm)
    r = np.hypot(x - base[0], y - base[1])
    inside = (r >= world.arm.r_min_cm) & (r <= world.arm.r_max_cm)
    clearance = np.full(r.shape, -np.inf)
    clearance[inside] = clearances_cm(world, q[inside])  # floor included
    joint1 = (q[..., 0] >= limits1[0]) & (q[..., 0] <= limits1[1])
    expected = inside & joint1 & (clearance > scene.margin_cm)
    unclear = np.abs(clearance - scene.margin_cm) < 1e-9
    assert np.array_equal((free_map.region == FREE)[~unclear], expected[~unclear])
    assert np.array_equal((free_map.region == INNER_HOLE), r < world.arm.r_min_cm - 1e-9)
    assert np.array_equal((free_map.region == BEYOND_REACH), r > world.arm.reach_cm + 1e-9)
    above = forward(Arm.from_spec(scene.arm), q[inside])[:, 1:, 1].min(axis=1) if floor else np.inf
    no_limit = joint1[inside] & (above > scene.margin_cm)
    assert np.array_equal((free_map.region == OBSTACLE)[inside], (no_limit & ~expected[inside]))


def test_a_thousand_obstacles_are_judged_like_one_by_one():
    """Small circles outside and inside reach: blocks forget most of them, and no node notices."""
    rng = np.random.default_rng(5)
    angle, distance = rng.uniform(0.0, 2.0 * pi, 1000), rng.uniform(36.0, 75.0, 1000)
    centers = np.column_stack([distance * np.cos(angle), distance * np.sin(angle)])
    scene = make_scene([Obstacle("circle", (float(x), float(y)), 0.3) for x, y in centers], width=0.2)
    free_map, world = build_free_map(scene), build_world(scene)
    q = poses(scene, free_map)
    reached = ~np.isnan(q[..., 0])
    clearance = clearances_cm(world, q[reached])
    assert np.array_equal((free_map.region == FREE)[reached], clearance > scene.margin_cm)
    assert 0.05 < np.mean(clearance <= scene.margin_cm) < 0.6


def test_a_map_of_nodes_alone_has_the_same_nodes():
    for case in (1, 2):
        scene = load_scene(EXAMPLES / f"table1_case{case}.toml")
        both, alone = build_free_map(scene), build_free_map(scene, whole_cells=False)
        assert np.array_equal(both.region, alone.region)
        assert both.whole.any() and not alone.whole.any()
