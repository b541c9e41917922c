"""How good a path is: a proven lower bound of every path's length, and the exact any-angle optimum on small maps.

Every path that a planner may give is a chain of legs in sight between free nodes (`planarm.search.sight`).

**The bound.** Let a leg run between two neighbouring directions of the stencil with 80 nodes. Moves in these two
directions lead from its one end to its other along it, never more than one cell aside, so each node they pass has a
cell that the leg crosses among itself and its eight neighbours. The nodes of those cells are free; or the leg is short
and a move, or a chain of equal moves, itself. So on the nodes at most one row and column from a free one, with moves
checked at their ends only, there is a way that is longer than the leg by at most 1 / cos(a / 2), a the largest angle
between neighbouring directions. The shortest way on that graph, divided by this, is no longer than any chain of legs.

**The optimum.** Only a node v with bound(start, v) + bound(v, goal) below the length of a path that is known can lie
on a shorter one. Between those few nodes A* looks at all legs in sight. What it finds is the shortest path of all; if
it finds nothing, the known one is.
"""

from collections.abc import Callable
from math import cos, hypot, inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planarm.search.best_first import Rules, best_first, flood
from planarm.search.costs import UNITS_PER_CELL
from planarm.search.lattice import make_moves, near_room, open_room
from planarm.search.legal import NODES, ROOM, Lattice
from planarm.search.open_list import NONE
from planarm.search.sight import in_sight
from planarm.search.stencils import primitive, stencil
from planarm.search.taut import leg_cells
from planarm.workspace.world import ArmWorld
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_STENCIL: Final = stencil("chs", 80)
REACH: Final = 5
BORDER: Final = REACH + 1
"""Border that a lattice needs for the bound."""

SHORTER_CELLS: Final = 1e-7
"""What counts as shorter: beyond the rounding of costs."""

MOST_NODES: Final = 3000
"""Between more nodes than these the optimum is not looked for to bound a path."""

MOST_ASKED: Final = 20_000
"""Nor between more than these when it is asked for: that may take two minutes."""

Told = Callable[[float], None]
"""Told the share of a search that is done, 0 to 1."""

LOOKS_A_TURN: Final = 1_000_000
"""After so many legs looked at, a fraction of a second, the search tells how far it is."""


def excess() -> float:
    """Return how much longer than a straight line a way on the stencil with 80 nodes is in the open, at most."""
    angles = np.sort(np.arctan2(*primitive(_STENCIL).astype(np.float64).T))
    return 1.0 / cos(0.5 * float(np.diff(angles).max()))


def lower_bound_cells(lattice: Lattice, world: ArmWorld, start: int, goal: int, aside: int = 1) -> float:
    """Return a length in cells that no chain of legs in sight between two free nodes falls short of; inf for no chain.

    Args:
        lattice: the map with a border of at least REACH + aside.
        world: the arm; not looked at.
        start: a node.
        goal: a node.
        aside: rows and columns by which moves along a leg may lie beside the cells it crosses.
    """
    near = near_room(lattice, aside)
    moves = make_moves(_STENCIL, near)
    found = best_first(near, moves, Rules(NODES, 0, 0), world, start, goal, open_room(near, REACH, ROOM))
    if not len(found.nodes):
        return inf
    y, x = np.divmod(found.nodes, lattice.width)
    straight = hypot(x[-1] - x[0], y[-1] - y[0])
    return max(straight, float(np.hypot(np.diff(x), np.diff(y)).sum()) / excess() - SHORTER_CELLS)


def optimal_nodes(
    lattice: Lattice,
    world: ArmWorld,
    legal: int,
    ends: tuple[int, int],
    known_cells: float,
    most_nodes: int,
    told: Told | None = None,
) -> Ints | None:
    """Return the shortest chain of legs in sight, empty when none is shorter than `known_cells`; None if it takes long.

    Args:
        lattice: the map with a border of at least BORDER.
        world: the arm, for proofs.
        legal: CELLS or PROOF, as in `planarm.search.best_first.Rules`.
        ends: a free node at the start, and one at the goal.
        known_cells: length of a known path; the longer it is, the longer this takes.
        most_nodes: with more nodes that a shorter path may pass, the answer is None.
        told: told the share of these nodes that is settled, now and then; it often ends before all are.
    """
    start, goal = ends
    near = near_room(lattice, 1)
    moves = make_moves(_STENCIL, near)
    from_start, to_goal = (flood(near, moves, world, node) / (UNITS_PER_CELL * excess()) for node in (start, goal))
    worth = (lattice.room != 0) & (from_start + to_goal < known_cells + SHORTER_CELLS)
    worth[[start, goal]] = True
    nodes = np.flatnonzero(worth)
    if len(nodes) > most_nodes:
        return None
    places = {int(node): place for place, node in enumerate(nodes)}
    y, x = np.divmod(nodes, lattice.width)
    goal_x, goal_y = goal % lattice.width, goal // lattice.width
    ahead = np.maximum(to_goal[nodes], np.hypot(x - goal_x, y - goal_y))
    x_cells, y_cells = x.astype(float), y.astype(float)
    g, before, closed = np.full(len(nodes), inf), np.full(len(nodes), NONE), np.zeros(len(nodes), np.bool_)
    g[places[start]] = 0.0
    state, turns, slow = (g, before, closed), 1 + LOOKS_A_TURN // len(nodes), False
    while not _search(lattice, world, legal, x_cells, y_cells, ahead, places[goal], known_cells, state, turns):
        slow = True
        if told is not None:
            told(float(closed.mean()))
    if slow and told is not None:
        told(1.0)
    chain = [places[goal]]
    while before[chain[-1]] != NONE:
        chain.append(int(before[chain[-1]]))
    return nodes[chain[::-1]] if chain[-1] == places[start] and len(chain) > 1 else nodes[:0]


@kernel
def _search(
    lattice: Lattice,
    world: ArmWorld,
    legal: int,
    x: Floats,
    y: Floats,
    ahead: Floats,
    goal: int,
    known_cells: float,
    state: tuple[Floats, Ints, NDArray[np.bool_]],
    turns: int,
) -> bool:
    """Go on with A* over all legs in sight between the points (x, y); `ahead` bounds the way to the goal.

    Settle so many points at most, in `state`: costs, predecessors, what is settled. Return whether that was all.
    """
    count = x.size
    g, before, closed = state
    for _ in range(turns):
        node, lowest = NONE, known_cells - SHORTER_CELLS
        for i in range(count):
            if not closed[i] and g[i] + ahead[i] < lowest:
                node, lowest = i, g[i] + ahead[i]
        if node in (NONE, goal):
            return True
        closed[node] = True
        for i in range(count):
            through = g[node] + leg_cells(x[node], y[node], x[i], y[i])
            if closed[i] or through >= g[i] or through + ahead[i] >= known_cells - SHORTER_CELLS:
                continue
            if in_sight(lattice, world, legal, x[node], y[node], x[i], y[i]):
                g[i], before[i] = through, node
    return False
