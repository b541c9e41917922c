"""How the work of A*, D* Lite and MPD* Lite grows with the nodes (Table 6, Fig. 11), and what energy as cost saves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import process_time
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planarm.experiments.mpdstar_scenes import bench_scene, random_scene
from planarm.model.shapes import Circle, obstacle_set
from planarm.roadmap.graph import Roadmap
from planarm.roadmap.planning import way_energy_j
from planarm.search.incremental import GraphAlgorithm, GraphAnswer, GraphPlanner
from planarm.workspace.joint_proof import link_ends, pose_spare_cm

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ALGORITHMS: Final[tuple[GraphAlgorithm, ...]] = ("mpd_star_lite", "d_star_lite", "roadmap_a_star")
PUBLISHED: Final = (
    (91, 3, 0.125, 0.348, 0.094),
    (91, 7, 0.344, 1.553, 0.891),
    (91, 10, 1.031, 8.564, 78.125),
    (182, 13, 1.063, 9.678, 593.218),
    (273, 21, 3.047, 40.849, 2450.375),
)
"""Table 6: nodes, nodes of the best path, seconds of MPD* Lite, D* Lite and A*."""
SIZES: Final = (91, 182, 273, 1000, 3000, 10_000, 30_000, 100_000)
LEAST_MOVES = 4
DIAMETER_CM = 4.0
FIFTH = 5
MOST_DRAWS = 4000


@dataclass(frozen=True, slots=True)
class GrowthRow:
    """Medians over the tasks of one graph, for one algorithm."""

    nodes: int
    edges: int
    algorithm: GraphAlgorithm
    path_nodes: float
    first_expanded: float
    first_ms: float
    again_expanded: float
    again_ms: float
    """After an obstacle on the next fifth of the way, the search alone."""
    read_off: float
    """Edges or nodes looked at to tell the path."""
    rescanned: float
    """Nodes all of whose successors were compared in the repair."""


def growth(sizes: tuple[int, ...], tasks: int, told: Callable[[int], None]) -> list[GrowthRow]:
    """Measure first plans and replans on graphs of these sizes; `told` hears each size that is done."""
    rows = []
    for nodes in sizes:
        rows += _growth_of(nodes, tasks)
        told(nodes)
    return rows


def _growth_of(nodes: int, tasks: int) -> list[GrowthRow]:
    scene = bench_scene(nodes)
    roadmap = Roadmap.of(scene, scene.margin_cm)
    roadmap.prepare()
    roadmap.cost_all()
    drawn = [_both_plans(roadmap, *task) for task in tasks_on(roadmap, tasks, seed=nodes)]
    rows = []
    for k, algorithm in enumerate(ALGORITHMS):
        first, again = ([one[part][k] for one in drawn] for part in (0, 1))
        figures = [
            float(np.median(values))
            for values in (
                [len(one.nodes) for one, _ in first],
                [one.work.expanded for one, _ in first],
                [ms for _, ms in first],
                [one.work.expanded for one, _ in again],
                [ms for _, ms in again],
                [one.work.read_off for one, _ in first],
                [one.work.rescanned for one, _ in again],
            )
        ]
        rows.append(GrowthRow(nodes, len(roadmap.graph.cost), algorithm, *figures))
    return rows


def tasks_on(roadmap: Roadmap, count: int, seed: int) -> Iterator[tuple[tuple[int, int], Circle]]:
    """Draw pairs of nodes that a way of some moves joins, and an obstacle on its next fifth that touches neither.

    Raises:
        ValueError: the graph holds hardly any such pair.
    """
    rng, found = np.random.default_rng(seed), 0
    for _ in range(MOST_DRAWS):
        start, goal = (int(n) for n in rng.integers(0, len(roadmap.poses_rad), 2))
        answer = GraphPlanner(roadmap.graph, roadmap.bounds(), (start, goal), "roadmap_a_star").solve()
        if len(answer.nodes) <= LEAST_MOVES:
            continue
        ahead = answer.nodes[1 : max(2, len(answer.nodes) // FIFTH) + 1]
        ends = np.empty((roadmap.poses_rad.shape[1] + 1, 2))
        link_ends(roadmap.world, roadmap.poses_rad[int(rng.choice(ahead))], ends)
        shape = Circle((float(ends[-1, 0]), float(ends[-1, 1])), 0.5 * DIAMETER_CM)
        alone = roadmap.world._replace(obstacles=obstacle_set([shape]))
        if all(pose_spare_cm(alone, roadmap.poses_rad[node]) > 0.0 for node in (start, goal)):
            yield (start, goal), shape
            found += 1
            if found == count:
                return
    raise ValueError(f"{found} of {count} tasks found in {MOST_DRAWS} draws")


Timed = tuple[GraphAnswer, float]


def _both_plans(roadmap: Roadmap, ends: tuple[int, int], shape: Circle) -> tuple[list[Timed], list[Timed]]:
    """Return each algorithm's first plan and its plan after the obstacle, with their milliseconds."""
    number, changes = roadmap.add_obstacle(shape)
    free_costs, firsts, agains = roadmap.graph.cost[changes.edges], [], []
    for algorithm in ALGORITHMS:
        roadmap.graph.cost[changes.edges] = free_costs
        planner = GraphPlanner(roadmap.graph, roadmap.bounds(), ends, algorithm, always_repair=True)
        firsts.append(_timed(planner.solve))
        agains.append(_timed(lambda planner=planner: planner.replan(changes)))  # type: ignore[misc]
    opened = roadmap.remove_obstacle(number)
    roadmap.graph.cost[opened.edges] = opened.costs
    for answers in (firsts, agains):
        costs = [answer.cost for answer, _ in answers]
        if not np.allclose(costs, costs[0], rtol=1e-9, atol=0.0):
            raise ValueError(f"the algorithms disagree: {costs}")
    return firsts, agains


def _timed(solve: Callable[[], GraphAnswer]) -> Timed:
    began_s = process_time()
    answer = solve()
    return answer, 1e3 * (process_time() - began_s)


@dataclass(frozen=True, slots=True)
class Saving:
    """One random scene: energy consumed on the way of least energy and on that of least joint travel."""

    seed: int
    links: int
    best_j: float
    shortest_j: float

    @property
    def share(self) -> float:
        """What the best way saves, as a share of the shortest way's energy."""
        return 1.0 - self.best_j / self.shortest_j


def savings(scenes: int, nodes: int, told: Callable[[int], None]) -> list[Saving]:
    """Compare the two ways on the same graphs, over random scenes of three and four links."""
    found: list[Saving] = []
    seed = 0
    while len(found) < scenes:
        seed += 1
        links = 3 + seed % 2
        one = _saving(seed, links, nodes)
        if one is not None:
            found.append(one)
            told(len(found))
    return found


def _saving(seed: int, links: int, nodes: int) -> Saving | None:
    maps = []
    for cost in ("consumed", "travel"):
        scene = random_scene(seed, links, nodes, cost)
        maps.append(Roadmap.of(scene, scene.margin_cm))
    rng = np.random.default_rng(seed)
    ends = (int(rng.integers(0, nodes)), int(rng.integers(0, nodes)))
    ways = [GraphPlanner(one.graph, one.bounds(), ends, "mpd_star_lite", one.cost_into).solve().nodes for one in maps]
    if min(map(len, ways)) <= LEAST_MOVES:
        return None
    best, shortest = (float(way_energy_j(maps[0], way).sum()) for way in ways)
    return Saving(seed, links, best, shortest)
