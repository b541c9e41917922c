"""Ways made shorter: never dearer, free, with the same ends, and the cheapest of all that the candidates allow."""

from itertools import combinations, pairwise

import numpy as np
import pytest

from planarm.dynamics.energy import edge_costs
from planarm.experiments.mpdstar_scenes import bench_scene
from planarm.model.arm import Arm
from planarm.model.collision import pose_clearance_cm
from planarm.model.kinematics import forward
from planarm.roadmap.graph import KINDS, Roadmap
from planarm.roadmap.moves import are_free
from planarm.roadmap.planning import cost_of, joint_route_of, shorter_way
from planarm.roadmap.shortening import cheapest_through, with_points_between
from planarm.search.incremental import GraphPlanner


def roadmap_of(cost, links):
    scene = bench_scene(800, cost, links=links)
    return scene, Roadmap.of(scene, scene.margin_cm)


def answers(roadmap, count, least=6, seed=1):
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        ends = tuple(int(n) for n in rng.integers(0, len(roadmap.poses_rad), 2))
        answer = GraphPlanner(roadmap.graph, roadmap.bounds(), ends, "roadmap_a_star", roadmap.cost_into).solve()
        if len(answer.nodes) >= least:
            found.append(answer)
    return found


@pytest.mark.parametrize(("cost", "links"), [("consumed", 2), ("time", 2), ("travel", 3), ("stepper", 3)])
def test_a_shorter_way_costs_no_more_and_is_free(cost, links):
    scene, roadmap = roadmap_of(cost, links)
    shares = []
    for answer in answers(roadmap, 12):
        old = roadmap.poses_rad[answer.nodes]
        poses, found = shorter_way(roadmap, roadmap.world, old, answer.cost)
        assert (poses[[0, -1]] == old[[0, -1]]).all()
        assert found == pytest.approx(cost_of(roadmap, poses), rel=1e-9)
        assert found <= answer.cost * (1.0 + 1e-12)
        shares.append(found / answer.cost)
        for a, b in pairwise(poses):
            for share in np.linspace(0.0, 1.0, 60):
                clear_cm = pose_clearance_cm(Arm.from_spec(scene.arm), a + share * (b - a), roadmap.world.obstacles)
                assert clear_cm >= scene.margin_cm - 1e-9
    assert np.median(shares) < 0.97


def test_the_cheapest_way_through_some_of_its_poses_is_found():
    """Against all ways through any of them."""
    _, roadmap = roadmap_of("time", 2)
    kind = KINDS["time"]
    for answer in answers(roadmap, 6, least=5):
        poses = np.ascontiguousarray(roadmap.poses_rad[answer.nodes[:9]])
        count = len(poses)
        pairs = np.array(list(combinations(range(count), 2)))
        free = are_free(roadmap.world, poses, pairs, np.arange(len(pairs)))
        open_to = {tuple(pair) for pair, is_free in zip(pairs.tolist(), free, strict=True) if is_free}
        least = np.inf
        for size in range(count - 1):
            for inner in combinations(range(1, count - 1), size):
                steps = list(pairwise((0, *inner, count - 1)))
                if all(step in open_to or step[1] == step[0] + 1 for step in steps):
                    least = min(least, sum(edge_costs(roadmap.model, kind, poses[i], poses[j])[0] for i, j in steps))
        kept, found = cheapest_through(roadmap.world, roadmap.model, kind, poses)
        assert found == pytest.approx(least, rel=1e-12)
        assert (kept[0], kept[-1]) == (0, count - 1)


def test_points_between_are_on_the_way():
    poses = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 6.0]])
    made = with_points_between(poses)
    assert made.tolist() == [[0, 0], [1, 0], [2, 0], [3, 0], [3, 2], [3, 4], [3, 6]]


def test_a_plan_s_route_is_made_shorter():
    scene, roadmap = roadmap_of("consumed", 2)
    (answer,) = answers(roadmap, 1)
    route = joint_route_of(scene, roadmap, answer)
    assert route.cost < answer.cost
    assert route.bound <= route.cost
    assert len(route.poses_rad) < len(answer.nodes)
    tips = forward(Arm.from_spec(scene.arm), route.poses_rad[[0, -1]])[:, -1]
    assert tips == pytest.approx(forward(Arm.from_spec(scene.arm), roadmap.poses_rad[answer.nodes[[0, -1]]])[:, -1])
