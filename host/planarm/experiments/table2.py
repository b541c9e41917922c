"""Paper C, Table II, computed anew: 8 lengths, 8 times and 16 improvements beside the published ones.

Start, goal, shapes and margin are those of the shipped examples: a documented reconstruction that gives A*'s lengths
to the last printed digit, not the paper's own scenario, which it does not print. Each planner runs under the paper's
reading (only nodes are checked) and with every move proved free, on the same map. Chaos A* is a distribution over
seeds; where one figure has to stand for it, it is the median of the seeds that find a path.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import nan
from statistics import median
from time import perf_counter
from typing import Final, Literal

import numpy as np

from planarm.experiments.published import A_STAR, CASES, CHAOS, PLANNERS, TABLE2, Figures, Planner
from planarm.experiments.scenes import table1_scene
from planarm.model.arm import Arm
from planarm.model.kinematics import inverse_2r
from planarm.notice import Notice, silent
from planarm.scene import Moves, PlannerSpec, Scene, Subset
from planarm.search.grid_search import find_path
from planarm.search.path import Path
from planarm.search.result import SearchResult
from planarm.search.stencils import DRAWN
from planarm.workspace.free_map import FreeMap, build_free_map
from planarm.workspace.world import clearances_cm

SEEDS: Final = 200
RUNS: Final = 15
"""Searches of which the median time is taken, after one that is not counted."""
SAMPLES: Final = 400
"""Of each move, for the clearance: at most 0.1 mm apart in the moves of these planners."""

Quantity = Literal["length", "time"]
READINGS: Final[tuple[Moves, ...]] = ("nodes", "proved")
SUBSETS: Final[tuple[Subset, ...]] = ("run", "expansion")
QUANTITIES: Final[tuple[Quantity, ...]] = ("length", "time")
CHAOS_SIZES: Final = tuple(replace(CHAOS, neighbours=neighbours) for neighbours in sorted(DRAWN))
"""Paper C, fig. 6: 5 of 8, 12 of 20, 23 of 44 and 34 of 68."""


@dataclass(frozen=True, slots=True)
class Ours:
    """What one planner gives: for Chaos A* medians over the seeds that find a path."""

    length_cm: float
    time_ms: float
    """Search alone: the map is built and the kernels are compiled."""
    clearance_cm: float
    """Least distance of the links' centre lines to the obstacles all along the path; NaN for Chaos A*."""


@dataclass(frozen=True, slots=True)
class Row:
    """One planner in one case."""

    case: int
    planner: str
    neighbours: int
    published: Figures
    nodes: Ours
    proved: Ours


@dataclass(frozen=True, slots=True)
class Percentages:
    """One improvement by both rules."""

    paper_rule: float
    """(A* - new) / new, in %."""
    usual_rule: float
    """(A* - new) / A*, in %."""


@dataclass(frozen=True, slots=True)
class Improvement:
    """One of Table II's 16 percentages, recomputed from the published figures, and ours."""

    case: int
    planner: str
    quantity: Quantity
    printed: float
    published: Percentages
    nodes: Percentages
    proved: Percentages


@dataclass(frozen=True, slots=True)
class Scatter:
    """Chaos A* over seeds 0, 1, 2 ...: percentiles are of the seeds that find a path."""

    case: int
    moves: Moves
    neighbours: int
    """The octagon: 8, 20, 44 or 68 nodes."""
    drawn: int
    """How many of them are drawn."""
    subset: Subset
    seeds: int
    no_path: int
    """Seeds that find no path."""
    shortest_cm: float
    p5_cm: float
    median_cm: float
    p95_cm: float
    longest_cm: float
    published_cm: float
    """The paper's one length of this case, drawn from 44."""
    published_or_shorter: float
    """Share of the found paths that are no longer than the published one."""
    time_ms: float

    @property
    def no_path_share(self) -> float:
        """Share of the seeds that find no path."""
        return self.no_path / self.seeds

    @property
    def as_published(self) -> bool:
        """Whether it is the octagon that the paper's lengths come from."""
        return self.neighbours == CHAOS.neighbours


@dataclass(frozen=True, slots=True)
class MapFigures:
    """The free map that all planners of a case search."""

    case: int
    free_nodes: int
    margin_cm: float
    cell_cm: float
    build_ms: float


@dataclass(frozen=True, slots=True)
class Table2:
    """Everything that the comparison found."""

    seeds: int
    maps: tuple[MapFigures, ...]
    rows: tuple[Row, ...]
    improvements: tuple[Improvement, ...]
    scatter: tuple[Scatter, ...]


@dataclass(frozen=True, slots=True)
class Case:
    """One of the two cases, ready to be searched."""

    number: int
    scene: Scene
    free_map: FreeMap
    build_ms: float

    def search(self, planner: Planner, moves: Moves, seed: int = 0, subset: Subset = "run") -> SearchResult:
        """Run one planner."""
        spec = PlannerSpec(planner.algorithm, planner.neighbours, subset, seed, moves)
        return find_path(self.free_map, self.scene.task.start_cm, self.scene.task.goal_cm, spec)


def compare_table2(seeds: int = SEEDS, notice: Notice = silent) -> Table2:
    """Compute the whole comparison; Chaos A* runs with seeds 0 .. seeds - 1.

    Raises:
        SceneError: an example scene is missing or broken.
        ValueError: `seeds` is below 1.
    """
    if seeds < 1:
        raise ValueError(f"seeds = {seeds} is below 1")
    maps, rows, scatter = [], [], []
    for done, number in enumerate(CASES):
        notice("compare", done / len(CASES))
        case = load_case(number)
        world = case.free_map
        maps.append(MapFigures(number, world.free_nodes, world.margin_cm, world.cell_cm, case.build_ms))
        spread = []
        kinds = list(product(CHAOS_SIZES, READINGS, SUBSETS))
        for k, (planner, moves, subset) in enumerate(kinds):
            spread.append(_scatter(case, planner, moves, subset, seeds))
            notice("compare", (done + (k + 1) / len(kinds)) / len(CASES))
        rows += [_row(case, planner, spread) for planner in PLANNERS]
        scatter += spread
    notice("compare", 1.0)
    return Table2(seeds, tuple(maps), tuple(rows), improvements(rows), tuple(scatter))


def load_case(number: int) -> Case:
    """Read the example scene of a case and build its map, with the scene's own margin."""
    scene = table1_scene(number)
    free_map = build_free_map(scene)  # this one compiles
    times_ms = []
    for _ in range(RUNS):
        began_s = perf_counter()
        free_map = build_free_map(scene)
        times_ms.append(1e3 * (perf_counter() - began_s))
    return Case(number, scene, free_map, median(times_ms))


def typical_path(case: Case, planner: Planner, moves: Moves, seeds: int) -> tuple[Path | None, int]:
    """Return a planner's path and its seed: for Chaos A* that of the median length, or the next shorter one."""
    if planner is not CHAOS:
        return case.search(planner, moves).path, 0
    found = [(case.search(planner, moves, seed).path, seed) for seed in range(seeds)]
    ranked = sorted((path.length_cm, seed, path) for path, seed in found if path is not None)
    if not ranked:
        return None, 0
    _, seed, path = ranked[(len(ranked) - 1) // 2]
    return path, seed


def least_clearance_cm(case: Case, path: Path) -> float:
    """Return how near the links' centre lines come to an obstacle along a path, by sampling each move densely."""
    share = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    tips_cm = np.concatenate([a + share * (b - a) for a, b in pairwise(path.points_cm)])
    q_rad = inverse_2r(Arm.from_spec(case.scene.arm), tips_cm, path.elbow)
    return float(clearances_cm(case.free_map.world, q_rad).min())


def improvements(rows: Sequence[Row]) -> tuple[Improvement, ...]:
    """Return the percentages against A* of the same case: of all lengths, then of all times."""
    bases = {row.case: row for row in rows if row.planner == A_STAR.name}
    return tuple(_improvement(bases[row.case], row, quantity) for quantity in QUANTITIES for row in rows)


def percentages(base: float, new: float) -> Percentages:
    """Return by how many per cent `new` is less than `base`, divided by the new value and by the base."""
    return Percentages(100.0 * (base - new) / new, 100.0 * (base - new) / base)


def _improvement(base: Row, row: Row, quantity: Quantity) -> Improvement:
    lengths = quantity == "length"
    printed = row.published.length_improvement_percent if lengths else row.published.time_improvement_percent
    published, nodes, proved = map(percentages, _values(base, lengths), _values(row, lengths))
    return Improvement(row.case, row.planner, quantity, printed, published, nodes, proved)


def _values(row: Row, lengths: bool) -> tuple[float, float, float]:
    """Return the published value and ours under both readings."""
    if lengths:
        return row.published.length_cm, row.nodes.length_cm, row.proved.length_cm
    return row.published.time_s, row.nodes.time_ms, row.proved.time_ms


def _row(case: Case, planner: Planner, spread: Sequence[Scatter]) -> Row:
    nodes, proved = (
        _median_of_seeds(spread, moves) if planner is CHAOS else _measured(case, planner, moves) for moves in READINGS
    )
    return Row(case.number, planner.name, planner.neighbours, TABLE2[case.number, planner], nodes, proved)


def _measured(case: Case, planner: Planner, moves: Moves) -> Ours:
    """Return the length, which is the same in every run, and the median time of warm runs."""
    results = [case.search(planner, moves) for _ in range(RUNS + 1)][1:]
    path, time_ms = results[0].path, 1e3 * median(result.plan_s for result in results)
    return Ours(path.length_cm, time_ms, least_clearance_cm(case, path)) if path else Ours(nan, time_ms, nan)


def _median_of_seeds(spread: Sequence[Scatter], moves: Moves) -> Ours:
    """Return what stands for Chaos A* in the rows: its subset is drawn once a run there."""
    one = next(one for one in spread if one.as_published and one.moves == moves and one.subset == "run")
    return Ours(one.median_cm, one.time_ms, nan)


def _scatter(case: Case, planner: Planner, moves: Moves, subset: Subset, seeds: int) -> Scatter:
    case.search(planner, moves, 0, subset)  # not counted
    results = [case.search(planner, moves, seed, subset) for seed in range(seeds)]
    found = np.array([result.path.length_cm for result in results if result.path is not None])
    shortest, p5, middle, p95, longest = np.percentile(found, (0, 5, 50, 95, 100)) if found.size else [nan] * 5
    published_cm = TABLE2[case.number, CHAOS].length_cm
    return Scatter(
        case=case.number,
        moves=moves,
        neighbours=planner.neighbours,
        drawn=DRAWN[planner.neighbours],
        subset=subset,
        seeds=seeds,
        no_path=seeds - found.size,
        shortest_cm=float(shortest),
        p5_cm=float(p5),
        median_cm=float(middle),
        p95_cm=float(p95),
        longest_cm=float(longest),
        published_cm=published_cm,
        published_or_shorter=float(np.mean(found <= published_cm)) if found.size else nan,
        time_ms=1e3 * median(result.plan_s for result in results),
    )
