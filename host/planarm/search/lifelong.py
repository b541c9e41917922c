"""The inner loops of D* Lite, MPD* Lite and A*, on any directed graph whose costs change while the start moves.

D* Lite (S. Koenig, M. Likhachev, "D* Lite", AAAI 2002, optimised version) keeps for each node u two estimates of its
distance to the goal: g(u), and rhs(u), the least of cost(u, v) + g(v) over its successors v. Nodes on which they differ
wait in the open list, ordered by

    key(u) = (min(g, rhs) + h(start, u) + k_m,  min(g, rhs)).

k_m grows by what the start has moved, so that old keys stay lower bounds; paper A's Table 3 leaves it out, which gives
wrong answers on walks (docs/errata.md). MPD* Lite (paper A, Fig. 6) stores with rhs(u) the successor that gave it. The
path is then read off, where D* Lite compares all successors of each of its nodes; and where costs rise, the stored
successors are a tree that tells at once which nodes are concerned (`planarm.search.stored_tree`).

D* Lite finds them one by one, by the open list: a node whose rhs may have risen is expanded to forget its g. Its rhs is
not computed at once: while g and rhs were equal its key is that of g whatever rhs becomes, so the node is marked, waits
with that key, and compares its successors when its turn comes: often never, and once where several of them rise one
after another.

All searches go from the goal towards the start, over edges into the expanded node. An edge whose cost is not known
stops them; they return the node whose incoming costs they need and go on from there when called again.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.search.digraph import Bounds, Digraph, Links, bound
from planarm.search.indexed_heap import Heap, new_heap, put, take_out
from planarm_wire.kernel_cache import bare_kernel as kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Words = NDArray[np.uint32]

DONE = -1
"""A search has ended; any number from 0 on is a node whose incoming costs are needed."""

EXPANDED, UPDATED, LOOKED, RESCANNED = 0, 1, 2, 3
"""Counters: nodes expanded, nodes updated, edges looked at, and nodes all of whose successors were compared."""
COUNTERS = 4

START, LAST, GOAL = 0, 1, 2

STORED, CLOSED = 1, 2
"""Marks of edges: it leads to a stored successor, or did; its cost was told to be infinite. A search need not look at
edges without the first when costs rise, and may look at those without the second for being open."""
ALL_CLOSED = 0xAAAAAAAA
"""CLOSED of all edges of a word."""

TOLD = 1024
"""Edges whose costs are taken in one go."""

TIE = 1e-12
"""Nodes whose key is the start's but for rounding are expanded, too: g along the path must be exact."""


class Lifelong(NamedTuple):
    """The state of a search on n nodes, for kernels."""

    g: Floats
    rhs: Floats
    best: Links
    """The successor that gives rhs, -1 where there is none; kept only when `stores` is true."""
    through: Links
    """The edge to `best` of each node that `best_first` gave one."""
    edge_marks: Words
    """STORED and CLOSED of each edge, two bits, 16 edges a word, so that all of them stay in the nearest cache; kept
    only when `stores` is true."""
    told: Links
    """Room for edges, while costs are told."""
    stale: Flags
    """True for nodes whose rhs is infinite, or that of some successors only, until their turn comes; D* Lite's."""
    heap: Heap
    key_modifier: Floats
    """k_m, shape (1,)."""
    ends: Ints
    """Start, the start when k_m last grew, and goal."""
    counted: Ints
    """Shape (COUNTERS,)."""
    stores: bool
    """True for MPD* Lite, false for D* Lite."""


def new_lifelong(graph: Digraph, start: int, goal: int, *, stores: bool) -> Lifelong:
    """Return the state before anything is searched."""
    nodes = graph.nodes
    state = Lifelong(
        g=np.full(nodes, np.inf),
        rhs=np.full(nodes, np.inf),
        best=np.full(nodes, -1, np.int32),
        through=np.full(nodes, -1, np.int32),
        edge_marks=np.zeros(len(graph.cost) // 16 + 1, np.uint32),
        told=np.zeros(TOLD, np.int32),
        stale=np.zeros(nodes, np.bool_),
        heap=new_heap(nodes),
        key_modifier=np.zeros(1),
        ends=np.array([start, start, goal]),
        counted=np.zeros(COUNTERS, np.int64),
        stores=stores,
    )
    state.rhs[goal] = 0.0
    put(state.heap, goal, 0.0, 0.0)
    return state


@kernel
def start_over(state: Lifelong) -> None:
    """Make a state what it was before anything was searched."""
    for u in range(state.g.shape[0]):
        state.g[u] = state.rhs[u] = np.inf
        state.best[u], state.stale[u], state.heap.place[u] = -1, False, -1
    for word in range(state.edge_marks.shape[0]):
        state.edge_marks[word] &= np.uint32(ALL_CLOSED)
    state.heap.size[0] = 0
    state.key_modifier[0] = 0.0
    state.ends[LAST] = state.ends[START]
    state.rhs[state.ends[GOAL]] = 0.0
    put(state.heap, state.ends[GOAL], 0.0, 0.0)


@kernel
def repair(graph: Digraph, bounds: Bounds, state: Lifelong) -> int:
    """Expand nodes until the start's distance is right; return DONE, or the node whose incoming costs are needed."""
    g, rhs, heap = state.g, state.rhs, state.heap
    start = state.ends[START]
    follow_start(bounds, state)
    if state.stale[start]:
        compare_all(graph, state, start)
        update(bounds, state, start)
    while heap.size[0] > 0:
        u = heap.nodes[0]
        first, second = heap.keys[0, 0], heap.keys[0, 1]
        limit = min(g[start], rhs[start]) + state.key_modifier[0]
        if first > limit + TIE * limit and rhs[start] <= g[start]:
            return DONE
        now_second = min(g[u], rhs[u])
        now_first = now_second + bound(bounds, start, u) + state.key_modifier[0]
        if first < now_first or (first == now_first and second < now_second):
            put(heap, u, now_first, now_second)
        elif state.stale[u]:
            compare_all(graph, state, u)
            update(bounds, state, u)
        elif g[u] > rhs[u]:
            if _tell_lower(graph, bounds, state, u):
                return int(u)
            state.counted[EXPANDED] += 1
            g[u] = rhs[u]
            take_out(heap, u)
        else:
            state.counted[EXPANDED] += 1
            before = g[u]
            g[u] = np.inf
            _tell_higher(graph, bounds, state, u, before)
            update(bounds, state, u)
    return DONE


@kernel
def change(graph: Digraph, bounds: Bounds, state: Lifelong, edges: Ints, costs: Floats) -> None:
    """D* Lite: give edges new costs, both of shape (k,), and put their tails that are concerned into the open list."""
    ends, g, rhs = state.ends, state.g, state.rhs
    follow_start(bounds, state)
    for k in range(edges.shape[0]):
        e, new = edges[k], costs[k]
        u, v, old = graph.tail[e], graph.head[e], graph.cost[e]
        graph.cost[e] = new
        if u == ends[GOAL]:
            continue
        if new > old:
            if rhs[u] == old + g[v] and rhs[u] < np.inf:
                _forget(graph, bounds, state, u)
        elif new + g[v] < rhs[u]:
            rhs[u], state.best[u] = new + g[v], v
            update(bounds, state, u)


@kernel
def follow_start(bounds: Bounds, state: Lifelong) -> None:
    """Let k_m grow by what the start has moved: keys made before stay lower bounds of what they would be now."""
    state.key_modifier[0] += bound(bounds, state.ends[LAST], state.ends[START])
    state.ends[LAST] = state.ends[START]


@kernel
def _tell_lower(graph: Digraph, bounds: Bounds, state: Lifelong, u: int) -> bool:
    """Let the predecessors of u know that its g is to fall to its rhs; return whether the cost of an edge is not known.

    What was told then holds, and the rest is told when the costs are there.
    """
    rhs, value, missing = state.rhs, state.rhs[u], False
    for k in range(graph.in_first[u], graph.in_first[u + 1]):
        cost, p = graph.cost[graph.in_edge[k]], graph.in_tail[k]
        missing = missing or np.isnan(cost)
        if cost + value < rhs[p] and p != state.ends[GOAL]:
            rhs[p], state.best[p] = cost + value, u
            set_mark(state, graph.in_edge[k], STORED)
            update(bounds, state, p)
    state.counted[LOOKED] += graph.in_first[u + 1] - graph.in_first[u]
    return missing


@kernel
def _tell_higher(graph: Digraph, bounds: Bounds, state: Lifelong, u: int, before: float) -> None:
    """Let the predecessors of u know that its g, which was `before`, is infinite now."""
    rhs = state.rhs
    for k in range(graph.in_first[u], graph.in_first[u + 1]):
        p = graph.in_tail[k]
        if rhs[p] == graph.cost[graph.in_edge[k]] + before and rhs[p] < np.inf and p != state.ends[GOAL]:
            _forget(graph, bounds, state, p)
    state.counted[LOOKED] += graph.in_first[u + 1] - graph.in_first[u]


@kernel
def _forget(graph: Digraph, bounds: Bounds, state: Lifelong, u: int) -> None:
    """Let rhs of u be found anew: at once where its key depends on it, else when its turn comes."""
    if state.g[u] == state.rhs[u] and u != state.ends[START]:
        state.rhs[u], state.best[u], state.stale[u] = np.inf, -1, True
    else:
        compare_all(graph, state, u)
    update(bounds, state, u)


@kernel
def compare_all(graph: Digraph, state: Lifelong, u: int) -> None:
    """Set rhs of u, and its stored successor, from all its successors.

    Costs of edges to nodes that were never expanded may be unknown; their g is infinite.
    """
    least, best, edge = np.inf, -1, -1
    for k in range(graph.out_first[u], graph.out_first[u + 1]):
        v = graph.out_head[k]
        if state.g[v] < np.inf:
            through = graph.cost[graph.out_edge[k]] + state.g[v]
            if through < least:
                least, best, edge = through, v, graph.out_edge[k]
    if edge >= 0:
        set_mark(state, edge, STORED)
    state.rhs[u], state.best[u], state.stale[u] = least, best, False
    state.counted[RESCANNED] += 1
    state.counted[LOOKED] += graph.out_first[u + 1] - graph.out_first[u]


@kernel
def set_mark(state: Lifelong, edge: int, mark: int) -> None:
    """Set STORED or CLOSED of an edge."""
    state.edge_marks[np.uint64(edge >> 4)] |= np.uint32(mark << (2 * (edge & 15)))


@kernel
def mark_stored(state: Lifelong) -> None:
    """Mark all edges to stored successors after `best_first`."""
    for u in range(state.best.shape[0]):
        if state.best[u] >= 0:
            set_mark(state, state.through[u], STORED)


@kernel
def update(bounds: Bounds, state: Lifelong, u: int) -> None:
    """Put u into the open list, or take it out, as g and rhs say."""
    state.counted[UPDATED] += 1
    if state.g[u] == state.rhs[u]:
        take_out(state.heap, u)
        return
    value = min(state.g[u], state.rhs[u])
    put(state.heap, u, value + bound(bounds, state.ends[START], u) + state.key_modifier[0], value)


@kernel
def best_first(graph: Digraph, bounds: Bounds, state: Lifelong) -> int:
    """Search a fresh state from the goal by A* with a closed list; returns as `repair` does, and leaves what it leaves.

    The start stays in the open list: its predecessors have not been told.
    """
    g, rhs, heap = state.g, state.rhs, state.heap
    start = state.ends[START]
    state.ends[LAST] = start
    while heap.size[0] > 0:
        u = heap.nodes[0]
        if u == start:
            return DONE
        value, missing = rhs[u], False
        # Unsigned, since Numba asks of other indices whether they are negative.
        for k in range(np.uint64(graph.in_first[u]), np.uint64(graph.in_first[u + 1])):
            cost = graph.cost[np.uint32(graph.in_edge[k])]
            missing = missing or np.isnan(cost)
            if cost + value < rhs[np.uint32(graph.in_tail[k])] and g[np.uint32(graph.in_tail[k])] == np.inf:
                p = graph.in_tail[k]
                rhs[p], state.best[p], state.through[p] = cost + value, u, graph.in_edge[k]
                put(heap, p, rhs[p] + bound(bounds, start, p), rhs[p])
        state.counted[LOOKED] += graph.in_first[u + 1] - graph.in_first[u]
        if missing:  # what was told holds; the rest is told when the costs are there
            return int(u)
        take_out(heap, u)
        g[u] = value
        state.counted[EXPANDED] += 1
    return DONE
