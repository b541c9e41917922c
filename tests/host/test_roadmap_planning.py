"""A roadmap's way as a route: to a certified plan and to the emulated Uno, or to the error that tells why."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from planarm.dynamics.energy import edge_energy
from planarm.errors import NoPathError, SceneError
from planarm.experiments.mpdstar_scenes import case_scene
from planarm.operations.replanning import first_plan
from planarm.pipeline import plan_scene, run_scene
from planarm.roadmap.graph import Roadmap
from planarm.roadmap.moves import PARTS, all_free, are_free
from planarm.roadmap.planning import RoadmapTask, ends_rad, way_energy_j
from planarm.scene import Obstacle, load_scene
from planarm.search.incremental import GraphPlanner
from planarm.workspace.joint_proof import joint_world, pose_spare_cm, prove_joint_line
from planarm.workspace.proof import PROVED

EXAMPLE = load_scene(Path(__file__).parents[2] / "examples" / "energy_two_links.toml")
SMALL = replace(EXAMPLE, roadmap=replace(EXAMPLE.roadmap, nodes=300))


def no_notice(_stage, _share):
    pass


@pytest.mark.parametrize("algorithm", ["mpd_star_lite", "d_star_lite", "roadmap_a_star"])
def test_a_plan_on_a_roadmap_is_certified_and_its_moves_are_free(algorithm):
    plan = plan_scene(replace(SMALL, planner=replace(SMALL.planner, algorithm=algorithm)), no_notice)
    assert plan.certificate.ok
    assert plan.joint is not None
    poses = plan.joint.poses_rad
    assert poses[[0, -1]] == pytest.approx(np.array([SMALL.task.start_rad, SMALL.task.goal_rad]))
    assert all(prove_joint_line(joint_world(SMALL), a, b)[0] == PROVED for a, b in pairwise(poses))
    assert plan.joint.objective == "energy consumed"
    assert 0.0 <= plan.joint.bound <= plan.joint.cost


def test_the_roadmap_and_the_plan_tell_how_far_they_are():
    """The shares rise and end at 1, with many between where the roadmap is built; for `replan`, too."""
    shares = []
    RoadmapTask.of(SMALL, SMALL.margin_cm, shares.append)
    assert shares == pytest.approx([k / PARTS for k in range(1, PARTS + 1)])
    for planned in (plan_scene, first_plan):
        told = []
        planned(SMALL, lambda stage, share, told=told: told.append((stage, share)))
        shares = [share for stage, share in told if stage == "plan"]
        assert shares == sorted(shares)
        assert shares[-1] == 1.0
        assert len([share for share in shares if 0.0 < share < 0.4]) == PARTS - 1


def test_a_roadmap_that_is_built_in_parts_is_the_same():
    world, poses = joint_world(SMALL), np.random.default_rng(3).uniform(-2.0, 2.0, (60, 2))
    for count in (0, 1, PARTS - 1, 150):
        pairs = np.random.default_rng(count).integers(0, 60, (count, 2))
        assert np.array_equal(all_free(world, poses, pairs), are_free(world, poses, pairs, np.arange(count)))


def test_a_plan_on_a_roadmap_runs_on_the_emulated_uno(tmp_path):
    x, y = 30 * np.cos(0.5) + 20 * np.cos(0.9), 30 * np.sin(0.5) + 20 * np.sin(0.9)
    near = replace(SMALL.task, goal_rad=(0.5, 0.4), goal_cm=(float(x), float(y)))
    summary = run_scene(replace(SMALL, task=near, obstacles=()), "sim://", tmp_path, no_notice)
    assert summary["arm_clean"] is True
    assert summary["max_step_timing_error_ticks"] == 0
    assert summary["net_usteps"] == summary["net_usteps_by_ledger"]


def test_the_three_planners_find_ways_of_the_same_energy():
    costs = []
    for algorithm in ("mpd_star_lite", "d_star_lite", "roadmap_a_star"):
        task = RoadmapTask.of(replace(SMALL, planner=replace(SMALL.planner, algorithm=algorithm)), SMALL.margin_cm)
        answer = task.planner.solve()
        costs.append(answer.cost)
        assert answer.cost == pytest.approx(way_energy_j(task.roadmap, answer.nodes).sum())
    assert costs == pytest.approx([costs[0]] * 3)


def test_a_way_s_energy_is_the_sum_of_its_edges():
    task = RoadmapTask.of(SMALL, SMALL.margin_cm)
    nodes = task.planner.solve().nodes
    poses = task.roadmap.poses_rad[nodes]
    wanted = sum(edge_energy(task.roadmap.model, poses[k], poses[k + 1])[0] for k in range(len(nodes) - 1))
    assert way_energy_j(task.roadmap, nodes) == pytest.approx(wanted)


def test_the_least_energy_is_not_the_least_travel():
    """Two costs, one graph: each way is best by its own cost, and the other's way is no better."""
    by_energy = RoadmapTask.of(SMALL, SMALL.margin_cm)
    travel = replace(SMALL, roadmap=replace(SMALL.roadmap, cost="travel"))
    by_travel = RoadmapTask.of(travel, SMALL.margin_cm)
    ways = [one.planner.solve().nodes for one in (by_energy, by_travel)]
    energies = [float(way_energy_j(by_energy.roadmap, way).sum()) for way in ways]
    travels = [float(np.linalg.norm(np.diff(by_energy.roadmap.poses_rad[way], axis=0), axis=1).sum()) for way in ways]
    assert energies[0] < energies[1]
    assert travels[1] < travels[0]


def test_points_become_the_free_poses_with_the_least_travel():
    task = replace(SMALL.task, start_rad=None, goal_rad=None)
    world = joint_world(SMALL)
    start, goal = ends_rad(replace(SMALL, task=task), world)
    for pose, point in ((start, task.start_cm), (goal, task.goal_cm)):
        heading = np.cumsum(pose)
        assert (30 * np.cos(heading[0]) + 20 * np.cos(heading[1])) == pytest.approx(point[0])
        assert (30 * np.sin(heading[0]) + 20 * np.sin(heading[1])) == pytest.approx(point[1])
        assert pose_spare_cm(world, pose) > 0.0
    assert np.linalg.norm(goal - start) <= np.linalg.norm(np.subtract(SMALL.task.goal_rad, SMALL.task.start_rad)) + 1e-9


def test_an_end_that_is_not_free_is_named():
    with pytest.raises(SceneError, match=r"nearer than 1 cm to an obstacle") as caught:
        RoadmapTask.of(replace(SMALL, obstacles=(Obstacle("circle", (40.0, 17.0), 5.0),)), 1.0)
    assert caught.value.key == "task.start_deg"
    far = replace(SMALL.task, goal_rad=None, goal_cm=(54.0, 54.0))
    with pytest.raises(SceneError, match="out of reach") as caught:
        RoadmapTask.of(replace(SMALL, task=far), 1.0)
    assert caught.value.key == "task.goal_cm"


def test_a_wall_between_start_and_goal_leaves_no_way():
    walls = tuple(
        Obstacle("polygon", vertices_cm=((x - 1, y), (x + 1, y), (x + 1, y + 54), (x - 1, y + 54)))
        for x, y in ((15.0, -57.0), (15.0, 3.0))
    )
    task = replace(SMALL.task, start_rad=(0.0, 0.0), start_cm=(50.0, 0.0), goal_rad=(np.pi, 0.0), goal_cm=(-50.0, 0.0))
    with pytest.raises(NoPathError, match="no way on the roadmap joins start and goal: 302 configurations") as caught:
        plan_scene(replace(SMALL, task=task, obstacles=walls), no_notice)
    assert caught.value.advice


def test_an_arm_with_more_joints_than_any_board_is_searched_but_not_run():
    scene = case_scene(3)
    assert len(scene.joints) == 7
    assert len(RoadmapTask.of(scene, scene.margin_cm).planner.solve().nodes) > 1
    with pytest.raises(SceneError, match=r"7 joints; the wiring own has pins for 4 \(board.wiring\)") as caught:
        plan_scene(scene, no_notice)
    assert caught.value.key == "arm.link_lengths_cm"


def test_costs_that_nobody_tells_are_an_error():
    roadmap = Roadmap.of(SMALL, SMALL.margin_cm)
    with pytest.raises(ValueError, match="is not known"):
        GraphPlanner(roadmap.graph, roadmap.bounds(), (0, 1), "mpd_star_lite").solve()
