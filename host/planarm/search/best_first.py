"""The one best-first search of all four planners, on flat arrays and in integers.

A* (paper C, eq. 10): open nodes are expanded in the order of f = g + h, g the length from the start, h the length of
the shortest way to the goal if nothing stood in between (`planarm.search.costs`), which is consistent. Where the
pseudo-code of paper C (figs. 3, 5, 7 and 9) never improves a node that is already open, this search does; without
that the result is not the shortest path of the graph.

Nodes wait in buckets of f and leave a bucket in no special order. So a node can be expanded before the best way to it
is known; it is then expanded again. All nodes below the current bucket are final, and the goal is when its bucket is
done with: the result is the shortest path all the same.

Whether a move is legal is asked late, as in Lazy Weighted A* (described with its kin by Mandalika, Salzman and
Srinivasa, Lazy Receding Horizon A*, ICAPS 2018): only of the move by which a node was reached best, when the node
comes up for expansion. If that move is not legal, the next best legal one from an expanded node takes its place, and
from then on moves to this node are checked at once. The result is the shortest path on the graph of legal moves, and
few moves have to be proved.

Where everything within a move's reach is open, a shortest path goes on in its direction or a neighbouring one: any
other turn has a shorter way round it. There the search looks at three moves, not at all.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.search.costs import norm
from planarm.search.draw import draw_subset
from planarm.search.legal import (
    NODES,
    PROOF,
    ROOM,
    SHUT,
    THREE,
    WHOLE_ROOM,
    Lattice,
    Moves,
    is_legal,
    memory_for,
    move_is_legal,
)
from planarm.search.open_list import (
    BEST,
    BUCKET,
    EXPANDED,
    MADE,
    NONE,
    WAITING,
    Indices,
    OpenList,
    buckets_for,
    make_open_list,
    twice_as_long,
)
from planarm.search.scratch import Scratch, borrow, give_back, with_more_entries
from planarm.workspace.world import ArmWorld
from planarm_wire.kernel_cache import kernel

REACHED, START, CHECKED = 3, 127, 128
"""The state of a node that was reached by move k is REACHED + k, that of the start START; CHECKED is added where a
move has been found not legal, so that all further ones are checked at once. Until then a node's state is its room."""

UNREACHED = 1 << 62
"""g where no way is known: even, like that of an expanded node, and larger than any."""

FULL = -2
"""What `expand` returns when the entries may run out of room."""

BUCKET_BITS = 35
"""A bucket is 2^35 units wide, a quarter of a cell: found by measurement; it changes speed, never a length."""


class Rules(NamedTuple):
    """How moves are chosen and checked."""

    legal: int
    """NODES, CELLS or PROOF."""
    drawn: int
    """Moves drawn at random at each expanded node, or 0 to use all."""
    seed: int
    around: int = 0
    """With the 8 nearest moves: where all nodes around one have this much room, only THREE are tried; 0: never."""


class Found(NamedTuple):
    """What a search leaves behind."""

    nodes: NDArray[np.int64]
    """The path from start to goal; empty when there is none."""
    expanded: int
    """Expansions, those of a node that was improved afterwards included."""
    generated: int
    """Entries put on the open list: nodes reached for the first time or by a shorter way."""


def best_first(
    lattice: Lattice,
    moves: Moves,
    rules: Rules,
    world: ArmWorld,
    start: int,
    goal: int,
    open_room: NDArray[np.uint8] | None = None,
) -> Found:
    """Search a shortest path between two free nodes.

    Ties are broken by the order of the moves and of the buckets, so the path is the same wherever it is searched.

    Args:
        lattice: where the nodes are.
        moves: the stencil on this lattice.
        rules: how moves are chosen and checked.
        world: the arm, for proofs.
        start: node to begin at.
        goal: node to reach.
        open_room: not 0 where all nodes within the longest move's reach are as free as `rules` asks
            (`lattice.open_room`); None looks at all moves everywhere.
    """
    wide_open = lattice.room[:0] if open_room is None else open_room
    memory = borrow(lattice.room.size)
    found, entries = _search(lattice, moves, rules, world, start, goal, wide_open, memory)
    give_back(memory._replace(entry_node=entries[0], entry_below=entries[1]))
    return Found(*found)


@kernel
def _search(
    lattice: Lattice,
    moves: Moves,
    rules: Rules,
    world: ArmWorld,
    start: int,
    goal: int,
    wide_open: NDArray[np.uint8],
    memory: Scratch,
) -> tuple[tuple[NDArray[np.int64], int, int], tuple[Indices, Indices]]:
    """Run a whole search in one call: on coarse maps a call from Python takes a fifth of the search's time.

    Returns:
        (what `Found` holds, the open list's entries: those of `memory`, or larger ones).
    """
    room, width, state, g = lattice.room, lattice.width, memory.state, memory.g
    for i in range(room.size):
        state[i] = room[i]
    node, below = memory.entry_node, memory.entry_below
    ring = np.full(buckets_for((2 * moves.longest >> BUCKET_BITS) + 2), NONE, np.int32)
    counts = np.zeros(5, np.int64)
    lowest_f = norm(moves.planes, start % width - goal % width, start // width - goal // width)
    state[start], g[start] = START, 1
    node[0], below[0], ring[0] = start, NONE, 0
    counts[MADE], counts[WAITING] = 1, 1
    while True:
        queue = OpenList(node, below, ring, counts)
        last = expand(lattice, moves, rules, world, goal, lowest_f, state, g, wide_open, queue)
        if last != FULL:
            break
        node, below = twice_as_long(node), twice_as_long(below)
    nodes = _trace(state, moves.jump, goal) if last == goal else np.empty(0, np.int64)
    return (nodes, counts[EXPANDED], counts[MADE]), (node, below)


def flood(lattice: Lattice, moves: Moves, world: ArmWorld, start: int) -> NDArray[np.float64]:
    """Return the cost of the shortest way from a node to every node, only nodes checked; inf where there is none."""
    everywhere = moves._replace(planes=np.zeros_like(moves.planes))
    memory = borrow(lattice.room.size)
    memory.state[: lattice.room.size] = lattice.room
    queue = make_open_list(2 * (moves.longest >> BUCKET_BITS) + 4, memory.entry_node, memory.entry_below)
    memory.state[start], memory.g[start] = START, 1
    queue.node[0], queue.below[0], queue.ring[0] = start, NONE, 0
    queue.counts[MADE], queue.counts[WAITING] = 1, 1
    rules, all_moves = Rules(NODES, 0, 0), lattice.room[:0]
    while expand(lattice, everywhere, rules, world, -1, 0, memory.state, memory.g, all_moves, queue) == FULL:
        memory = with_more_entries(memory)
        queue = queue._replace(node=memory.entry_node, below=memory.entry_below)
    reached = memory.state[: lattice.room.size] > WHOLE_ROOM
    costs = np.where(reached, memory.g[: lattice.room.size].astype(np.float64), np.inf)
    give_back(memory)
    return costs


@kernel
def expand(  # noqa: C901, PLR0912, PLR0915 - one flat loop: a call that hands on arrays costs more than expanding a node
    lattice: Lattice,
    moves: Moves,
    rules: Rules,
    world: ArmWorld,
    goal: int,
    lowest_f: int,
    state: NDArray[np.uint8],
    g: NDArray[np.int64],
    wide_open: NDArray[np.uint8],
    queue: OpenList,
) -> int:
    """Expand nodes until the goal's bucket is done with; return the goal, NONE if it cannot be reached, or FULL.

    After FULL it goes on where it was, the goal being reached or not, once the open list has more room.
    `g` is the cost of the best known way to a node, plus 1 as long as the node waits to be expanded.
    """
    room, width = lattice.room, lattice.width
    dx, dy, jump, cost, planes, after = moves.dx, moves.dy, moves.jump, moves.cost, moves.planes, moves.after
    near = memory_for(world) if rules.legal == PROOF else world.obstacles.first_vertex
    queued, below, ring, counts = queue
    mask, every, prune, around = ring.size - 1, jump.size, wide_open.size > 0, rules.around
    made, waiting, bucket, expanded = counts[MADE], counts[WAITING], counts[BUCKET], counts[EXPANDED]
    legal = rules.legal
    goal_x, goal_y, rows_per_node = goal % width, goal // width, 1.0 / width
    order = after[0].copy()
    best = counts[BEST] - 1 if counts[BEST] > 0 else UNREACHED
    result = NONE
    while waiting > 0:
        entry = ring[bucket & mask]
        if entry == NONE:
            bucket += 1
            if (best - lowest_f) >> BUCKET_BITS < bucket:
                break
            continue
        if made + every > queued.size:
            result = FULL
            break
        ring[bucket & mask] = below[entry]
        waiting -= 1
        node = int(np.int64(queued[entry]))
        from_g = g[node] - 1
        if from_g & 1:  # expanded since it was put here
            continue
        y = int((node + 0.5) * rows_per_node)  # node // width, exact for all grids that fit into memory
        x = node - y * width - goal_x
        y -= goal_y
        if best != UNREACHED and from_g + norm(planes, x, y) >= best:
            continue
        came = state[node]
        if legal != NODES and came < CHECKED and came != START and not (prune and wide_open[node]):
            move = came - REACHED
            if not is_legal(lattice, moves, legal, world, near, goal_x + x, goal_y + y, move):
                move, from_g = next_best_move(lattice, moves, rules, world, node, state, g)
                state[node] = CHECKED + ROOM if move == NONE else CHECKED + REACHED + move
                g[node] = UNREACHED
                if move != NONE:
                    g[node] = from_g + 1
                    place = (from_g + norm(planes, x, y) - lowest_f) >> BUCKET_BITS & mask
                    queued[made], below[made], ring[place] = node, ring[place], made
                    made += 1
                    waiting += 1
                continue
        g[node] = from_g
        expanded += 1
        if node == goal:
            best = from_g
            continue
        row, used = 0, every
        if rules.drawn > 0:
            used = rules.drawn
            draw_subset(order, used, rules.seed, 1 + node)
        elif came != START:
            if prune:
                in_the_open = wide_open[node] != 0
            elif around != 0:
                above, under = node + width, node - width
                in_the_open = (
                    room[above] >= around
                    and room[under] >= around
                    and room[node - 1] >= around
                    and room[node + 1] >= around
                    and room[above - 1] >= around
                    and room[above + 1] >= around
                    and room[under - 1] >= around
                    and room[under + 1] >= around
                )
            else:
                in_the_open = False
            if in_the_open:
                row, used = 1 + (came & (CHECKED - 1)) - REACHED, THREE
        for i in range(used):
            k = order[i] if row == 0 else after[row, i]
            to = node + jump[k]
            before = state[to]
            if before == SHUT:
                continue
            to_g = from_g + cost[k]
            if before > WHOLE_ROOM:
                known = g[to]
                if to_g + 1 >= known:
                    continue
                # An expanded node's way is legal and others lead on from it: it gives way to a legal one only.
                if before >= CHECKED or (known & 1 == 0 and legal != NODES):
                    to_x, to_y = goal_x + x + dx[k], goal_y + y + dy[k]
                    if not is_legal(lattice, moves, legal, world, near, to_x, to_y, k):
                        continue
            to_f = to_g + norm(planes, x + dx[k], y + dy[k])
            if to_f >= best:
                continue
            g[to] = to_g + 1
            state[to] = (before & CHECKED) + REACHED + k
            place = (to_f - lowest_f) >> BUCKET_BITS & mask
            queued[made], below[made], ring[place] = to, ring[place], made
            made += 1
            waiting += 1
    counts[MADE], counts[WAITING], counts[BUCKET], counts[EXPANDED] = made, waiting, bucket, expanded
    counts[BEST] = best + 1 if best != UNREACHED else 0
    return goal if result != FULL and best != UNREACHED else result


@kernel
def next_best_move(
    lattice: Lattice,
    moves: Moves,
    rules: Rules,
    world: ArmWorld,
    node: int,
    state: NDArray[np.uint8],
    g: NDArray[np.int64],
) -> tuple[int, int]:
    """Return the best legal move to a node from an expanded one, and the cost of the way; (NONE, 0) if there is none.

    Candidates are proved in the order of cost, then of the moves, until one is legal; the move by which the node
    was reached is known not to be.
    """
    scratch = np.empty(moves.jump.size, np.int64)
    failed = (state[node] & (CHECKED - 1)) - REACHED
    last_g, last_move = -1, -1
    while True:
        best, best_g = int(np.int64(NONE)), UNREACHED
        for k in range(moves.jump.size):
            source = node - moves.jump[k]
            if k == failed or state[source] <= WHOLE_ROOM or g[source] & 1:
                continue
            through = g[source] + moves.cost[k]
            if through >= best_g or through < last_g or (through == last_g and k <= last_move):
                continue
            if rules.drawn > 0:
                draw_subset(scratch, rules.drawn, rules.seed, 1 + source)
                if not is_among(scratch, rules.drawn, k):
                    continue
            best, best_g = k, through
        if best == NONE:
            return NONE, 0
        if move_is_legal(lattice, moves, rules.legal, world, node, best):
            return best, best_g
        last_g, last_move = best_g, best


@kernel
def is_among(values: NDArray[np.int64], count: int, wanted: int) -> bool:
    """Tell whether a value is one of the first `count`."""
    found = False
    for i in range(count):
        found = found or values[i] == wanted
    return found


def load_kernels(world: ArmWorld) -> None:
    """Compile the search, or load it from the cache, by a search from a node to itself."""
    one, first = np.ones(1, np.int64), np.zeros(2, np.int64)
    lattice = Lattice(np.ones(1, np.uint8), width=1, column=0, row=0, cell_cm=1.0)
    moves = Moves(one, one, one, one, np.ones((1, 2), np.int64), np.zeros((2, 1), np.int64), first, one, 1)
    best_first(lattice, moves, Rules(PROOF, 0, 0), world, 0, 0)


@kernel
def _trace(state: NDArray[np.uint8], jump: NDArray[np.int64], goal: int) -> NDArray[np.int64]:
    """Walk back from the goal; return the nodes from the start on."""
    count, node = 1, goal
    while state[node] != START:
        node -= jump[(state[node] & (CHECKED - 1)) - REACHED]
        count += 1
    nodes, node = np.empty(count, np.int64), goal
    for i in range(count - 1, 0, -1):
        nodes[i] = node
        node -= jump[(state[node] & (CHECKED - 1)) - REACHED]
    nodes[0] = node
    return nodes
