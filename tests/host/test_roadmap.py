"""Roadmaps: free configurations, moves against dense sampling, the index against checking everything, costs, bounds."""

import numpy as np
import pytest
from scipy.stats import qmc

from planarm.dynamics.energy import edge_costs
from planarm.errors import NoPathError
from planarm.model.arm import Arm
from planarm.model.collision import pose_clearance_cm
from planarm.model.shapes import Circle, Polygon, obstacle_set, shape_of
from planarm.roadmap.graph import KINDS, Roadmap
from planarm.roadmap.moves import are_free, nearest_pairs
from planarm.roadmap.recheck import all_ends_cm, touched_moves
from planarm.roadmap.sampling import free_poses, in_memory_order
from planarm.roadmap.swept import SweptCells
from planarm.scene import parse_scene
from planarm.search.digraph import BELOW_ONE, bound
from planarm.search.incremental import GraphPlanner, landmarks
from planarm.workspace.joint_proof import SMALLEST_CM, joint_world, pose_spare_cm

LENGTHS = {2: [30, 20], 3: [20, 18, 12], 4: [15, 14, 12, 9], 7: [6, 6, 6, 6, 6, 6, 14]}


def scene_of(links=2, cost="consumed", nodes=300, floor="false", extra=""):
    zeros = [0] * links
    return parse_scene(
        f"""
[arm]
link_lengths_cm = {LENGTHS[links]}
link_width_cm = 2
elbow = "either"
floor = {floor}
base_cm = [0, 2]
[workspace]
x_cm = [-60, 60]
y_cm = [-60, 60]
[planner]
algorithm = "mpd_star_lite"
seed = 3
[roadmap]
nodes = {nodes}
cost = "{cost}"
[mechanics]
gravity = true
[task]
start_deg = {zeros}
goal_deg = {[90, *zeros[1:]]}
[[obstacles]]
shape = "circle"
center_cm = [-25, 20]
diameter_cm = 8
[[obstacles]]
shape = "polygon"
vertices_cm = [[20, -25], [34, -30], [26, -22], [30, -12]]
{extra}
"""
        + links * "[[joints]]\nmax_speed_deg_s = 120\nmax_acceleration_deg_s2 = 400\n",
        "roadmap.toml",
    )


def roadmap_of(links=2, **more):
    scene = scene_of(links, **more)
    return Roadmap.of(scene, scene.margin_cm)


def random_shape(rng, size=1.0):
    center = rng.uniform(-45.0, 45.0, 2)
    if rng.random() < 0.4:
        return Circle((float(center[0]), float(center[1])), size * float(rng.uniform(0.5, 6.0)))
    corners = int(rng.integers(3, 7))
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
    radii = size * rng.uniform(1.0, 7.0, corners)
    return Polygon(tuple(zip(*(center[:, None] + radii * np.array([np.cos(angles), np.sin(angles)])), strict=True)))


@pytest.mark.parametrize("sampling", ["random", "halton"])
def test_configurations_are_free_within_limits_and_the_seed_s(sampling):
    world = joint_world(scene_of(3))
    poses = free_poses(world, 500, sampling, 7)
    assert poses.shape == (500, 3)
    assert (poses >= world.low_rad).all()
    assert (poses <= world.high_rad).all()
    assert all(pose_spare_cm(world, pose) > 0.0 for pose in poses)
    assert (free_poses(world, 500, sampling, 7) == poses).all()
    assert (free_poses(world, 500, sampling, 8) != poses).any()
    assert (free_poses(world, 300, sampling, 7) == poses[:300]).all()


def test_the_low_discrepancy_sequence_is_more_even():
    world = joint_world(scene_of(3))._replace(obstacles=obstacle_set([]))
    told = {}
    for sampling in ("random", "halton"):
        poses = free_poses(world, 400, sampling, 1)
        told[sampling] = qmc.discrepancy((poses - world.low_rad) / (world.high_rad - world.low_rad))
    assert told["halton"] < 0.2 * told["random"]


def test_an_arm_that_is_never_free_is_an_error(monkeypatch):
    monkeypatch.setattr("planarm.roadmap.sampling.MOST_BATCHES", 3)
    with pytest.raises(NoPathError, match="0 of 12288 configurations drawn are free"):
        free_poses(joint_world(scene_of(2), margin_cm=100.0), 5, "halton", 1)


@pytest.mark.parametrize("links", [2, 3, 4, 7])
@pytest.mark.parametrize("floor", ["false", "true"])
def test_free_moves_are_free_at_every_pose_and_others_come_near(links, floor):
    """Against poses one by one, 400 a move, by the kinematics and distances that planning uses elsewhere."""
    scene = scene_of(links, floor=floor)
    world, arm = joint_world(scene), Arm.from_spec(scene.arm)
    obstacles = obstacle_set([shape_of(obstacle) for obstacle in scene.obstacles])
    rng = np.random.default_rng(links)
    starts = free_poses(world, 60, "random", 5)
    poses = np.concatenate([starts, starts + rng.normal(0.0, 0.4, starts.shape)])
    pairs = np.stack([np.arange(60), 60 + np.arange(60)], axis=1)
    told = are_free(world, poses, pairs, np.arange(60))
    assert 0 < told.sum() < 60
    for (i, j), free in zip(pairs, told, strict=True):
        spares = [pose_spare_cm(world, poses[i] + t * (poses[j] - poses[i])) for t in np.linspace(0.0, 1.0, 401)]
        assert free == (min(spares) > 0.0) or abs(min(spares)) < 0.05
        if free:
            assert min(spares) > 0.0
            assert pose_clearance_cm(arm, poses[j], obstacles) > scene.margin_cm
        elif min(spares) > SMALLEST_CM:
            steps = np.linalg.norm(np.diff(np.linspace(poses[i], poses[j], 401), axis=0), axis=1).max() * 50.0
            assert min(spares) <= steps + SMALLEST_CM  # a pose in between is blocked


def test_neighbours_are_the_nearest():
    world = joint_world(scene_of(3))
    poses = free_poses(world, 120, "random", 2)
    pairs = nearest_pairs(world, poses, 5)
    levers = np.array([50.0, 30.0, 12.0])
    apart = np.linalg.norm((poses[:, None] - poses[None]) * levers, axis=2)
    wanted = {tuple(sorted((i, int(j)))) for i in range(120) for j in np.argsort(apart[i])[1:6]}
    assert {tuple(map(int, pair)) for pair in pairs} == wanted


@pytest.mark.parametrize("links", [2, 3, 7])
def test_the_index_finds_every_move_that_an_obstacle_touches(links, sized):
    rng = np.random.default_rng(links)
    indexed, all_checked = roadmap_of(links), roadmap_of(links)
    swept = SweptCells.of(indexed.world, indexed.poses_rad, indexed.pairs)
    looked = 0
    for _ in range(sized(40, 1000)):
        shape, tolerance = random_shape(rng), float(rng.choice([0.0, 2.0]))
        ours, theirs = indexed.add_obstacle(shape, tolerance), all_checked.add_checking_all(shape, tolerance)
        assert sorted(ours[1].edges.tolist()) == sorted(theirs[1].edges.tolist())
        looked += len(swept.near(obstacle_set([shape]), indexed.world.margin_cm + tolerance))
        if rng.random() < 0.8:
            ours, theirs = indexed.remove_obstacle(ours[0]), all_checked.remove_obstacle(theirs[0])
            assert sorted(ours.edges.tolist()) == sorted(theirs.edges.tolist())
    assert looked < 0.5 * sized(40, 1000) * len(indexed.pairs)


@pytest.mark.parametrize("links", [2, 4])
def test_the_recheck_of_one_obstacle_judges_as_every_other_proof_of_moves(links, sized):
    roadmap, rng = roadmap_of(links), np.random.default_rng(11)
    every = np.arange(len(roadmap.pairs))
    ends = all_ends_cm(roadmap.world, roadmap.poses_rad)
    touched_once = 0
    for _ in range(sized(30, 500)):
        alone, margin = obstacle_set([random_shape(rng)]), float(rng.uniform(0.5, 3.0))
        world = roadmap.world._replace(obstacles=alone, margin_cm=margin)
        touched = touched_moves(roadmap.world, alone, margin, roadmap.poses_rad, ends, roadmap.pairs, every)
        assert set(touched) == set(np.flatnonzero(~are_free(world, roadmap.poses_rad, roadmap.pairs, every)))
        touched_once += len(touched) > 0
    assert touched_once > 10


def test_what_two_obstacles_block_opens_when_both_are_gone():
    roadmap = roadmap_of()
    roadmap.cost_all()
    before = roadmap.graph.cost.copy()
    first, blocked = roadmap.add_obstacle(Circle((30.0, 10.0), 5.0))
    roadmap.graph.cost[blocked.edges] = blocked.costs
    second, more = roadmap.add_obstacle(Circle((31.0, 12.0), 5.0))
    roadmap.graph.cost[more.edges] = more.costs
    assert len(blocked.edges) > 0
    assert not set(more.edges.tolist()) & set(blocked.edges.tolist())
    opened = roadmap.remove_obstacle(first)
    assert 0 < len(opened.edges) < len(blocked.edges)
    roadmap.graph.cost[opened.edges] = opened.costs
    opened = roadmap.remove_obstacle(second)
    roadmap.graph.cost[opened.edges] = opened.costs
    assert (roadmap.graph.cost == before).all()


@pytest.mark.parametrize("cost", ["consumed", "net", "stepper", "time", "travel"])
def test_costs_are_the_edges_own_and_bounds_hold_for_each(cost):
    roadmap = roadmap_of(3, cost=cost, nodes=150)
    bounds, graph = roadmap.bounds(), roadmap.graph
    roadmap.cost_into(5)
    known = ~np.isnan(graph.cost)
    assert set(np.flatnonzero(known)) == set(np.flatnonzero((graph.head == 5) | (graph.tail == 5)))
    roadmap.cost_all()
    for e in range(0, len(graph.cost), 7):
        a, b = roadmap.poses_rad[graph.tail[e]], roadmap.poses_rad[graph.head[e]]
        assert graph.cost[e] == pytest.approx(edge_costs(roadmap.model, KINDS[cost], a, b)[0], rel=1e-9)
        assert bound(bounds, graph.tail[e], graph.head[e]) <= graph.cost[e]
        for k in range(len(bounds.potentials)):
            rise = bounds.potentials[k, graph.head[e]] - bounds.potentials[k, graph.tail[e]]
            assert graph.cost[e] >= BELOW_ONE * rise
    assert (graph.cost > 0.0).all()


@pytest.mark.parametrize("cost", ["consumed", "net"])
def test_planners_agree_while_obstacles_come_and_go(cost, sized):
    """A*, D* Lite and MPD* Lite with potentials and with landmarks, costs asked for as they are needed."""
    names = ("roadmap_a_star", "d_star_lite", "mpd_star_lite", "mpd_star_lite")
    maps = [roadmap_of(2, cost=cost, nodes=sized(150, 1500)) for _ in names]
    maps[3].cost_all()
    bounds = [one.bounds() for one in maps]
    bounds[3] = bounds[3]._replace(potentials=landmarks(maps[3].graph, np.array([0, 1, 7])))
    planners = [GraphPlanner(one.graph, bounds[k], (0, 1), names[k], one.cost_into) for k, one in enumerate(maps)]
    rng, start, standing, answers = np.random.default_rng(1), 0, [], 0
    for _ in range(sized(25, 200)):
        found = [planner.solve() for planner in planners]
        assert [answer.cost for answer in found] == pytest.approx([found[0].cost] * len(names), rel=1e-9)
        answers += np.isfinite(found[0].cost)
        if len(found[0].nodes) > 2 and rng.random() < 0.5:
            start = int(found[0].nodes[1])
        shape = random_shape(rng, 0.4)
        gone = standing.pop(0) if len(standing) > 1 else None
        numbers = []
        for one, planner in zip(maps, planners, strict=True):
            planner.move_start(start)
            if gone is not None:
                planner.change(one.remove_obstacle(gone))
            number, changes = one.add_obstacle(shape)
            planner.change(changes)
            numbers.append(number)
        assert len(set(numbers)) == 1
        standing.append(numbers[0])
    assert answers > 5


@pytest.mark.parametrize("links", [2, 3])
def test_configurations_that_are_neighbours_lie_near_each_other_in_memory(links):
    roadmap = roadmap_of(links, nodes=600)
    shuffled = np.random.default_rng(1).permutation(roadmap.poses_rad)
    ordered = in_memory_order(roadmap.world, shuffled)
    assert sorted(map(tuple, ordered)) == sorted(map(tuple, shuffled))

    def apart(poses):
        pairs = nearest_pairs(roadmap.world, poses, 5)
        return float(np.median(pairs[:, 1] - pairs[:, 0]))

    assert apart(ordered) < 0.3 * apart(shuffled)
