"""The inner loops of D* Lite, MPD* Lite and A*, on any directed graph whose costs change while the start moves.

D* Lite (S. Koenig, M. Likhachev, "D* Lite", AAAI 2002, optimised version) keeps for each node u two estimates of its
distance to the goal: g(u), and rhs(u), the least of cost(u, v) + g(v) over its successors v. Nodes on which they differ
wait in the open list, ordered by

    key(u) = (min(g, rhs) + h(start, u) + k_m,  min(g, rhs)).

k_m grows by what the start has moved, so that old keys stay lower bounds; paper A's Table 3 leaves it out, which gives
wrong answers on walks (docs/errata.md). MPD* Lite (paper A, Fig. 6) stores with rhs(u) the successor that gave it. The
path is then read off, where D* Lite compares all successors of each of its nodes; and where a cost rises, or a node's
g, only nodes whose stored successor is concerned are looked at again, where D* Lite compares numbers.

A node's rhs that may have risen is not computed at once. While g and rhs were equal its key is that of g whatever rhs
becomes, so the node is marked, waits with that key, and compares its successors when its turn comes: often never, and
once where several of them rise one after another.

All searches go from the goal towards the start, over edges into the expanded node. An edge whose cost is not known
stops them; they return the node whose incoming costs they need and go on from there when called again.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.search.digraph import Bounds, Digraph, bound
from planarm.search.indexed_heap import Heap, new_heap, put, take_out
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

DONE = -1
"""A search has ended; any number from 0 on is a node whose incoming costs are needed."""

EXPANDED, UPDATED, LOOKED, RESCANNED = 0, 1, 2, 3
"""Counters: nodes expanded, nodes updated, edges looked at, and nodes all of whose successors were compared."""
COUNTERS = 4

START, LAST, GOAL = 0, 1, 2

TIE = 1e-12
"""Nodes whose key is the start's but for rounding are expanded, too: g along the path must be exact."""


class Lifelong(NamedTuple):
    """The state of a search on n nodes, for kernels."""

    g: Floats
    rhs: Floats
    best: Ints
    """The successor that gives rhs, -1 where there is none; kept only when `stores` is true."""
    stale: Flags
    """True for nodes whose rhs is infinite, or that of some successors only, until their turn comes."""
    heap: Heap
    key_modifier: Floats
    """k_m, shape (1,)."""
    ends: Ints
    """Start, the start when k_m last grew, and goal."""
    counted: Ints
    """Shape (COUNTERS,)."""
    stores: bool
    """True for MPD* Lite, false for D* Lite."""


def new_lifelong(nodes: int, start: int, goal: int, *, stores: bool) -> Lifelong:
    """Return the state before anything is searched."""
    state = Lifelong(
        g=np.full(nodes, np.inf),
        rhs=np.full(nodes, np.inf),
        best=np.full(nodes, -1, np.int64),
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
def repair(graph: Digraph, bounds: Bounds, state: Lifelong) -> int:
    """Expand nodes until the start's distance is right; return DONE, or the node whose incoming costs are needed."""
    g, rhs, heap = state.g, state.rhs, state.heap
    start = state.ends[START]
    _follow_start(bounds, state)
    if state.stale[start]:
        _compare_all(graph, state, start)
        _update(bounds, state, start)
    while heap.size[0] > 0:
        u = heap.nodes[0]
        first, second = heap.keys[u, 0], heap.keys[u, 1]
        limit = min(g[start], rhs[start]) + state.key_modifier[0]
        if first > limit + TIE * limit and rhs[start] <= g[start]:
            return DONE
        now_second = min(g[u], rhs[u])
        now_first = now_second + bound(bounds, start, u) + state.key_modifier[0]
        if first < now_first or (first == now_first and second < now_second):
            put(heap, u, now_first, now_second)
        elif state.stale[u]:
            _compare_all(graph, state, u)
            _update(bounds, state, u)
        elif g[u] > rhs[u]:
            if lacks(graph, u):
                return int(u)
            state.counted[EXPANDED] += 1
            g[u] = rhs[u]
            take_out(heap, u)
            _tell_lower(graph, bounds, state, u)
        else:
            state.counted[EXPANDED] += 1
            before = g[u]
            g[u] = np.inf
            _tell_higher(graph, bounds, state, u, before)
            _update(bounds, state, u)
    return DONE


@kernel
def change(graph: Digraph, bounds: Bounds, state: Lifelong, edges: Ints, costs: Floats) -> None:
    """Give edges new costs, both of shape (k,), and put the nodes that are concerned into the open list."""
    ends, g, rhs = state.ends, state.g, state.rhs
    _follow_start(bounds, state)
    for k in range(edges.shape[0]):
        e, new = edges[k], costs[k]
        u, v, old = graph.tail[e], graph.head[e], graph.cost[e]
        graph.cost[e] = new
        if u == ends[GOAL]:
            continue
        if new > old:
            if (state.best[u] == v) if state.stores else (rhs[u] == old + g[v] and rhs[u] < np.inf):
                _forget(graph, bounds, state, u)
        elif new + g[v] < rhs[u]:
            rhs[u], state.best[u] = new + g[v], v
            _update(bounds, state, u)


@kernel
def _follow_start(bounds: Bounds, state: Lifelong) -> None:
    """Let k_m grow by what the start has moved: keys made before stay lower bounds of what they would be now."""
    state.key_modifier[0] += bound(bounds, state.ends[LAST], state.ends[START])
    state.ends[LAST] = state.ends[START]


@kernel
def lacks(graph: Digraph, u: int) -> bool:
    """Tell whether the cost of an edge into u is not known."""
    missing = False
    for k in range(graph.in_first[u], graph.in_first[u + 1]):
        missing = missing or np.isnan(graph.cost[graph.in_edge[k]])
    return missing


@kernel
def _tell_lower(graph: Digraph, bounds: Bounds, state: Lifelong, u: int) -> None:
    """Let the predecessors of u know that its g has fallen."""
    rhs, value = state.rhs, state.g[u]
    for k in range(graph.in_first[u], graph.in_first[u + 1]):
        e = graph.in_edge[k]
        p = graph.tail[e]
        if graph.cost[e] + value < rhs[p] and p != state.ends[GOAL]:
            rhs[p], state.best[p] = graph.cost[e] + value, u
            _update(bounds, state, p)
    state.counted[LOOKED] += graph.in_first[u + 1] - graph.in_first[u]


@kernel
def _tell_higher(graph: Digraph, bounds: Bounds, state: Lifelong, u: int, before: float) -> None:
    """Let the predecessors of u know that its g, which was `before`, is infinite now."""
    rhs = state.rhs
    for k in range(graph.in_first[u], graph.in_first[u + 1]):
        e = graph.in_edge[k]
        p = graph.tail[e]
        told = (state.best[p] == u) if state.stores else (rhs[p] == graph.cost[e] + before and rhs[p] < np.inf)
        if told and p != state.ends[GOAL]:
            _forget(graph, bounds, state, p)
    state.counted[LOOKED] += graph.in_first[u + 1] - graph.in_first[u]


@kernel
def _forget(graph: Digraph, bounds: Bounds, state: Lifelong, u: int) -> None:
    """Let rhs of u be found anew: at once where its key depends on it, else when its turn comes."""
    if state.g[u] == state.rhs[u] and u != state.ends[START]:
        state.rhs[u], state.best[u], state.stale[u] = np.inf, -1, True
    else:
        _compare_all(graph, state, u)
    _update(bounds, state, u)


@kernel
def _compare_all(graph: Digraph, state: Lifelong, u: int) -> None:
    """Set rhs of u, and its stored successor, from all its successors.

    Costs of edges to nodes that were never expanded may be unknown; their g is infinite.
    """
    least, best = np.inf, -1
    for k in range(graph.out_first[u], graph.out_first[u + 1]):
        e = graph.out_edge[k]
        v = graph.head[e]
        if state.g[v] < np.inf and graph.cost[e] + state.g[v] < least:
            least, best = graph.cost[e] + state.g[v], v
    state.rhs[u], state.best[u], state.stale[u] = least, best, False
    state.counted[RESCANNED] += 1
    state.counted[LOOKED] += graph.out_first[u + 1] - graph.out_first[u]


@kernel
def _update(bounds: Bounds, state: Lifelong, u: int) -> None:
    """Put u into the open list, or take it out, as g and rhs say."""
    state.counted[UPDATED] += 1
    if state.g[u] == state.rhs[u]:
        take_out(state.heap, u)
        return
    value = min(state.g[u], state.rhs[u])
    put(state.heap, u, value + bound(bounds, state.ends[START], u) + state.key_modifier[0], value)


@kernel
def best_first(graph: Digraph, bounds: Bounds, state: Lifelong) -> int:
    """Search once, from the goal, by A* with a closed list; returns as `repair` does.

    Uses of a fresh state: `g` of closed nodes, `rhs` of those seen, `best`, `heap`. Nothing can be repaired afterwards.
    """
    g, rhs, heap = state.g, state.rhs, state.heap
    start = state.ends[START]
    while heap.size[0] > 0:
        u = heap.nodes[0]
        if lacks(graph, u):
            return int(u)
        take_out(heap, u)
        g[u] = rhs[u]
        if u == start:
            return DONE
        state.counted[EXPANDED] += 1
        for k in range(graph.in_first[u], graph.in_first[u + 1]):
            e = graph.in_edge[k]
            p = graph.tail[e]
            if graph.cost[e] + g[u] < rhs[p] and g[p] == np.inf:
                rhs[p], state.best[p] = graph.cost[e] + g[u], u
                put(heap, p, rhs[p] + bound(bounds, start, p), rhs[p])
        state.counted[LOOKED] += graph.in_first[u + 1] - graph.in_first[u]
    return DONE


@kernel
def stored_path(state: Lifelong) -> tuple[Ints, int]:
    """Return the nodes from start to goal by the stored successors, and how many nodes were looked at."""
    path = np.empty(state.g.shape[0], np.int64)
    u, count = state.ends[START], 0
    while u >= 0 and count < path.shape[0]:
        path[count] = u
        count += 1
        if u == state.ends[GOAL]:
            break
        u = state.best[u]
    return path[:count].copy(), count


@kernel
def gradient_path(graph: Digraph, state: Lifelong) -> tuple[Ints, int]:
    """Return the nodes from start to goal along the least cost + g, and how many edges were looked at."""
    path = np.empty(state.g.shape[0], np.int64)
    u, count, looked = state.ends[START], 0, 0
    while u >= 0 and count < path.shape[0]:
        path[count] = u
        count += 1
        if u == state.ends[GOAL]:
            break
        least, best = np.inf, -1
        for k in range(graph.out_first[u], graph.out_first[u + 1]):
            e = graph.out_edge[k]
            v = graph.head[e]
            looked += 1
            if state.g[v] < np.inf and graph.cost[e] + state.g[v] < least:
                least, best = graph.cost[e] + state.g[v], v
        u = best
    return path[:count].copy(), looked


@kernel
def concerned(graph: Digraph, state: Lifelong, edges: Ints, costs: Floats) -> tuple[int, bool]:
    """Return how many nodes' stored ways to the goal lead over an edge that is to rise, and whether the start's does.

    That is what the change makes a search that stores successors expand twice; one pass over the stored successors.
    """
    nodes = state.g.shape[0]
    known = np.zeros(nodes, np.int8)  # 1: no such edge, 2: one
    chain = np.empty(nodes, np.int64)
    known[state.ends[GOAL]] = 1
    for k in range(edges.shape[0]):
        u = graph.tail[edges[k]]
        if costs[k] > graph.cost[edges[k]] and state.best[u] == graph.head[edges[k]]:
            known[u] = 2
    total = 0
    for node in range(nodes):
        if state.g[node] == np.inf:
            continue
        u, length = node, 0
        while u >= 0 and known[u] == 0 and length < nodes:
            chain[length] = u
            length += 1
            u = state.best[u]
        verdict = known[u] if u >= 0 and known[u] != 0 else 1
        for k in range(length):
            known[chain[k]] = verdict
        if known[node] == 2:
            total += 1
    start = state.ends[START]
    return total, known[start] == 2 or (known[start] == 0 and state.best[start] >= 0 and known[state.best[start]] == 2)
