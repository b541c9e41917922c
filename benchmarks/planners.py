"""How fast the four planners search, beside other searches on the same graph: `./dev bench planners [--cell CM]`.

Case 1 of paper C's Table I. All figures are medians of warm runs in this one process, in CPU time, since the machine
may be busy: compare the ratios, not the milliseconds of one machine with those of another. "search" is the search on
ready arrays, the fair neighbour of an algorithm whose graph is already built; "whole call" is what a caller waits for.
scipy's dijkstra goes to every node: it cannot stop at a goal.
"""

import argparse
import importlib.util
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import hypot
from statistics import median
from time import process_time
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from planarm.experiments.scenes import table1_scene
from planarm.scene import Algorithm, Moves, PlannerSpec, Scene
from planarm.search.best_first import Lattice, Rules, best_first
from planarm.search.grid_search import LEGAL, find_path
from planarm.search.lattice import make_lattice, make_moves, node_at
from planarm.search.stencils import DRAWN, neighbour_counts, primitive, stencil
from planarm.workspace.free_map import FreeMap, build_free_map
from planarm.workspace.world import FREE

NAMES: Final[dict[Algorithm, str]] = {
    "a_star": "A*",
    "modified_a_star": "Modified A*",
    "chaos_a_star": "Chaos A*",
    "chs": "CHS",
}
READINGS: Final[tuple[Moves, ...]] = ("nodes", "proved")
SEED: Final = 1
BUDGET_S: Final = 0.15
"""CPU time for one median, unless one run takes longer."""
LEAST_RUNS: Final = 3
MOST_RUNS: Final = 31
LONG_S: Final = 1.0
"""A run that takes longer is not repeated."""


def main() -> None:
    """Measure and print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--cell", type=float, default=1.0, metavar="CM", help="cell size (default: 1; 0.1 is finer)")
    options = parser.parse_args()
    scene = table1_scene(1)
    scene = replace(scene, workspace=replace(scene.workspace, cell_cm=options.cell))
    free_map = build_free_map(scene)
    map_ms = median_ms(lambda: build_free_map(scene))
    peers, reference_ms = measure_peers(scene, free_map)
    rows = [*peers, *measure_planners(scene, free_map, reference_ms)]
    console = Console()
    console.print(
        f"Table I, case 1, cells of {options.cell:g} cm: {free_map.free_nodes} free nodes; "
        f"map built in {digits(map_ms)} ms"
    )
    console.print(shown(rows))


Cells = tuple[str, ...]


def shown(rows: list[Cells]) -> Table:
    """Return the table for a terminal of 80 columns."""
    title = "Medians of warm runs, CPU time; scipy and networkx have 8 neighbours and their graph ready"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("planner", no_wrap=True, max_width=18)
    table.add_column("moves", no_wrap=True)
    for name in ("length (cm)", "nodes closed", "whole call (ms)", "search (ms)", "dijkstra / search"):
        table.add_column(name, justify="right")
    for cells in rows:
        table.add_row(*cells)
    return table


def measure_planners(scene: Scene, free_map: FreeMap, reference_ms: float) -> Iterator[Cells]:
    """Time every stencil under both readings."""
    for algorithm in NAMES:
        for neighbours in neighbour_counts(algorithm):
            for moves in READINGS:
                yield measure(scene, free_map, PlannerSpec(algorithm, neighbours, "run", SEED, moves), reference_ms)


def measure(scene: Scene, free_map: FreeMap, planner: PlannerSpec, reference_ms: float) -> Cells:
    """Time one planner."""
    drawn = f"{DRAWN[planner.neighbours]} of " if planner.algorithm == "chaos_a_star" else ""
    name = f"{NAMES[planner.algorithm]} {drawn}{planner.neighbours}"
    result = find_path(free_map, scene.task.start_cm, scene.task.goal_cm, planner)
    if result.path is None:
        return name, planner.moves, "no path", "", "", "", ""
    found = name, planner.moves, f"{result.path.length_cm:.4f}", str(result.expanded)
    whole_ms = median_ms(lambda: find_path(free_map, scene.task.start_cm, scene.task.goal_cm, planner))
    if planner.algorithm == "chaos_a_star":  # its subset is drawn inside find_path
        return *found, digits(whole_ms), "", ""
    search_ms = 1e3 * median(search_times_s(scene, free_map, planner, result.path.length_cm))
    return *found, digits(whole_ms), digits(search_ms), digits(reference_ms / search_ms)


def search_times_s(scene: Scene, free_map: FreeMap, planner: PlannerSpec, length_cm: float) -> list[float]:
    """Time the search alone, and see that it is the search that `find_path` runs."""
    offsets = stencil(planner.algorithm, planner.neighbours)
    lattice = make_lattice(free_map, border=int(np.abs(offsets).max()))
    moves = make_moves(primitive(offsets) if planner.moves == "proved" else offsets, lattice)
    rules = Rules(LEGAL[planner.moves], 0, planner.seed)
    start, goal = (node_of(lattice, point) for point in (scene.task.start_cm, scene.task.goal_cm))

    def once() -> float:
        began_s = process_time()
        found = best_first(lattice, moves, rules, free_map.world, start, goal)
        took_s = process_time() - began_s
        assert abs(length_of(lattice, found.nodes) - length_cm) < 1e-9, "the same path as find_path's"
        return took_s

    return timed(once, lambda took_s: took_s)


def node_of(lattice: Lattice, point_cm: tuple[float, float]) -> int:
    """Return the node at a point that is one."""
    return node_at(lattice, round(point_cm[0] / lattice.cell_cm), round(point_cm[1] / lattice.cell_cm))


def length_of(lattice: Lattice, nodes: NDArray[np.int64]) -> float:
    """Return the length of a path of nodes in cm."""
    y, x = np.divmod(nodes, lattice.width)
    return float(lattice.cell_cm * np.hypot(np.diff(x), np.diff(y)).sum())


def measure_peers(scene: Scene, free_map: FreeMap) -> tuple[list[Cells], float]:
    """Time other searches on the 8-neighbour graph of free nodes; return their rows and dijkstra's milliseconds."""
    began_s = process_time()
    graph, number = eight_neighbour_graph(free_map)
    build_ms = 1e3 * (process_time() - began_s)
    start, goal = (number[index_of(free_map, point)] for point in (scene.task.start_cm, scene.task.goal_cm))
    reference_ms = median_ms(lambda: dijkstra(graph, indices=start))
    length_cm = float(dijkstra(graph, indices=start)[goal])
    nodes = str(graph.shape[0])
    rows: list[Cells] = [
        ("scipy: making it", "nodes", "", nodes, "", digits(build_ms), ""),
        ("scipy: dijkstra", "nodes", f"{length_cm:.4f}", nodes, "", digits(reference_ms), "1.00"),
    ]
    if importlib.util.find_spec("networkx") is None:
        rows.append(("networkx: missing", "", "", "", "", "", ""))
    else:
        found_ms, length_cm = networkx_a_star(graph, free_map, number, start, goal)
        ratio = digits(reference_ms / found_ms)
        rows.append(("networkx: A*", "nodes", f"{length_cm:.4f}", "", "", digits(found_ms), ratio))
    return rows, reference_ms


def index_of(free_map: FreeMap, point_cm: tuple[float, float]) -> tuple[int, int]:
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


def networkx_a_star(
    graph: csr_matrix, free_map: FreeMap, number: NDArray[np.int64], start: int, goal: int
) -> tuple[float, float]:
    """Return milliseconds and length of networkx's A* with the straight distance as heuristic; its graph is built."""
    networkx: Any = importlib.import_module("networkx")
    rows, columns = np.nonzero(number >= 0)
    place = np.stack((free_map.x_cm[columns], free_map.y_cm[rows]), axis=1).tolist()
    joined = networkx.from_scipy_sparse_array(graph, edge_attribute="weight")

    def distance_cm(a: int, b: int) -> float:
        return hypot(place[a][0] - place[b][0], place[a][1] - place[b][1])

    def search() -> Any:  # noqa: ANN401 - a list of nodes of an untyped library
        return networkx.astar_path(joined, start, goal, heuristic=distance_cm, weight="weight")

    return median_ms(search), float(networkx.path_weight(joined, search(), "weight"))


def digits(value: float) -> str:
    """Return three digits that count, large numbers whole."""
    return f"{value:.3g}" if value < 100.0 else f"{value:.0f}"


def median_ms(work: Callable[[], object]) -> float:
    """Return the median wall time of some runs in milliseconds; the first is not counted."""

    def once() -> float:
        began_s = process_time()
        work()
        return process_time() - began_s

    return 1e3 * median(timed(once, lambda took_s: took_s))


def timed(work: Callable[[], Any], seconds: Callable[[Any], float]) -> list[float]:
    """Run until the budget is used up; the first run is not counted unless it is a long one."""
    began_s = process_time()
    first_s = seconds(work())
    if process_time() - began_s > LONG_S:
        return [first_s]
    began_s, took_s = process_time(), list[float]()
    while len(took_s) < LEAST_RUNS or (len(took_s) < MOST_RUNS and process_time() - began_s < BUDGET_S):
        took_s.append(seconds(work()))
    return took_s


if __name__ == "__main__":
    main()
