"""Path planning on the free Cartesian space: A*, Modified A*, Chaos A* and CHS (paper C, sections IV to VII).

One search for all four; they differ in the stencil (`planarm.search.stencils`), and Chaos A* in using a random subset
of it. With `moves = "proved"` every straight move between nodes is proved free for the whole arm; with "cells" the
nodes of all cells it crosses are checked, with "nodes" only the node at its end, which is how the papers read. A path
that is not proved may pass through obstacles.
"""

from dataclasses import replace
from time import perf_counter
from typing import Final

import numpy as np

from planarm.scene import Moves, PlannerSpec, Point
from planarm.search.best_first import Found, Rules, best_first, load_kernels
from planarm.search.bound import optimal_path, path_bound_cm
from planarm.search.costed import Price, cheapest
from planarm.search.draw import draw_subset
from planarm.search.endpoints import ON_NODE_CM, Endpoint, endpoint
from planarm.search.lattice import make_lattice, make_moves, node_at, nodes_cm, open_room
from planarm.search.legal import CELLS, NODES, PROOF, ROOM, WHOLE_ROOM, Lattice
from planarm.search.optimum import Told
from planarm.search.path import Path
from planarm.search.result import SearchResult, SearchStatus
from planarm.search.stencils import DRAWN, Offsets, primitive, stencil
from planarm.search.taut import pull_taut
from planarm.search.theta import theta_star
from planarm.workspace.free_map import FreeMap

LEGAL: Final[dict[Moves, int]] = {"nodes": NODES, "cells": CELLS, "proved": PROOF}
PULLED: Final = ("taut", "any_angle")
THETA: Final = ("theta_star", "lazy_theta_star")
PRICED: Final = ("a_star", "modified_a_star", "chs", "taut", "any_angle")
"""Algorithms that can search by another price than length: those that use a whole stencil."""
NO_OPTIMUM: Final = (
    "This path is CHS's: an exact any-angle optimum is one of length, over moves that are checked all along "
    '(planner.objective = "length", planner.moves = "proved" or "cells").'
)

FEW_MOVES: Final = 8
"""With no more moves than this the search looks itself for where not all have to be tried."""


def find_path(
    free_map: FreeMap,
    start_cm: Point,
    goal_cm: Point,
    planner: PlannerSpec,
    price: Price | None = None,
    told: Told | None = None,
) -> SearchResult:
    """Search a shortest path of the end effector from start to goal on the map's nodes.

    A start or goal that is no node is joined to the nearest free node that a proved straight move leads to, whatever
    `planner.moves` says. With a price the cheapest path is searched instead, by the algorithms in PRICED; it is not
    pulled taut, which would shorten it and make it dearer. A search for the any-angle optimum that takes long tells
    `told` the share that is done.

    Raises:
        ValueError: the planner's algorithm has no such neighbourhood.
    """
    offsets = stencil(planner.algorithm, planner.neighbours)
    load_kernels(free_map.world)
    begin_s = perf_counter()
    start = endpoint(free_map, "start", start_cm)
    goal = endpoint(free_map, "goal", goal_cm)
    for end, status in ((start, SearchStatus.START_BLOCKED), (goal, SearchStatus.GOAL_BLOCKED)):
        if end.problem:
            return SearchResult(status, end.problem, None, 0, 0, perf_counter() - begin_s)
    lattice = make_lattice(free_map, border=int(np.abs(offsets).max()))
    priced = price is not None and planner.algorithm in PRICED
    if priced and price is not None:
        found, cost = _search_priced(free_map, lattice, offsets, planner, (start, goal), price)
    else:
        found, cost = _search(free_map, lattice, offsets, planner, start, goal), None
    if not len(found.nodes):
        reason = _why_no_path(free_map, offsets, planner, start, goal, found)
        took_s = perf_counter() - begin_s
        return SearchResult(SearchStatus.NO_PATH, reason, None, found.expanded, found.generated, took_s)
    path = _path(free_map, lattice, found, start, goal)
    if planner.algorithm in PULLED and planner.moves != "nodes" and not priced:
        path = _pulled(free_map, lattice, path, planner)
    note, exact = "", False
    if planner.algorithm == "any_angle":
        if planner.moves == "nodes" or priced:
            note = NO_OPTIMUM
        else:
            path, note = optimal_path(free_map, path, start, goal, planner, told)
            exact = not note
    took_s = perf_counter() - begin_s
    bound_cm = path.length_cm if exact else path_bound_cm(free_map, path, start, goal, planner)
    if note and note != NO_OPTIMUM:
        gap = path.length_cm / bound_cm - 1.0
        note += f" No path is shorter than {bound_cm:.4f} cm, so this one is at most {gap:.2%} longer."
    return SearchResult(SearchStatus.FOUND, "", path, found.expanded, found.generated, took_s, bound_cm, cost, note)


def _search_priced(
    free_map: FreeMap,
    lattice: Lattice,
    offsets: Offsets,
    planner: PlannerSpec,
    ends: tuple[Endpoint, Endpoint],
    price: Price,
) -> tuple[Found, float]:
    """Search the cheapest path from the start's node to the goal's; return it and its cost."""
    nodes = [node_at(lattice, end.column, end.row) for end in ends]
    rules = Rules(LEGAL[planner.moves], 0, 0)
    return cheapest(lattice, make_moves(offsets, lattice), rules, free_map.world, nodes[0], nodes[1], price)


def _search(
    free_map: FreeMap, lattice: Lattice, offsets: Offsets, planner: PlannerSpec, start: Endpoint, goal: Endpoint
) -> Found:
    """Search from the start's node to the goal's."""
    start_node, goal_node = (node_at(lattice, end.column, end.row) for end in (start, goal))
    if planner.algorithm in THETA:
        rules = Rules(LEGAL["cells" if planner.moves == "nodes" else planner.moves], 0, 0)
        lazy = planner.algorithm == "lazy_theta_star"
        return theta_star(
            lattice, make_moves(offsets, lattice), rules, free_map.world, start_node, goal_node, lazy=lazy
        )
    whole_stencil, drawn, wide_open, around = offsets, 0, None, 0
    if planner.algorithm == "chaos_a_star":
        drawn = DRAWN[planner.neighbours]
        if planner.subset == "run":
            offsets, drawn = _subset(offsets, drawn, planner.seed), 0
    else:
        if planner.moves != "nodes":
            offsets = primitive(offsets)
        least = WHOLE_ROOM if planner.moves == "proved" else ROOM
        if len(offsets) > FEW_MOVES:
            wide_open = open_room(lattice, int(np.abs(offsets).max()), least)
        else:
            around = least
    rules = Rules(LEGAL[planner.moves], drawn, planner.seed, around)
    moves = make_moves(offsets, lattice, whole_stencil)
    return best_first(lattice, moves, rules, free_map.world, start_node, goal_node, wide_open)


def _subset(offsets: Offsets, drawn: int, seed: int) -> Offsets:
    """Return the moves that Chaos A* draws for a whole run, in the stencil's order."""
    order = np.empty(len(offsets), np.int64)
    draw_subset(order, drawn, seed, 0)
    return offsets[np.sort(order[:drawn])]


def _path(free_map: FreeMap, lattice: Lattice, found: Found, start: Endpoint, goal: Endpoint) -> Path:
    """Return the path through the found nodes, with the joins to a start and goal that are no nodes."""
    if start.point_cm == goal.point_cm:
        return Path.through(np.array([start.point_cm]), free_map.elbow)
    points_cm = nodes_cm(lattice, found.nodes)
    if not start.on_node:
        points_cm = np.concatenate([[start.point_cm], points_cm])
    if not goal.on_node:
        points_cm = np.concatenate([points_cm, [goal.point_cm]])
    return Path.through(points_cm, free_map.elbow)


def _pulled(free_map: FreeMap, lattice: Lattice, path: Path, planner: PlannerSpec) -> Path:
    """Return the path pulled taut; its ends stay where they are."""
    origin = np.array([lattice.column, lattice.row])
    cells = path.points_cm / lattice.cell_cm - origin
    nodes = np.rint(cells)
    cells = np.where(np.abs(cells - nodes) <= ON_NODE_CM / lattice.cell_cm, nodes, cells)
    taut = (pull_taut(lattice, free_map.world, LEGAL[planner.moves], cells) + origin) * lattice.cell_cm
    taut[0], taut[-1] = path.points_cm[0], path.points_cm[-1]
    pulled = Path.through(taut, free_map.elbow)
    return pulled if pulled.length_cm < path.length_cm else path


def _why_no_path(
    free_map: FreeMap, offsets: Offsets, planner: PlannerSpec, start: Endpoint, goal: Endpoint, found: Found
) -> str:
    """Say what the search ran into, and which setting may help."""
    (x0, y0), (x1, y1) = start.point_cm, goal.point_cm
    text = (
        f"No path from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) cm: the moves of {planner.algorithm} with "
        f"{planner.neighbours} neighbours lead to {found.expanded} nodes and none further, at cells of "
        f"{free_map.cell_cm:g} cm and a margin of {free_map.margin_cm:g} cm."
    )
    if planner.algorithm == "chaos_a_star":
        return text + " The random subset of the neighbours may be to blame: try another planner.seed."
    if planner.moves != "nodes":
        lattice = make_lattice(free_map, border=int(np.abs(offsets).max()))
        if len(_search(free_map, lattice, offsets, replace(planner, moves="nodes"), start, goal).nodes):
            return text + (
                " The nodes do connect, but between some of them the arm's move is blocked, runs over a joint's limit, "
                "or has too little room for a proof: a smaller workspace.cell_cm or workspace.clearance_cm may help."
            )
    return text + " The free space around start and goal is not connected."
