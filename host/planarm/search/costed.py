"""Search for the least joint travel, or the least time at the joints' top speeds, on the nodes of a map.

A move costs what lies between the poses at its ends: the length of the way in the space of the two angles, or the time
that the slower joint takes for its share. Both are distances between poses, so the one to the goal is a consistent
heuristic of A* and no node is expanded twice. As everywhere, the moves are straight for the tip, and legal or not.
"""

from math import acos, hypot, inf, isnan, nan, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.search.best_first import Found, Rules
from planarm.search.heap import insert, remove_first
from planarm.search.legal import SHUT, Lattice, Moves, move_is_legal, node_cm
from planarm.search.open_list import NONE
from planarm.workspace.world import ArmWorld, cos_beta_at, theta1_at, theta2_at
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SHARE_OF_OTHER = 1e-3
"""What the way in joint space counts beside time, in s/rad: of equally fast moves the shorter one is taken."""


class Price(NamedTuple):
    """What a way costs: rad_weight times its length in joint space, and the slowest joint's time."""

    rad_weight: float
    s_per_rad_1: float
    s_per_rad_2: float
    """0 where time does not count."""


JOINT_TRAVEL = Price(1.0, 0.0, 0.0)


def time_price(speeds_rad_s: tuple[float, float]) -> Price:
    """Return the price of time for the joints' largest speeds."""
    return Price(SHARE_OF_OTHER, 1.0 / speeds_rad_s[0], 1.0 / speeds_rad_s[1])


def cheapest(
    lattice: Lattice, moves: Moves, rules: Rules, world: ArmWorld, start: int, goal: int, price: Price
) -> tuple[Found, float]:
    """Search the cheapest path between two free nodes; arguments as for `best_first`. Return it and its cost."""
    before, cost, expanded, generated = _search(lattice, moves, rules, world, start, goal, price)
    nodes = [goal] if cost < inf else []
    while nodes and nodes[-1] != start:
        nodes.append(int(before[nodes[-1]]))
    return Found(np.array(nodes[::-1], np.int64), expanded, generated), float(cost)


@kernel
def _search(
    lattice: Lattice, moves: Moves, rules: Rules, world: ArmWorld, start: int, goal: int, price: Price
) -> tuple[Ints, float, int, int]:
    """Return each node's predecessor, the cost of the way to the goal, nodes expanded, entries made."""
    room, jump = lattice.room, moves.jump
    before, g, closed = np.full(room.size, NONE), np.full(room.size, inf), np.zeros(room.size, np.bool_)
    first, second = np.full(room.size, nan), np.empty(room.size)
    heap_f, heap_node, size = np.empty(1024), np.empty(1024, np.int64), 1
    heap_f[0], heap_node[0], g[start] = 0.0, start, 0.0
    fill_pose(lattice, world, start, first, second)
    fill_pose(lattice, world, goal, first, second)
    expanded, generated = 0, 1
    while size > 0:
        node = heap_node[0]
        size = remove_first(heap_f, heap_node, size)
        if closed[node]:
            continue
        closed[node] = True
        expanded += 1
        if node == goal:
            break
        for k in range(jump.size):
            to = node + jump[k]
            if room[to] == SHUT or closed[to]:
                continue
            fill_pose(lattice, world, to, first, second)
            through = g[node] + price_of(price, first[to] - first[node], second[to] - second[node])
            if through >= g[to] or not move_is_legal(lattice, moves, rules.legal, world, to, k):
                continue
            g[to], before[to] = through, node
            if size == heap_f.size:
                heap_f, heap_node = np.append(heap_f, heap_f), np.append(heap_node, heap_node)
            ahead = price_of(price, first[goal] - first[to], second[goal] - second[to])
            insert(heap_f, heap_node, size, through + ahead, to)
            size += 1
            generated += 1
    return before, g[goal] if closed[goal] else inf, expanded, generated


@kernel
def price_of(price: Price, d1: float, d2: float) -> float:
    """Return what turning the joints by d1 and d2 costs."""
    return price.rad_weight * hypot(d1, d2) + max(abs(d1) * price.s_per_rad_1, abs(d2) * price.s_per_rad_2)


@kernel
def fill_pose(lattice: Lattice, world: ArmWorld, node: int, first: Floats, second: Floats) -> None:
    """Fill a node's joint angles where they are not known."""
    if not isnan(first[node]):
        return
    x, y = node_cm(lattice, node)
    arm = world.arm
    dx, dy = x - arm.base_x_cm, y - arm.base_y_cm
    r = sqrt(dx * dx + dy * dy)
    first[node], second[node] = theta1_at(arm, x, y, acos(cos_beta_at(arm, r))), theta2_at(arm, r)
