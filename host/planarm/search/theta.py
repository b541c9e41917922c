"""Theta* and Lazy Theta*: any-angle paths by letting a node's predecessor be any node in sight of it.

Sources: Daniel, Nash, Koenig and Felner, Theta*: Any-Angle Path Planning on Grids, JAIR 39 (2010); Nash, Koenig and
Tovey, Lazy Theta*, AAAI 2010. Neither finds the shortest any-angle path for sure; they stand beside the default.
"""

from math import inf

import numpy as np
from numpy.typing import NDArray

from planarm.search.best_first import Found, Rules
from planarm.search.heap import insert, remove_first
from planarm.search.legal import SHUT, Lattice, Moves, move_is_legal
from planarm.search.open_list import NONE
from planarm.search.sight import in_sight
from planarm.search.taut import leg_cells
from planarm.workspace.world import ArmWorld
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def theta_star(
    lattice: Lattice, moves: Moves, rules: Rules, world: ArmWorld, start: int, goal: int, *, lazy: bool
) -> Found:
    """Search a path between two free nodes whose legs are in sight; arguments as for `best_first`."""
    before, expanded, generated = _search(lattice, moves, rules, world, start, goal, lazy)
    nodes = [goal] if before[goal] != NONE else []
    while nodes and nodes[-1] != start:
        nodes.append(int(before[nodes[-1]]))
    return Found(np.array(nodes[::-1], np.int64), expanded, generated)


@kernel
def _search(
    lattice: Lattice, moves: Moves, rules: Rules, world: ArmWorld, start: int, goal: int, lazy: bool
) -> tuple[Ints, int, int]:
    """Return each node's predecessor (the start's is itself), nodes expanded, entries made."""
    room, width, jump = lattice.room, lattice.width, moves.jump
    before, g, closed = np.full(room.size, NONE), np.full(room.size, inf), np.zeros(room.size, np.bool_)
    heap_f, heap_node, size = np.empty(1024), np.empty(1024, np.int64), 1
    goal_x, goal_y = float(goal % width), float(goal // width)
    heap_f[0], heap_node[0], before[start], g[start] = 0.0, start, start, 0.0
    expanded, generated = 0, 1
    while size > 0:
        node = heap_node[0]
        size = remove_first(heap_f, heap_node, size)
        if closed[node]:
            continue
        x, y, parent = float(node % width), float(node // width), before[node]
        if (
            lazy
            and parent != node
            and not in_sight(lattice, world, rules.legal, float(parent % width), float(parent // width), x, y)
        ):
            g[node], before[node] = inf, NONE
            for k in range(jump.size):
                source = node - jump[k]
                through = g[source] + np.sqrt(float(moves.dx[k] ** 2 + moves.dy[k] ** 2))
                if closed[source] and through < g[node] and move_is_legal(lattice, moves, rules.legal, world, node, k):
                    g[node], before[node] = through, source
            if before[node] == NONE:
                continue
        closed[node] = True
        expanded += 1
        if node == goal:
            break
        parent = before[node]
        parent_x, parent_y = float(parent % width), float(parent // width)
        for k in range(jump.size):
            to = node + jump[k]
            if room[to] == SHUT or closed[to] or not move_is_legal(lattice, moves, rules.legal, world, to, k):
                continue
            to_x, to_y = x + moves.dx[k], y + moves.dy[k]
            source, through = parent, g[parent] + leg_cells(parent_x, parent_y, to_x, to_y)
            if not lazy and not in_sight(lattice, world, rules.legal, parent_x, parent_y, to_x, to_y):
                source, through = node, g[node] + leg_cells(x, y, to_x, to_y)
            if through < g[to] - 1e-9:
                g[to], before[to] = through, source
                if size == heap_f.size:
                    heap_f, heap_node = np.append(heap_f, heap_f), np.append(heap_node, heap_node)
                insert(heap_f, heap_node, size, through + leg_cells(to_x, to_y, goal_x, goal_y), to)
                size += 1
                generated += 1
    if not closed[goal]:
        before[goal] = NONE
    return before, expanded, generated
