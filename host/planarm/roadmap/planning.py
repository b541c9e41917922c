"""Planning on a roadmap as a scene says: its ends as configurations, the search, and the way that it finds."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planarm.dynamics.energy import edge_costs, edge_energy
from planarm.errors import NoPathError, SceneError
from planarm.model.arm import Arm
from planarm.model.kinematics import ElbowSide, inverse_2r
from planarm.roadmap.graph import KINDS, Roadmap
from planarm.roadmap.moves import are_free
from planarm.roadmap.shortening import ROUNDS, shortened
from planarm.scene import EdgeCost, Point, Scene
from planarm.search.digraph import bound
from planarm.search.incremental import GraphAlgorithm, GraphAnswer, GraphPlanner
from planarm.search.joint_space import JointRoute, made_route
from planarm.workspace.joint_proof import JointWorld, joint_world, pose_spare_cm
from planarm.workspace.world import elbow_sides

Floats = NDArray[np.float64]

OBJECTIVES: Final[dict[EdgeCost, str]] = {
    "consumed": "energy consumed",
    "net": "net energy",
    "stepper": "steppers' energy",
    "time": "time from node to node",
    "travel": "joint travel",
}

MOST_JOINED = 64
"""Nodes to which a configuration between the nodes is joined, at most."""
MOST_ASKED = 8
"""Of these that can be reached, how many are asked for their distance."""

START, GOAL = 0, 1
"""The nodes of a scene's ends."""


@dataclass(frozen=True, slots=True, eq=False)
class RoadmapTask:
    """A roadmap whose first two nodes are a scene's start and goal, and the planner on it."""

    roadmap: Roadmap
    planner: GraphPlanner

    @classmethod
    def of(cls, scene: Scene, margin_cm: float, told: Callable[[float], None] | None = None) -> "RoadmapTask":
        """Return what the scene describes; nothing is searched yet. `told` takes the share that is done, up to 1.

        Raises:
            SceneError: no allowed pose at start or goal is free.
            NoPathError: hardly any configuration is free.
        """
        ends = ends_rad(scene, joint_world(scene, margin_cm))
        roadmap = Roadmap.of(scene, margin_cm, ends, told)
        algorithm: GraphAlgorithm = scene.planner.algorithm  # type: ignore[assignment] # scenes on a roadmap name these
        planner = GraphPlanner(roadmap.graph, roadmap.bounds(), (START, GOAL), algorithm, roadmap.cost_into)
        return cls(roadmap, planner)

    def no_way(self, scene: Scene) -> NoPathError:
        """Return the error that tells that nothing joins start and goal."""
        roadmap = self.roadmap
        error = NoPathError(
            f"{scene.source}: no way on the roadmap joins start and goal: {len(roadmap.poses_rad)} configurations, "
            f"{len(roadmap.pairs)} free moves, {roadmap.world.margin_cm:.4g} cm kept"
        )
        error.advice = ("Raise roadmap.nodes or planner.neighbours; another planner.seed draws other configurations.",)
        return error


def joint_route_of(scene: Scene, roadmap: Roadmap, answer: GraphAnswer) -> JointRoute:
    """Return a way on a roadmap as a way in joint space, made shorter."""
    bounded = bound(roadmap.bounds(), int(answer.nodes[0]), int(answer.nodes[-1]))
    poses, cost = shorter_way(roadmap, roadmap.world, roadmap.poses_rad[answer.nodes], answer.cost)
    return made_route(scene, poses, OBJECTIVES[roadmap.cost], cost, bounded)


def shorter_way(
    roadmap: Roadmap, world: JointWorld, poses_rad: Floats, cost: float, rounds: int = ROUNDS
) -> tuple[Floats, float]:
    """Return a way on a roadmap with its detours taken out (`planarm.roadmap.shortening`), and what it costs.

    Args:
        roadmap: it.
        world: the arm among all obstacles.
        poses_rad: a way by free moves, shape (m, n).
        cost: what it costs.
        rounds: as there.
    """
    return shortened(world, roadmap.model, KINDS[roadmap.cost], poses_rad, cost, rounds)


def cost_of(roadmap: Roadmap, poses_rad: Floats) -> float:
    """Return what a way through configurations, shape (m, n), costs."""
    return sum(edge_costs(roadmap.model, KINDS[roadmap.cost], a, b)[0] for a, b in pairwise(poses_rad))


def ends_rad(scene: Scene, world: JointWorld) -> tuple[Floats, Floats]:
    """Return start and goal as configurations, each of shape (n,), free.

    A point of two links has a pose on each elbow side that the scene allows; of all pairs that are free the one with
    the least joint travel is taken.

    Raises:
        SceneError: no pose at an end is free.
    """
    task = scene.task
    choices: list[list[Floats]] = []
    for name, point, angles in (("start", task.start_cm, task.start_rad), ("goal", task.goal_cm, task.goal_rad)):
        poses = _poses_at(scene, point) if angles is None else [np.array(angles)]
        free = [pose for pose in poses if pose_spare_cm(world, pose) > 0.0]
        if not free:
            key = f"task.{name}_{'cm' if angles is None else 'deg'}"
            spare = max((pose_spare_cm(world, pose) for pose in poses), default=None)
            near = (
                f"a link's centre line is nearer than {world.margin_cm:.4g} cm to an obstacle or the floor, by "
                f"{-spare:.3f} cm at the least; move one of them"
                if spare is not None
                else "is out of reach or of arm.joint_limits_deg on the elbow side that arm.elbow allows"
            )
            raise SceneError(scene.source, key, near)
        choices.append(free)
    pairs = [(start, goal) for start, goal in product(*choices)]
    return min(pairs, key=lambda pair: float(np.linalg.norm(pair[1] - pair[0])))


def _poses_at(scene: Scene, point_cm: Point) -> list[Floats]:
    """Return the poses of two links with the tip at a point, within the joints' limits."""
    arm = Arm.from_spec(scene.arm)
    sides: tuple[ElbowSide, ...] = elbow_sides(scene.arm)
    low, high = np.array(arm.joint_limits_rad).T
    poses = [inverse_2r(arm, point_cm, side) for side in sides]
    return [pose for pose in poses if np.isfinite(pose).all() and (pose >= low).all() and (pose <= high).all()]


def way_from(task: RoadmapTask, world: JointWorld, pose_rad: Floats) -> tuple[Floats, float] | None:
    """Return the best way to the goal from a configuration that is no node: its poses, and what it costs.

    The configuration is joined with its nearest nodes by free moves, and the search is asked for the best of the ways
    that begin with one of these.

    Args:
        task: the roadmap with all obstacles that were added, and its planner.
        world: the arm among all obstacles.
        pose_rad: where the arm rests, shape (n,).

    Returns:
        None when it is not free, or no free move leads to a node that reaches the goal.
    """
    roadmap = task.roadmap
    if pose_spare_cm(world, pose_rad) <= 0.0:
        return None
    levers = np.cumsum(world.lengths_cm[::-1])[::-1]
    apart = np.linalg.norm((roadmap.poses_rad - pose_rad) * levers, axis=1)
    near = np.argsort(apart)[:MOST_JOINED]
    both = np.concatenate([pose_rad[None], roadmap.poses_rad[near]])
    pairs = np.stack([np.zeros(len(near), np.int64), 1 + np.arange(len(near))], axis=1)
    free = are_free(world, both, pairs, np.arange(len(near)))
    asked = near[free][:MOST_ASKED]
    if not len(asked):
        return None
    steps = [edge_costs(roadmap.model, KINDS[roadmap.cost], pose_rad, roadmap.poses_rad[node])[0] for node in asked]
    answer = task.planner.solve_from(asked, np.array(steps))
    if not len(answer.nodes):
        return None
    return np.concatenate([pose_rad[None], roadmap.poses_rad[answer.nodes]]), answer.cost


def ways_on(task: RoadmapTask, world: JointWorld, poses_rad: Floats) -> list[tuple[float, int, Floats]]:
    """Return ways to the goal that follow an old way for a while: from which of its configurations on, and how.

    Args:
        task: the roadmap with all obstacles that were added, and its planner.
        world: the arm among all obstacles.
        poses_rad: configurations on the old way, one after the other, shape (m, n); those that are no nodes are joined
            with their nearest ones.

    Returns:
        (cost from the first configuration, number k of the one at which the old way is left, the configurations from
        there to the goal), the cheapest first.
    """
    roadmap, found, along = task.roadmap, [], 0.0
    for k, pose in enumerate(poses_rad):
        if k:
            along += edge_costs(roadmap.model, KINDS[roadmap.cost], poses_rad[k - 1], pose)[0]
        nodes = np.flatnonzero((roadmap.poses_rad == pose).all(axis=1))
        if not len(nodes):
            way = way_from(task, world, pose)
            if way is not None:
                found.append((along + way[1], k, way[0]))
            continue
        task.planner.move_start(int(nodes[0]))
        answer = task.planner.solve()
        if len(answer.nodes):
            found.append((along + answer.cost, k, roadmap.poses_rad[answer.nodes]))
    return sorted(found, key=lambda one: one[0])


def way_energy_j(roadmap: Roadmap, nodes: NDArray[np.int64]) -> Floats:
    """Return the energy consumed on a way by each joint, in joules, shape (n,), resting at every node."""
    poses = roadmap.poses_rad[nodes]
    joints = poses.shape[1]
    return sum((edge_energy(roadmap.model, a, b)[0] for a, b in pairwise(poses)), np.zeros(joints))
