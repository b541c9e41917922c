"""The roadmap: configurations, free moves between them, what they cost, and obstacles that come and go.

A move between two configurations is two directed edges, 2 k and 2 k + 1: its energy differs with the direction. Costs
are computed when they are asked for, both directions at once, and kept; an edge that an obstacle blocks costs infinity.
"""

from collections.abc import Callable, Sequence
from math import sqrt
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from planarm.dynamics.dc_motor import DcMotors
from planarm.dynamics.energy import CONSUMED, NET, PEAK_SPEED, TIME, TRAVEL, EdgeModel, edge_costs
from planarm.dynamics.rigid_body import RigidBody, potential_energy_j
from planarm.model.shapes import Circle, Polygon, obstacle_set
from planarm.roadmap.moves import all_free, nearest_pairs
from planarm.roadmap.recheck import all_ends_cm, touched_moves
from planarm.roadmap.sampling import free_poses, in_memory_order
from planarm.roadmap.swept import SweptCells
from planarm.scene import EdgeCost, Scene
from planarm.search.digraph import UNKNOWN, Bounds, Digraph, digraph
from planarm.search.incremental import Changes
from planarm.workspace.joint_proof import JointWorld, joint_world
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

KINDS: Final[dict[EdgeCost, int]] = {
    "consumed": CONSUMED,
    "net": NET,
    "stepper": CONSUMED,
    "time": TIME,
    "travel": TRAVEL,
}


class Roadmap:
    """Nodes, moves and costs; obstacles besides the scene's may be added and removed."""

    def __init__(
        self,
        world: JointWorld,
        model: EdgeModel,
        cost: EdgeCost,
        poses_rad: Floats,
        neighbours: int,
        told: Callable[[float], None] | None = None,
    ) -> None:
        """Join each configuration with its nearest ones, by moves that are free.

        Args:
            world: the arm among its obstacles.
            model: the arm's masses and motors.
            cost: what a move costs.
            poses_rad: free configurations, shape (n, joints).
            neighbours: how many each is joined with, at least; near ones may be joined by the other's choice.
            told: takes the share of the moves that have been looked at, up to 1.
        """
        pairs = nearest_pairs(world, poses_rad, neighbours)
        free = all_free(world, poses_rad, pairs, told)
        self.world, self.model, self.cost, self.poses_rad = world, model, cost, poses_rad
        self.pairs: Ints = np.ascontiguousarray(pairs[free])
        """Free moves among the scene's obstacles, shape (m, 2)."""
        self.graph, self._edges = _directed(len(poses_rad), self.pairs)
        self._base: Floats = self.graph.cost.copy()
        """Costs without added obstacles, not a number where not asked for yet."""
        self._ends_cm = all_ends_cm(world, poses_rad)
        self._blockers: Ints = np.zeros(len(self.pairs), np.int64)
        self._blocked_by: dict[int, Ints] = {}
        self._added = 0
        self._swept: SweptCells | None = None

    @classmethod
    def of(
        cls,
        scene: Scene,
        margin_cm: float,
        ends_rad: Sequence[Floats] = (),
        told: Callable[[float], None] | None = None,
    ) -> Self:
        """Return the roadmap that a scene describes; the configurations of `ends_rad` are its first nodes.

        Large ones take a while: the share that is done goes to `told`, rising up to 1.

        Raises:
            NoPathError: hardly any configuration is free.
        """
        world, spec = joint_world(scene, margin_cm), scene.roadmap
        drawn = in_memory_order(world, free_poses(world, spec.nodes, spec.sampling, scene.planner.seed))
        poses = np.concatenate([np.array(ends_rad, np.float64).reshape(-1, drawn.shape[1]), drawn])
        return cls(world, edge_model(scene), spec.cost, poses, scene.planner.neighbours, told)

    # -- costs --------------------------------------------------------------------------------------------------------

    def cost_into(self, node: int) -> None:
        """Compute the costs, not known yet, of all edges into a node."""
        fill_into(self.model, KINDS[self.cost], self.poses_rad, self.graph, self._edges, self._base, node)

    def cost_all(self) -> None:
        """Compute all costs that are not known yet."""
        every = np.arange(len(self.pairs))
        fill_moves(self.model, KINDS[self.cost], self.poses_rad, self.pairs, self._edges, self._base, every)
        unknown = np.isnan(self.graph.cost)
        self.graph.cost[unknown] = self._base[unknown]

    def bounds(self) -> Bounds:
        """Return lower bounds of distances that hold whatever obstacles come and go.

        Energy consumed: the difference of potential energy, and for steppers the holding power over the least time.
        """
        nodes, joints = self.poses_rad.shape
        if self.cost == "travel":
            return Bounds(np.empty((0, nodes)), self.poses_rad)
        if self.cost == "net":
            return Bounds.none(nodes)
        # The least time is that of the slowest joint; the straight line over sqrt(n) is never longer.
        in_time = self.poses_rad * (PEAK_SPEED / (self.model.speed_rad_s * sqrt(joints)))
        if self.cost == "time":
            return Bounds(np.empty((0, nodes)), in_time if self.model.edge_s == 0.0 else np.empty((nodes, 0)))
        heights = heights_j(self.model, self.poses_rad)[None]
        hold_w = float(self.model.hold_w.sum())
        held = hold_w > 0.0 and self.model.edge_s == 0.0
        return Bounds(heights, in_time * hold_w if held else np.empty((nodes, 0)))

    # -- obstacles ----------------------------------------------------------------------------------------------------

    def add_obstacle(self, shape: Circle | Polygon, tolerance_cm: float = 0.0) -> tuple[int, Changes]:
        """Block the moves that an obstacle touches; only those that sweep cells near it are checked again.

        Args:
            shape: the obstacle.
            tolerance_cm: distance to keep from it beyond the roadmap's margin (paper A's "no enter" zones).

        Returns:
            A number by which it is removed, and the new costs, for `GraphPlanner.change`.
        """
        if self._swept is None:
            self._swept = SweptCells.of(self.world, self.poses_rad, self.pairs)
        obstacles, margin = obstacle_set([shape]), self.world.margin_cm + tolerance_cm
        return self._block(shape, tolerance_cm, self._swept.near(obstacles, margin))

    def add_checking_all(self, shape: Circle | Polygon, tolerance_cm: float = 0.0) -> tuple[int, Changes]:
        """Do what `add_obstacle` does by checking every move: the yardstick, and the oracle, of the index."""
        return self._block(shape, tolerance_cm, np.arange(len(self.pairs)))

    def remove_obstacle(self, number: int) -> Changes:
        """Open the moves that this obstacle alone blocked; return their costs."""
        moves = self._blocked_by.pop(number)
        self._blockers[moves] -= 1
        opened = moves[self._blockers[moves] == 0]
        fill_moves(self.model, KINDS[self.cost], self.poses_rad, self.pairs, self._edges, self._base, opened)
        edges = self._edges.there_and_back(opened)
        return Changes(edges, self._base[edges])

    def prepare(self) -> None:
        """Do now what the first obstacle would otherwise wait for: list the cells that each move sweeps."""
        self._swept = self._swept or SweptCells.of(self.world, self.poses_rad, self.pairs)

    def _block(self, shape: Circle | Polygon, tolerance_cm: float, moves: Ints) -> tuple[int, Changes]:
        margin = self.world.margin_cm + tolerance_cm
        obstacle = obstacle_set([shape])
        touched = touched_moves(self.world, obstacle, margin, self.poses_rad, self._ends_cm, self.pairs, moves)
        self._added += 1
        self._blocked_by[self._added] = touched
        edges = block(self._blockers, self._edges.of_move, touched)
        return self._added, Changes(edges, np.full(len(edges), np.inf))


def edge_model(scene: Scene) -> EdgeModel:
    """Return the masses and motors by which the scene's moves are costed."""
    body, edge_s = RigidBody.of(scene), scene.roadmap.edge_s
    if scene.roadmap.cost == "stepper":
        return EdgeModel.stepper(body, scene, edge_s)
    return EdgeModel.dc(body, DcMotors.of(scene), scene, edge_s)


class MoveEdges(NamedTuple):
    """Which edges of the graph are which moves."""

    of_move: Ints
    """Each move's edges, there and back; shape (m, 2)."""
    back: Ints
    """Each edge's other way round; shape (2 m,)."""

    def there_and_back(self, moves: Ints) -> Ints:
        """Return the directed edges of moves."""
        return self.of_move[moves].ravel()


def _directed(nodes: int, pairs: Ints) -> tuple[Digraph, MoveEdges]:
    """Return the graph of moves both ways, its edges numbered by head: a search looks at edges into one node."""
    tails, heads = pairs.ravel(), pairs[:, ::-1].ravel()
    order = np.lexsort((tails, heads))
    number = np.empty(len(order), np.int64)
    number[order] = np.arange(len(order))
    of_move = number.reshape(-1, 2)
    back = np.empty(len(order), np.int64)
    back[of_move.ravel()] = of_move[:, ::-1].ravel()
    return digraph(nodes, tails[order], heads[order], np.full(len(order), UNKNOWN)), MoveEdges(of_move, back)


@kernel
def block(blockers: Ints, of_move: Ints, moves: Ints) -> NDArray[np.int64]:
    """Count one more blocker of each of these moves; return the directed edges of those that had none."""
    edges, count = np.empty(2 * moves.shape[0], np.int64), 0
    for m in moves:
        blockers[m] += 1
        if blockers[m] == 1:
            edges[count], edges[count + 1] = of_move[m, 0], of_move[m, 1]
            count += 2
    return edges[:count]


@kernel
def fill_into(
    model: EdgeModel, kind: int, poses_rad: Floats, graph: Digraph, edges: MoveEdges, base: Floats, node: int
) -> None:
    """Compute the unknown costs of edges into a node, and those of their twins."""
    for k in range(graph.in_first[node], graph.in_first[node + 1]):
        e = graph.in_edge[k]
        if np.isnan(graph.cost[e]):
            twin = edges.back[e]
            forth, back = edge_costs(model, kind, poses_rad[graph.tail[e]], poses_rad[node])
            base[e], base[twin] = forth, back
            graph.cost[e] = forth
            if np.isnan(graph.cost[twin]):
                graph.cost[twin] = back


@kernel
def fill_moves(
    model: EdgeModel, kind: int, poses_rad: Floats, pairs: Ints, edges: MoveEdges, base: Floats, moves: Ints
) -> None:
    """Compute the unknown costs of moves, both directions."""
    for m in moves:
        there, back = edges.of_move[m, 0], edges.of_move[m, 1]
        if np.isnan(base[there]):
            base[there], base[back] = edge_costs(model, kind, poses_rad[pairs[m, 0]], poses_rad[pairs[m, 1]])


@kernel
def heights_j(model: EdgeModel, poses_rad: Floats) -> NDArray[np.float64]:
    """Return each pose's potential energy in joules, shape (n,)."""
    out = np.empty(poses_rad.shape[0])
    for i in range(poses_rad.shape[0]):
        out[i] = potential_energy_j(model.body, poses_rad[i])
    return out
