"""The one best-first search of all four planners, on flat arrays.

A* (paper C, eq. 10): the open node with the least f = g + h is expanded, g the length from the start, h the straight
distance to the goal. No move is shorter than the straight line it makes, so h is consistent and a closed node is
final. Where the pseudo-code of paper C (figs. 3, 5, 7 and 9) never improves a node that is already open, this search
does; without that the result is not the shortest path of the graph.

Whether a move is legal is asked late, as in Lazy Weighted A* (described with its kin by Mandalika, Salzman and
Srinivasa, Lazy Receding Horizon A*, ICAPS 2018): only of the move by which a node was reached best, when the node
comes up for expansion. If that move is not legal, the next best way to the node from the closed ones takes its place.
The result is the shortest path on the graph of legal moves, and few moves have to be proved.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.search.draw import draw_subset
from planarm.search.open_list import BUCKET, MADE, NONE, WAITING, OpenList, make_open_list, pop, with_more_room
from planarm.workspace.proof import PROVED, prove_line
from planarm.workspace.world import ArmWorld
from planarm_wire.kernel_cache import kernel

UNSEEN = 0
START = 255
"""Values of `came_by` beside 1 + the move by which a node was reached."""

FULL = -2
"""What `expand` returns when the open list may run out of room."""

BUCKETS_PER_CELL = 16.0
"""Width of the open list's buckets: found by measurement; it changes speed, never a result."""

FIRST_CAPACITY = 4096


class Lattice(NamedTuple):
    """The nodes row by row, with a border as wide as the longest move so that no move leaves the arrays.

    A node is known by its place in these arrays.
    """

    shut: NDArray[np.uint8]
    """1 for a node that is not to be entered: not free, border, or closed by the search."""
    whole: NDArray[np.uint8]
    """1 where every pose with the tip in the cell is free."""
    width: int
    """Nodes in a row."""
    column: int
    """x of node 0 in cells: a node in its column is at x = column * cell_cm."""
    row: int
    """y of node 0 in cells."""
    cell_cm: float


class Moves(NamedTuple):
    """The stencil, one value for each move."""

    dx: NDArray[np.int64]
    dy: NDArray[np.int64]
    jump: NDArray[np.int64]
    """What the move adds to a node's place in the lattice."""
    length_cm: NDArray[np.float64]
    cover_first: NDArray[np.int64]
    """Where the move's cells begin in `cover`; one value more than there are moves."""
    cover: NDArray[np.int64]
    """The cells that each move crosses, relative to the node that it leaves."""


class Rules(NamedTuple):
    """How moves are chosen and checked."""

    proved: bool
    """True: the whole straight move must be proved free. False: the node it leads to must be free."""
    drawn: int
    """Moves drawn at random at each expanded node, or 0 to use all."""
    seed: int


class Found(NamedTuple):
    """What a search leaves behind."""

    nodes: list[int]
    """The path from start to goal; empty when there is none."""
    expanded: int
    """Nodes taken from the open list and closed, the goal included."""
    generated: int
    """Entries put on the open list: nodes reached for the first time or by a shorter way."""


def best_first(lattice: Lattice, moves: Moves, rules: Rules, world: ArmWorld, start: int, goal: int) -> Found:
    """Search a shortest path between two free nodes; `lattice.shut` is used up.

    Of several entries with equal f the newest is expanded first; of several equally short ways to a node the first
    one found is kept. With the order of the moves fixed, so is the path.
    """
    longest_cm = float(moves.length_cm.max())
    queue = make_open_list(2.0 * longest_cm / lattice.cell_cm * BUCKETS_PER_CELL, FIRST_CAPACITY)
    g_cm = np.empty(lattice.shut.size)
    came_by = np.zeros(lattice.shut.size, np.uint8)
    live = np.empty(lattice.shut.size, np.int64)
    h_cm = _distance_cm(lattice, start, goal)
    g_cm[start], came_by[start], live[start] = 0.0, START, 0
    queue.f_cm[0], queue.node[0], queue.below[0] = h_cm, start, NONE
    queue.ring[0], queue.counts[MADE], queue.counts[WAITING] = 0, 1, 1
    expanded = 0
    while True:
        last, expanded = expand(lattice, moves, rules, world, goal, h_cm, g_cm, came_by, live, queue, expanded)
        if last != FULL:
            nodes = _trace(came_by, moves.jump, goal) if last == goal else []
            return Found(nodes, expanded, int(queue.counts[MADE]))
        queue = with_more_room(queue)


@kernel
def expand(
    lattice: Lattice,
    moves: Moves,
    rules: Rules,
    world: ArmWorld,
    goal: int,
    lowest_f_cm: float,
    g_cm: NDArray[np.float64],
    came_by: NDArray[np.uint8],
    live: NDArray[np.int64],
    queue: OpenList,
    expanded: int,
) -> tuple[int, int]:
    """Expand nodes until the goal is closed; return (goal, or NONE if it cannot be reached, or FULL; nodes expanded).

    `g_cm` and `came_by` say how a node was reached best, `live` its entry on the open list; of a closed node `live`
    is -2 less its turn: never an entry, and the smaller the later.
    """
    shut, width, cell_cm = lattice.shut, lattice.width, lattice.cell_cm
    dx, dy, jump, length_cm = moves.dx, moves.dy, moves.jump, moves.length_cm
    f_cm, queued, below, heap, ring, counts = queue
    goal_x, goal_y = goal % width, goal // width
    every, only = np.arange(jump.size), np.empty(1, np.int64)
    while counts[MADE] + jump.size <= f_cm.size:
        node = pop(f_cm, queued, below, heap, ring, counts, live)
        if node == NONE:
            return NONE, expanded
        if not rules.proved or came_by[node] == START or move_is_free(lattice, moves, world, node, came_by[node] - 1):
            shut[node], live[node] = 1, -2 - expanded
            expanded += 1
            if node == goal:
                return goal, expanded
            source, order, used = node, every, jump.size
            if rules.drawn > 0:
                used = rules.drawn
                draw_subset(order, used, rules.seed, 1 + node)
        else:
            only[0] = next_best_move(lattice, moves, rules, node, g_cm, came_by, live, every)
            came_by[node] = UNSEEN
            if only[0] == NONE:
                continue
            source, order, used = node - jump[only[0]], only, 1
        x, y, from_g_cm = source % width - goal_x, source // width - goal_y, g_cm[source]
        for i in range(used):
            k = order[i]
            to, to_g_cm = source + jump[k], from_g_cm + length_cm[k]
            if shut[to] or (came_by[to] != UNSEEN and to_g_cm >= g_cm[to]):
                continue
            to_f_cm = to_g_cm + cell_cm * sqrt(float((x + dx[k]) * (x + dx[k]) + (y + dy[k]) * (y + dy[k])))
            bucket = int((to_f_cm - lowest_f_cm) / cell_cm * BUCKETS_PER_CELL)
            place = max(bucket, counts[BUCKET]) & (ring.size - 1)  # below the current bucket only by rounding
            entry = counts[MADE]
            g_cm[to], came_by[to], live[to] = to_g_cm, 1 + k, entry
            f_cm[entry], queued[entry], below[entry] = to_f_cm, to, ring[place]
            ring[place] = entry
            counts[MADE] += 1
            counts[WAITING] += 1
    return FULL, expanded


@kernel
def next_best_move(
    lattice: Lattice,
    moves: Moves,
    rules: Rules,
    node: int,
    g_cm: NDArray[np.float64],
    came_by: NDArray[np.uint8],
    live: NDArray[np.int64],
    scratch: NDArray[np.int64],
) -> int:
    """Return the best move from a closed node to an open one after the move by which it was reached, or NONE.

    Ways are ordered as the search finds them: by their length, then by the turn in which the node before was closed.
    """
    failed = node - moves.jump[came_by[node] - 1]
    failed_g_cm, failed_live = g_cm[node], live[failed]
    best, best_g_cm, best_live = NONE, inf, 0
    for k in range(moves.jump.size):
        source = node - moves.jump[k]
        if not lattice.shut[source] or came_by[source] == UNSEEN:  # open, or never free
            continue
        through_g_cm = g_cm[source] + moves.length_cm[k]
        tried = through_g_cm < failed_g_cm or (through_g_cm == failed_g_cm and live[source] >= failed_live)
        worse = through_g_cm > best_g_cm or (through_g_cm == best_g_cm and live[source] < best_live)
        if tried or worse:
            continue
        if rules.drawn > 0:
            draw_subset(scratch, rules.drawn, rules.seed, 1 + source)
            if not np.any(scratch[: rules.drawn] == k):
                continue
        best, best_g_cm, best_live = k, through_g_cm, live[source]
    return best


@kernel
def move_is_free(lattice: Lattice, moves: Moves, world: ArmWorld, to: int, move: int) -> bool:
    """Tell whether all poses of a move to the node `to` are free: all cells crossed are, or the line is proved."""
    node = to - moves.jump[move]
    for crossed in range(moves.cover_first[move], moves.cover_first[move + 1]):
        if not lattice.whole[node + moves.cover[crossed]]:
            return line_is_free(lattice, world, node, to)
    return True


@kernel
def line_is_free(lattice: Lattice, world: ArmWorld, a: int, b: int) -> bool:
    """Tell whether all poses of the straight move between two nodes are proved free; both directions agree."""
    if b < a:  # the proof divides the line from its first end: fix which one that is
        a, b = b, a
    x0, y0 = node_cm(lattice, a)
    x1, y1 = node_cm(lattice, b)
    verdict, _ = prove_line(world, x0, y0, x1, y1)
    return verdict == PROVED


@kernel
def node_cm(lattice: Lattice, node: int) -> tuple[float, float]:
    """Return the (x, y) of a node."""
    x = (lattice.column + node % lattice.width) * lattice.cell_cm
    y = (lattice.row + node // lattice.width) * lattice.cell_cm
    return x, y


def load_kernels(world: ArmWorld) -> None:
    """Compile the search, or load it from the cache, by a search from a node to itself."""
    nothing = np.zeros(1, np.uint8)
    one, first = np.ones(1, np.int64), np.zeros(2, np.int64)
    lattice = Lattice(nothing, nothing, width=1, column=0, row=0, cell_cm=1.0)
    moves = Moves(one, one, one, np.ones(1), first, one)
    best_first(lattice, moves, Rules(proved=True, drawn=0, seed=0), world, 0, 0)


def _distance_cm(lattice: Lattice, a: int, b: int) -> float:
    dx, dy = a % lattice.width - b % lattice.width, a // lattice.width - b // lattice.width
    return lattice.cell_cm * sqrt(float(dx * dx + dy * dy))


def _trace(came_by: NDArray[np.uint8], jump: NDArray[np.int64], goal: int) -> list[int]:
    """Walk back from the goal; return the nodes from the start on."""
    nodes = [goal]
    while came_by[nodes[-1]] != START:
        nodes.append(nodes[-1] - int(jump[came_by[nodes[-1]] - 1]))
    return nodes[::-1]
