"""What a path's length is held against: the exact any-angle optimum on small maps, a proven lower bound on all."""

from math import dist, inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planarm.scene import PlannerSpec
from planarm.search.endpoints import JOIN_CELLS, Endpoint
from planarm.search.lattice import make_lattice, node_at, nodes_cm
from planarm.search.legal import CELLS, PROOF, Lattice
from planarm.search.optimum import BORDER, MOST_ASKED, MOST_NODES, Told, lower_bound_cells, optimal_nodes
from planarm.search.path import Path
from planarm.workspace.free_map import FreeMap

SMALL_MAP: Final = 5_000
"""Free nodes up to which a taut path is held against the optimum itself."""

NEAR_OPTIMAL: Final = ("taut", "any_angle")
"""Planners whose paths are short enough that the optimum is found fast from them."""

_INEXACT: Final = "This path, pulled taut, is not known to be the exact any-angle optimum"
_CELL: Final = "workspace.cell_cm"

ASIDE: Final = JOIN_CELLS + 3
"""Rows and columns by which a leg from a point that is no node may lie beside one from the node it is joined to."""


def optimal_path(
    free_map: FreeMap, path: Path, start: Endpoint, goal: Endpoint, planner: PlannerSpec, told: Told | None = None
) -> tuple[Path, str]:
    """Return the shortest chain of legs in sight between the nodes of start and goal, and a note where it is not known.

    The known path is returned where it is the shortest, and where the note says why no answer was looked for.

    Args:
        free_map: where to look.
        path: a known path.
        start: where it begins; only from node to node there is an exact answer.
        goal: where it ends.
        planner: moves "cells" or "proved".
        told: told the share that is done, of a search that takes long.
    """
    if len(path.points_cm) == 1:
        return path, ""
    if not (start.on_node and goal.on_node):
        return (
            path,
            f"{_INEXACT}: start or goal is no node; put both on multiples of {_CELL}.",
        )
    lattice = make_lattice(free_map, BORDER)
    nodes = _better(lattice, free_map, path, (start, goal), planner, MOST_ASKED, told)
    if nodes is None:
        return path, f"{_INEXACT}: a shorter one may pass more than {MOST_ASKED:,} nodes; take a larger {_CELL}."
    return (Path.through(nodes_cm(lattice, nodes), free_map.elbow) if len(nodes) else path), ""


def path_bound_cm(free_map: FreeMap, path: Path, start: Endpoint, goal: Endpoint, planner: PlannerSpec) -> float:
    """Return a length in cm that no path on this map with the same rule for moves falls short of.

    With moves = "nodes" hops of any length are paths, so only the straight line bounds them.
    """
    straight_cm = dist(path.points_cm[0], path.points_cm[-1])
    if planner.moves == "nodes" or len(path.points_cm) == 1:
        return straight_cm
    on_nodes = start.on_node and goal.on_node
    aside = 1 if on_nodes else ASIDE
    lattice = make_lattice(free_map, BORDER - 1 + aside)
    if on_nodes and free_map.free_nodes <= SMALL_MAP and planner.algorithm in NEAR_OPTIMAL:
        better = _better(lattice, free_map, path, (start, goal), planner, MOST_NODES)
        if better is not None:
            best = Path.through(nodes_cm(lattice, better), free_map.elbow) if len(better) else path
            return max(straight_cm, best.length_cm)
    ends = [node_at(lattice, end.column, end.row) for end in (start, goal)]
    cells = lower_bound_cells(lattice, free_map.world, ends[0], ends[1], aside)
    joins_cm = sum(_join_cm(free_map, end) for end in (start, goal))
    return max(straight_cm, cells * free_map.cell_cm - joins_cm) if cells < inf else straight_cm


def _better(
    lattice: Lattice,
    free_map: FreeMap,
    path: Path,
    ends: tuple[Endpoint, Endpoint],
    planner: PlannerSpec,
    most_nodes: int,
    told: Told | None = None,
) -> NDArray[np.int64] | None:
    first, last = (node_at(lattice, end.column, end.row) for end in ends)
    legal = PROOF if planner.moves == "proved" else CELLS
    known_cells = path.length_cm / free_map.cell_cm
    return optimal_nodes(lattice, free_map.world, legal, (first, last), known_cells, most_nodes, told)


def _join_cm(free_map: FreeMap, end: Endpoint) -> float:
    node_cm = end.column * free_map.cell_cm, end.row * free_map.cell_cm
    return 0.0 if end.on_node else dist(end.point_cm, node_cm)
