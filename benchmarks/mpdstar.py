"""`./dev bench mpdstar`: one new obstacle on a roadmap: what is checked again, repaired, or planned anew.

Two or three links among obstacles, 10,000 configurations, energy consumed as cost, everything warm, all costs known.
Each trial draws two configurations that a way of ten moves or more joins, and puts an obstacle where neither of them
stands. "ours" asks the index which moves it can touch, checks those, tells the search and solves; "anew" proves every
move clear of it as the roadmap does when it is built (`moves.are_free`), and searches by A*; "quick" is the same with
the re-check's short cuts (`recheck.touched_moves`: where links stand at configurations is kept). A* runs on the same
kernels as the repair, and is told the same new costs. "tree" is the repair of all distances alone, which the tool does
when much more is asked; its first answers are searched from the start (`search.ahead`). CPU time of one core; compare
the ratios.
"""

# ruff: noqa: T201 - it prints its results

from __future__ import annotations

import argparse
from collections.abc import Callable
from time import process_time

import numpy as np
from numpy.typing import NDArray

from planarm.experiments.mpdstar_scenes import bench_scene
from planarm.model.shapes import Circle, obstacle_set
from planarm.roadmap.graph import Roadmap
from planarm.roadmap.moves import are_free
from planarm.scene import EdgeCost
from planarm.scene.roadmap import EDGE_COSTS
from planarm.search.incremental import GraphAlgorithm, GraphAnswer, GraphPlanner
from planarm.search.result import SearchStatus
from planarm.workspace.joint_proof import link_ends, pose_spare_cm

Floats = NDArray[np.float64]

LEAST_MOVES = 10
DIAMETERS_CM = (2.0, 4.0, 8.0)
FIFTHS = 5


class Bench:
    """A roadmap, and pairs of its nodes that are worth a plan."""

    def __init__(self, nodes: int, cost: EdgeCost, seed: int, links: int) -> None:
        scene = bench_scene(nodes, cost, links=links)
        self.scene = scene
        self.roadmap = Roadmap.of(scene, scene.margin_cm)
        self.roadmap.prepare()
        self.roadmap.cost_all()
        self.bounds = self.roadmap.bounds()
        self.rng = np.random.default_rng(seed)

    def planner(self, algorithm: GraphAlgorithm, ends: tuple[int, int], *, always_repair: bool = False) -> GraphPlanner:
        """Return a planner that has not searched yet."""
        return GraphPlanner(self.roadmap.graph, self.bounds, ends, algorithm, always_repair=always_repair)

    def task(self) -> tuple[tuple[int, int], GraphAnswer]:
        """Return two nodes and the way between them."""
        while True:
            start, goal = (int(n) for n in self.rng.integers(0, len(self.roadmap.poses_rad), 2))
            found = self.planner("roadmap_a_star", (start, goal)).solve()
            if len(found.nodes) > LEAST_MOVES:
                return (start, goal), found

    def tip_cm(self, node: int) -> tuple[float, float]:
        """Return where a node has the tip."""
        ends = np.empty((self.roadmap.poses_rad.shape[1] + 1, 2))
        link_ends(self.roadmap.world, self.roadmap.poses_rad[node], ends)
        return float(ends[-1, 0]), float(ends[-1, 1])

    def obstacle(self, nodes: NDArray[np.int64], diameter_cm: float, place: int | None) -> Circle | None:
        """Return an obstacle near the tip in one fifth of the way, or anywhere; None when it touches start or goal."""
        if place is None:
            x, y = self.rng.uniform(-50.0, 50.0, 2)
        else:
            low, high = (max(1, round(share * (len(nodes) - 1) / FIFTHS)) for share in (place, place + 1))
            x, y = np.array(self.tip_cm(int(nodes[self.rng.integers(low, max(low + 1, high))])))
        shape = Circle((float(x), float(y)), 0.5 * diameter_cm)
        alone = self.roadmap.world._replace(obstacles=obstacle_set([shape]))
        clear = all(pose_spare_cm(alone, self.roadmap.poses_rad[node]) > 0.0 for node in nodes[[0, -1]])
        return shape if clear else None

    def undo(self, number: int, planner: GraphPlanner | None = None) -> None:
        """Take an obstacle away."""
        changes = self.roadmap.remove_obstacle(number)
        if planner is None:
            self.roadmap.graph.cost[changes.edges] = changes.costs
        else:
            planner.change(changes)


def one_trial(bench: Bench, diameter_cm: float, place: int | None) -> dict[str, float] | None:
    """Return the times in milliseconds of one new obstacle, ours and anew."""
    ends, first = bench.task()
    shape = bench.obstacle(first.nodes, diameter_cm, place)
    if shape is None:
        return None
    ours, forced = bench.planner("mpd_star_lite", ends), bench.planner("mpd_star_lite", ends, always_repair=True)
    ours.solve()
    forced.solve()
    graph = bench.roadmap.graph
    alone, every = bench.roadmap.world._replace(obstacles=obstacle_set([shape])), np.arange(len(bench.roadmap.pairs))

    began = process_time()
    number, changes = bench.roadmap.add_obstacle(shape)
    checked = process_time()
    before = graph.cost[changes.edges]
    taken = process_time()
    answer = ours.replan(changes)
    ended = process_time()
    check_ms, search_ms = 1e3 * (checked - began), 1e3 * (ended - taken)

    graph.cost[changes.edges] = before
    repair_ms, repaired = timed(lambda: forced.replan(changes))
    bench.undo(number)

    began = process_time()
    are_free(alone, bench.roadmap.poses_rad, bench.roadmap.pairs, every)
    plain_ms = 1e3 * (process_time() - began)
    began = process_time()
    number, changes = bench.roadmap.add_checking_all(shape)
    all_ms = 1e3 * (process_time() - began)
    anew = bench.planner("roadmap_a_star", ends)
    anew_ms, other = timed(lambda: anew.replan(changes))
    bench.undo(number)
    if answer.status is not other.status or not np.isclose(answer.cost, other.cost, rtol=1e-9, equal_nan=True):
        raise AssertionError(f"ours costs {answer.cost}, A* {other.cost}")
    return {
        "check": check_ms,
        "total": check_ms + search_ms,
        "chosen": search_ms,
        "repair": repair_ms,
        "anew": anew_ms,
        "all": all_ms,
        "plain": plain_ms,
        "edges": float(len(changes.edges)),
        "expanded": float(answer.work.expanded),
        "repair_expanded": float(repaired.work.expanded),
        "anew_expanded": float(other.work.expanded),
        "was_anew": float(answer.anew),
        "found": float(answer.status is SearchStatus.FOUND),
        "rerouted": float(not np.isclose(answer.cost, first.cost)),
    }


def timed(work: Callable[[], GraphAnswer]) -> tuple[float, GraphAnswer]:
    """Return milliseconds and result."""
    began = process_time()
    result = work()
    return 1e3 * (process_time() - began), result


def trials(bench: Bench, count: int, diameter_cm: float, place: int | None) -> dict[str, Floats]:
    """Return the figures of so many trials."""
    rows: list[dict[str, float]] = []
    while len(rows) < count:
        row = one_trial(bench, diameter_cm, place)
        if row is not None:
            rows.append(row)
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


def report(name: str, t: dict[str, Floats]) -> None:
    """Print one line of the table."""
    ratio, quick = ((t[key] + t["anew"]) / t["total"] for key in ("plain", "all"))
    search = t["anew"] / t["repair"]
    chosen = t["anew"] / t["chosen"]
    print(
        f"{name:34s} {np.median(t['total']):6.2f} {np.percentile(t['total'], 95):6.2f} {np.median(t['check']):6.2f}"
        f" {np.percentile(ratio, 5):6.1f} {np.median(ratio):6.1f}"
        f" {np.percentile(quick, 5):6.1f} {np.median(quick):6.1f}"
        f" | {np.median(t['anew']):5.2f} {np.median(t['chosen']):5.2f}"
        f" {np.percentile(chosen, 25):5.1f} {np.median(chosen):5.1f} {np.percentile(chosen, 75):5.1f}"
        f" {middle(chosen[t['found'] > 0.0]):5.1f} {middle(chosen[t['found'] == 0.0]):5.1f} {np.mean(t['found']):5.0%}"
        f" {np.mean(chosen < 1.0):4.0%} {np.mean(t['was_anew']):4.0%}"
        f" | {np.median(t['repair']):5.2f} {np.median(search):5.1f}"
        f" | {np.median(t['anew_expanded']):6.0f} {np.median(t['expanded']):6.0f}"
        f" {np.median(t['repair_expanded']):6.0f} {np.mean(t['rerouted']):5.0%}"
    )


def middle(values: Floats) -> float:
    """Return the median, not a number where there are no values."""
    return float(np.median(values)) if len(values) else np.nan


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, default=10_000)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--cost", default="consumed", choices=EDGE_COSTS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--next-only", action="store_true", help="obstacles on the next fifth of the way only")
    options = parser.parse_args()
    for links in (2, 3):
        table(options, links)


def table(options: argparse.Namespace, links: int) -> None:
    """Measure and print for an arm of so many links."""
    trials(Bench(300, options.cost, 7, links), 3, 4.0, None)  # compiled, or loaded
    bench = Bench(options.nodes, options.cost, options.seed, links)
    trials(bench, 3, 4.0, None)
    edges = len(bench.roadmap.pairs)
    print(f"\n{links} links, {options.nodes} configurations, {edges} moves, cost {options.cost}; CPU ms of one core")
    print(
        f"{'new obstacle':34s}   ours    p95  check x anew: p5, med  x quick: p5, med |    A*  ours"
        " ratio: p25, med, p75, way, none; way A* wins, anew |"
        "  tree ratio | expanded: A*, ours, tree rerouted"
    )
    if not options.next_only:
        report("4 cm, anywhere", trials(bench, 2 * options.trials, 4.0, None))
    next_ones = []
    for diameter in DIAMETERS_CM:
        for place in range(1 if options.next_only else FIFTHS):
            found = trials(bench, options.trials, diameter, place)
            report(f"{diameter:g} cm, fifth {place + 1} of the way", found)
            if place == 0:
                next_ones.append(found)
    together = {key: np.concatenate([found[key] for found in next_ones]) for key in next_ones[0]}
    report("all sizes, fifth 1 of the way", together)


if __name__ == "__main__":
    main()
