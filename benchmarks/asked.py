"""`./dev bench asked`: what the live loop asks the search after a new obstacle, ours and A* anew.

As in `./dev bench mpdstar`, with obstacles on one fifth of the way. What is asked is recorded from the live loop's own
functions: `way_from` a configuration a third of the first move on, where an arm has come to rest; or `ways_on` from the
next three corners and a configuration between each two, where it goes on at speed. Then new costs are told and all of
it is answered: by ours; by A* that searches anew for each node ("each"); and by A* that searches anew once and goes on
from there to the other nodes ("once"). CPU time of one core; compare the ratios.
"""

# ruff: noqa: T201 - it prints its results

from __future__ import annotations

import argparse
from dataclasses import replace
from time import process_time
from typing import cast

import numpy as np
from mpdstar import FIFTHS, Bench
from numpy.typing import NDArray

from planarm.model.shapes import Circle
from planarm.roadmap.planning import RoadmapTask, way_from, ways_on
from planarm.scene import Obstacle
from planarm.search.incremental import Changes, GraphAnswer, GraphPlanner
from planarm.workspace.joint_proof import joint_world

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Question = tuple[Ints, Floats]

DIAMETER_CM = 4.0
CORNERS = 3
RESTS_AT = 0.3
"""Of the first move."""


class Recording:
    """Answers as a planner, and keeps what was asked: nodes, and what it costs to come to each."""

    def __init__(self, planner: GraphPlanner) -> None:
        self.planner = planner
        self.asked: list[Question] = []

    def move_start(self, node: int) -> None:
        """Tell the planner."""
        self.planner.move_start(node)

    def solve(self) -> GraphAnswer:
        """Keep the start."""
        self.asked.append((np.array([self.planner.start]), np.zeros(1)))
        return self.planner.solve()

    def solve_from(self, nodes: Ints, steps: Floats) -> GraphAnswer:
        """Keep all of them."""
        self.asked.append((nodes, steps))
        return self.planner.solve_from(nodes, steps)


def questions(bench: Bench, planner: GraphPlanner, nodes: Ints, shape: Circle, *, rests: bool) -> list[Question]:
    """Return what the live loop asks for a way of these nodes; the obstacle's moves are closed."""
    scene, met = bench.scene, Obstacle("circle", shape.center_cm, 2.0 * shape.radius_cm)
    among = joint_world(replace(scene, obstacles=(*scene.obstacles, met)), scene.margin_cm)
    recording = Recording(planner)
    task = RoadmapTask(bench.roadmap, cast("GraphPlanner", recording))
    poses = bench.roadmap.poses_rad[nodes[: CORNERS + 2]]
    if rests:
        way_from(task, among, (1.0 - RESTS_AT) * poses[0] + RESTS_AT * poses[1])
    else:
        between = 0.5 * (poses[1:-1] + poses[2:])
        ways_on(task, among, np.stack([poses[1:-1], between], axis=1).reshape(-1, poses.shape[1]))
    return recording.asked


def answered(planner: GraphPlanner, told: Changes, asked: list[Question], *, each: bool) -> tuple[float, Floats]:
    """Tell new costs and ask; return milliseconds and what the best way of each question costs."""
    began, costs = process_time(), []
    planner.change(told)
    for nodes, steps in asked:
        if not each and len(nodes) > 1:
            costs.append(planner.solve_from(nodes, steps).cost)
            continue
        best = np.inf
        for node, step in zip(nodes.tolist(), steps.tolist(), strict=True):
            planner.move_start(node)
            best = min(best, step + planner.solve().cost)
        costs.append(best)
    return 1e3 * (process_time() - began), np.array(costs)


def one_trial(bench: Bench, place: int, *, rests: bool) -> list[float] | None:
    """Return how many nodes are asked, and the milliseconds of ours, A* for each and A* once."""
    ends, first = bench.task()
    shape = bench.obstacle(first.nodes, DIAMETER_CM, place)
    if shape is None:
        return None
    ours, each, asking = (bench.planner(name, ends) for name in ("mpd_star_lite", "roadmap_a_star", "mpd_star_lite"))
    ours.solve()
    each.solve()
    number, told = bench.roadmap.add_obstacle(shape)
    cost = bench.roadmap.graph.cost
    before = cost[told.edges]
    asking.change(told)
    asked = questions(bench, asking, first.nodes, shape, rests=rests)
    results = []
    for planner, singly in ((ours, False), (each, True), (bench.planner("mpd_star_lite", ends), True)):
        cost[told.edges] = before
        results.append(answered(planner, told, asked, each=singly))
    bench.undo(number)
    for _, costs in results:
        if not np.allclose(costs, results[0][1], rtol=1e-9):
            raise AssertionError(f"ours costs {results[0][1]}, A* {costs}")
    return [float(sum(len(nodes) for nodes, _ in asked)), *(ms for ms, _ in results)] if asked else None


def report(bench: Bench, place: int, count: int, *, rests: bool) -> None:
    """Measure, and print one line."""
    rows: list[list[float]] = []
    while len(rows) < count:
        row = one_trial(bench, place, rests=rests)
        rows += [] if row is None else [row]
    t = np.array(rows).T
    each, once = t[2] / t[1], t[3] / t[1]
    print(
        f"  fifth {place + 1}, {'at rest ' if rests else 'at speed'}: {np.median(t[0]):3.0f} nodes asked; "
        f"ms {np.median(t[1]):.2f}, p95 {np.percentile(t[1], 95):.2f}; A* each {np.median(t[2]):5.2f}, "
        f"once {np.median(t[3]):.2f}; ratio to each {np.median(each):4.1f}; "
        f"to once p25, median, p75: {' '.join(f'{np.percentile(once, k):.1f}' for k in (25, 50, 75))}"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, default=10_000)
    parser.add_argument("--trials", type=int, default=60)
    options = parser.parse_args()
    for links in (2, 3):
        print(f"{links} links, {options.nodes} configurations")
        bench = Bench(options.nodes, "consumed", 1, links)
        for _ in range(3):  # compiled, or loaded
            one_trial(bench, 0, rests=True)
        for rests in (True, False):
            for place in (0, FIFTHS // 2):
                report(bench, place, options.trials, rests=rests)


if __name__ == "__main__":
    main()
