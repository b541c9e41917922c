"""How fast maps and planners are, beside other searches on the same graph: `./dev bench planners [--cells CM ...]`.

The scene is case 1 of paper C's Table I with four discs and without a limit of joint 2; two pairs of points. All
figures are medians of warm runs in this one process, in CPU time, since the machine may be busy: compare the ratios,
not the milliseconds of one machine with those of another. Ours start from ready arrays of the map, as the peers do from
a ready graph or cost array, and end with the path. All peers have 8 neighbours; scipy's dijkstra goes to every node:
it cannot stop at a goal. "proved" is what proving moves costs: milliseconds with moves = "proved", and how many times
those with nodes checked; the two are timed by turns. A peer that does not run is told with its reason.
"""

import argparse
import importlib.util
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import hypot, pi
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from planarm.experiments.scenes import table1_scene
from planarm.report.style import JOINT_COLOURS, dress, new_figure, save
from planarm.scene import Algorithm, Moves, PlannerSpec, Point, Scene
from planarm.search.best_first import Rules, best_first
from planarm.search.grid_search import FEW_MOVES, LEGAL, find_path
from planarm.search.lattice import make_lattice, make_moves, node_at, open_room
from planarm.search.legal import ROOM, WHOLE_ROOM, Lattice
from planarm.search.scratch import BYTES_PER_ENTRY, BYTES_PER_NODE
from planarm.search.stencils import neighbour_counts, primitive, stencil
from planarm.workspace.free_map import FreeMap, build_free_map
from planarm.workspace.world import FREE

PAIRS: Final[tuple[tuple[Point, Point], ...]] = (((45.0, 5.0), (-45.0, 5.0)), ((25.0, 42.0), (-25.0, 42.0)))
OURS: Final[tuple[tuple[str, Algorithm, int], ...]] = (
    ("A* 8", "a_star", 8),
    ("Modified A* 24", "modified_a_star", 24),
    ("CHS 56", "chs", 56),
)
CHECKS: Final[tuple[Moves, Moves]] = ("nodes", "proved")
GROWTH_CELLS_CM: Final = (1.0, 0.5, 0.25, 0.1, 0.05, 0.025)
LEAST_COLUMNS: Final = 96
"""Columns of the table: a narrow terminal breaks its lines rather than its figures."""
BUDGET_S: Final = 0.3
"""CPU time for one median, unless one run takes longer."""
LEAST_RUNS: Final = 3
MOST_RUNS: Final = 31
LONG_S: Final = 1.0
"""A run that takes longer is not repeated."""
PEERS: Final = (
    ("skimage MCP_Geometric", "skimage", "scikit-image"),
    ("networkx A*", "networkx", "networkx"),
    ("OMPL RRT*", "ompl", "ompl"),
)
"""Searches of others that are not among what planarm needs: name, module, package."""
NETWORKX_NODES: Final = 400_000
"""networkx takes minutes to build a larger graph."""
OMPL_S: Final = 1.0
"""Seconds that OMPL's planner is given."""


class Task(NamedTuple):
    """A scene's map and the pair of nodes to be joined."""

    scene: Scene
    free_map: FreeMap
    start_cm: Point
    goal_cm: Point


def main() -> None:
    """Measure and print, one block for each cell size."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--cells", type=float, nargs="+", default=[1.0, 0.1], metavar="CM", help="default: 1 0.1")
    parser.add_argument("--every", action="store_true", help="every stencil, not three of them")
    parser.add_argument("--growth", type=Path, metavar="PNG", help="only draw how times grow with cells and neighbours")
    options = parser.parse_args()
    console = Console()
    console = console if console.width >= LEAST_COLUMNS else Console(width=LEAST_COLUMNS)
    if options.growth:
        draw_growth(options.growth)
        return
    for cell_cm in options.cells:
        report(console, cell_cm, options.every)


def report(console: Console, cell_cm: float, every: bool) -> None:
    """Measure at one cell size."""
    scene = scene_at(cell_cm)
    free_map = build_free_map(scene, 0.0)
    map_ms = median_ms(lambda: build_free_map(scene, 0.0))
    nodes_ms = median_ms(lambda: build_free_map(scene, 0.0, whole_cells=False))
    console.print(
        f"\ncells of {cell_cm:g} cm: {free_map.region.size} nodes, {free_map.free_nodes} free; three-valued map in "
        f"{digits(map_ms)} ms, {digits(1e6 * map_ms / free_map.region.size)} ns a cell, two-valued "
        f"{digits(1e6 * nodes_ms / free_map.region.size)} ns a cell; "
        f"map and search take {megabytes(free_map):.0f} MB and {BYTES_PER_ENTRY} bytes for each open-list entry"
    )
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("planner", no_wrap=True)
    for name in ("pair 1: cm", "ms", "proved", "times", "pair 2: cm", "ms", "proved", "times"):
        table.add_column(name, justify="right", no_wrap=True)
    columns = [measured(Task(scene, free_map, *pair), every) for pair in PAIRS]
    for first, second in zip(*columns, strict=True):
        table.add_row(first[0], *first[1:], *second[1:])
    console.print(table)
    for line in absent_peers(free_map):
        console.print(line)


def scene_at(cell_cm: float) -> Scene:
    """Return the scene on cells of a size."""
    scene = table1_scene(1)
    limits = (scene.arm.joint_limits_rad[0], (-pi, pi))
    workspace = replace(scene.workspace, cell_cm=cell_cm)
    return replace(scene, workspace=workspace, arm=replace(scene.arm, joint_limits_rad=limits))


def megabytes(free_map: FreeMap) -> float:
    """Return what the map's arrays, the lattice's three and the search's scratch take."""
    nodes = free_map.region.size
    return (free_map.region.nbytes + free_map.whole.nbytes + nodes * (2 + BYTES_PER_NODE)) / 1e6


Row = tuple[str, str, str, str, str]


def measured(task: Task, every: bool) -> list[Row]:
    """Time peers and ours on one pair; the best peer's time by ours ends the list."""
    peers = list(measure_peers(task))
    rows: list[Row] = [(name, f"{length_cm:.4f}", digits(ms), "", "") for name, length_cm, ms in peers]
    best_ms = min((ms for name, _, ms in peers if "OMPL" not in name), default=0.0)
    ratio = ""
    for name, algorithm, neighbours in stencils(every):
        ways = [searching(task, PlannerSpec(algorithm, neighbours, "run", 1, moves)) for moves in CHECKS]
        nodes_ms, proved_ms = medians_ms(ways[0].search, ways[1].search)
        times = f"{proved_ms / nodes_ms:.2f}"
        rows.append((name, f"{ways[0].length_cm:.4f}", digits(nodes_ms), digits(proved_ms), times))
        ratio = ratio or digits(best_ms / nodes_ms)
    taut_cm, taut_ms = measure_call(task, "taut", 56, "proved")
    rows.append(("taut, whole call", f"{taut_cm:.4f}", "", digits(taut_ms), ""))
    rows.append(("best peer / ours", "", ratio, "", ""))
    return rows


def stencils(every: bool) -> Iterator[tuple[str, Algorithm, int]]:
    """Return names, algorithms and neighbours of those measured."""
    if not every:
        yield from OURS
        return
    names: dict[Algorithm, str] = {"a_star": "A*", "modified_a_star": "Modified A*", "chs": "CHS"}
    for algorithm, name in names.items():
        for neighbours in neighbour_counts(algorithm):
            yield f"{name} {neighbours}", algorithm, neighbours


class Searching(NamedTuple):
    """A search on ready arrays, to be timed."""

    search: Callable[[], object]
    length_cm: float


def searching(task: Task, planner: PlannerSpec) -> Searching:
    """Return a search on ready arrays and its path's length, once it is seen to be the one `find_path` runs."""
    offsets = stencil(planner.algorithm, planner.neighbours)
    lattice = make_lattice(task.free_map, border=int(np.abs(offsets).max()))
    offsets = primitive(offsets) if planner.moves == "proved" else offsets
    moves, reach = make_moves(offsets, lattice), int(np.abs(offsets).max())
    least = WHOLE_ROOM if planner.moves == "proved" else ROOM
    rules = Rules(LEGAL[planner.moves], 0, 0, least if len(offsets) <= FEW_MOVES else 0)
    start, goal = (node_of(lattice, point) for point in (task.start_cm, task.goal_cm))

    def search() -> NDArray[np.int64]:
        wide_open = open_room(lattice, reach, least) if len(offsets) > FEW_MOVES else None
        return best_first(lattice, moves, rules, task.free_map.world, start, goal, wide_open).nodes

    length_cm = length_of(lattice, search())
    whole = find_path(task.free_map, task.start_cm, task.goal_cm, planner)
    assert whole.path is not None and abs(length_cm - whole.path.length_cm) < 1e-6, "the same path as find_path's"
    return Searching(search, length_cm)


def measure_call(task: Task, algorithm: Algorithm, neighbours: int, moves: Moves) -> tuple[float, float]:
    """Return length and milliseconds of `find_path` without its bound."""
    spec = PlannerSpec(algorithm, neighbours, "run", 1, moves)
    results = [find_path(task.free_map, task.start_cm, task.goal_cm, spec)]
    runs = MOST_RUNS if results[0].plan_s < BUDGET_S / MOST_RUNS else LEAST_RUNS
    results += [find_path(task.free_map, task.start_cm, task.goal_cm, spec) for _ in range(runs)]
    path = results[0].path
    assert path is not None, "there is a way"
    return path.length_cm, 1e3 * median(result.plan_s for result in results)


def node_of(lattice: Lattice, point_cm: Point) -> int:
    """Return the node at a point that is one."""
    return node_at(lattice, round(point_cm[0] / lattice.cell_cm), round(point_cm[1] / lattice.cell_cm))


def length_of(lattice: Lattice, nodes: NDArray[np.int64]) -> float:
    """Return the length of a path of nodes in cm."""
    y, x = np.divmod(nodes, lattice.width)
    return float(lattice.cell_cm * np.hypot(np.diff(x), np.diff(y)).sum())


def measure_peers(task: Task) -> Iterator[tuple[str, float, float]]:
    """Yield name, length in cm and milliseconds of other searches; the grid's are given its graph or costs ready."""
    graph, number = eight_neighbour_graph(task.free_map)
    at = [index_of(task.free_map, point) for point in (task.start_cm, task.goal_cm)]
    start, goal = (int(number[index]) for index in at)
    length_cm = float(dijkstra(graph, indices=start)[goal])
    yield "scipy dijkstra", length_cm, median_ms(lambda: dijkstra(graph, indices=start))
    if importlib.util.find_spec("skimage"):
        yield "skimage MCP_Geometric", *skimage_mcp(task.free_map, *at)
    if importlib.util.find_spec("networkx") and task.free_map.free_nodes <= NETWORKX_NODES:
        yield "networkx A*", *networkx_a_star(graph, task.free_map, number, start, goal)
    if importlib.util.find_spec("ompl"):
        yield f"OMPL RRT*, {OMPL_S:g} s", *ompl_rrt_star(task)


def absent_peers(free_map: FreeMap) -> Iterator[str]:
    """Yield which peers were not run on a map, and why."""
    for name, module, package in PEERS:
        if not importlib.util.find_spec(module):
            yield f"{name} was not run: {package} is not installed (pip install {package})."
        elif module == "networkx" and free_map.free_nodes > NETWORKX_NODES:
            yield f"{name} was not run: building its graph of {free_map.free_nodes} nodes takes minutes."


def index_of(free_map: FreeMap, point_cm: Point) -> tuple[int, int]:
    """Return the map index [iy, ix] of a point that is a node."""
    x_cm, y_cm = float(free_map.x_cm[0]), float(free_map.y_cm[0])
    return round((point_cm[1] - y_cm) / free_map.cell_cm), round((point_cm[0] - x_cm) / free_map.cell_cm)


def eight_neighbour_graph(free_map: FreeMap) -> tuple[csr_matrix, NDArray[np.int64]]:
    """Return the graph of the free nodes with move lengths in cm, and each node's number by its map index."""
    free = free_map.region == FREE
    number = np.full(free.shape, -1, np.int64)
    number[free] = np.arange(np.count_nonzero(free))
    padded = np.pad(number, 1, constant_values=-1)
    sources, targets, lengths = [], [], []
    for dx, dy in stencil("a_star", 8):
        other = padded[1 + dy : 1 + dy + free.shape[0], 1 + dx : 1 + dx + free.shape[1]]
        joined = (number >= 0) & (other >= 0)
        sources.append(number[joined])
        targets.append(other[joined])
        lengths.append(np.full(np.count_nonzero(joined), free_map.cell_cm * hypot(dx, dy)))
    edges = np.concatenate(lengths), (np.concatenate(sources), np.concatenate(targets))
    return csr_matrix(edges, shape=(number.max() + 1, number.max() + 1)), number


def skimage_mcp(free_map: FreeMap, start: tuple[int, int], goal: tuple[int, int]) -> tuple[float, float]:
    """Return length and milliseconds of skimage's MCP_Geometric; its cost array is ready."""
    graph: Any = importlib.import_module("skimage.graph")
    costs = np.where(free_map.region == FREE, 1.0, -1.0)

    def search() -> float:
        found, _ = graph.MCP_Geometric(costs).find_costs([start], [goal])
        return float(found[goal])

    return search() * free_map.cell_cm, median_ms(search)


def networkx_a_star(
    graph: csr_matrix, free_map: FreeMap, number: NDArray[np.int64], start: int, goal: int
) -> tuple[float, float]:
    """Return length and milliseconds of networkx's A* with the straight distance as heuristic; its graph is built."""
    networkx: Any = importlib.import_module("networkx")
    rows, columns = np.nonzero(number >= 0)
    place = np.stack((free_map.x_cm[columns], free_map.y_cm[rows]), axis=1).tolist()
    joined = networkx.from_scipy_sparse_array(graph, edge_attribute="weight")

    def distance_cm(a: int, b: int) -> float:
        return hypot(place[a][0] - place[b][0], place[a][1] - place[b][1])

    def search() -> Any:  # noqa: ANN401 - a list of nodes of an untyped library
        return networkx.astar_path(joined, start, goal, heuristic=distance_cm, weight="weight")

    return float(networkx.path_weight(joined, search(), "weight")), median_ms(search)


def ompl_rrt_star(task: Task) -> tuple[float, float]:
    """Return length and milliseconds of OMPL's RRT* on the plane, a state valid where its cell's node is free."""
    base: Any = importlib.import_module("ompl.base")
    geometric: Any = importlib.import_module("ompl.geometric")
    util: Any = importlib.import_module("ompl.util")
    util.setLogLevel(util.LogLevel.LOG_NONE)
    free_map, free = task.free_map, task.free_map.region == FREE
    space = base.RealVectorStateSpace(2)
    bounds = base.RealVectorBounds(2)
    for axis, values in enumerate((free_map.x_cm, free_map.y_cm)):
        bounds.setLow(axis, float(values[0]))
        bounds.setHigh(axis, float(values[-1]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: bool(free[index_of(free_map, (state[0], state[1]))]))
    ends = [space.allocState(), space.allocState()]
    for state, point in zip(ends, (task.start_cm, task.goal_cm), strict=True):
        state[0], state[1] = point
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(geometric.RRTstar(setup.getSpaceInformation()))
    began_s = process_time()
    setup.solve(OMPL_S)
    took_ms = 1e3 * (process_time() - began_s)
    return float(setup.getSolutionPath().length()), took_ms


def digits(value: float) -> str:
    """Return three digits that count, large numbers whole."""
    return f"{value:.3g}" if value < 100.0 else f"{value:.0f}"


def median_ms(work: Callable[[], object]) -> float:
    """Return the median CPU time of some runs in milliseconds; the first is not counted unless it is a long one."""
    return medians_ms(work)[0]


def medians_ms(*works: Callable[[], object]) -> list[float]:
    """Return `median_ms` of each; they run by turns, so that what else the machine does meets all alike."""

    def once(work: Callable[[], object]) -> float:
        began_s = process_time()
        work()
        return process_time() - began_s

    firsts_s = [once(work) for work in works]
    if max(firsts_s) > LONG_S:
        return [1e3 * first_s for first_s in firsts_s]
    began_s, took_s = process_time(), [list[float]() for _ in works]
    rounds, budget_s = 0, len(works) * BUDGET_S
    while rounds < LEAST_RUNS or (rounds < MOST_RUNS and process_time() - began_s < budget_s):
        for work, times_s in zip(works, took_s, strict=True):
            times_s.append(once(work))
        rounds += 1
    return [1e3 * median(times_s) for times_s in took_s]


def draw_growth(target: Path) -> None:
    """Time the first pair on ever finer cells, and with every stencil at 1 mm, and draw both."""
    figure = new_figure(9.0, 3.8)
    left, right = figure.subplots(1, 2)
    lines: dict[str, list[float]] = {}
    free = []
    for cell_cm in track(GROWTH_CELLS_CM, "cells"):
        task = Task(scene_at(cell_cm), build_free_map(scene_at(cell_cm), 0.0), *PAIRS[0])
        free.append(task.free_map.free_nodes)
        for name, _, ms in measure_peers(task):
            if "OMPL" not in name:
                lines.setdefault(name, []).append(ms)
        for name, algorithm, neighbours in OURS[::2]:
            for moves in CHECKS:
                way = searching(task, PlannerSpec(algorithm, neighbours, "run", 1, moves))
                lines.setdefault(f"{name}, {moves}", []).append(median_ms(way.search))
    for k, (name, times_ms) in enumerate(lines.items()):
        ours, colour = "," in name, JOINT_COLOURS[k % len(JOINT_COLOURS)]
        left.loglog(free[: len(times_ms)], times_ms, "o-" if ours else "s--", color=colour, markersize=4, label=name)
    task = Task(scene_at(0.1), build_free_map(scene_at(0.1), 0.0), *PAIRS[0])
    for k, moves in enumerate(CHECKS):
        points = []
        for _, algorithm, neighbours in track(list(stencils(every=True)), f"neighbours, {moves}"):
            way = searching(task, PlannerSpec(algorithm, neighbours, "run", 1, moves))
            points.append((neighbours, median_ms(way.search)))
        right.plot(*zip(*sorted(points), strict=True), "o-", color=JOINT_COLOURS[k], label=moves)
    left.set_xlabel("free nodes of the map")
    left.set_ylabel("ms of CPU")
    right.set_xlabel("neighbours, cells of 1 mm")
    right.set_ylabel("ms of CPU")
    right.set_ylim(bottom=0.0)
    for axes in (left, right):
        dress(axes)
        axes.legend(frameon=False, fontsize=7, handlelength=3.2)  # long enough to tell dashed from drawn
    save(figure, target)


if __name__ == "__main__":
    main()
