"""Answers to costs that rose: searched from the start, or from several, with the old distances as bounds.

While costs only rise, a distance to the goal that was right before is a lower bound of what it is now, and an excellent
one: an A* from the start that takes it expands little more than what the new way goes around. And a node whose stored
way to the goal is still whole has that distance for certain, so the search ends at the first such node that it comes
to, and the rest of the path is read off the stored tree. Where the new way is much longer than the old one, nearly all
nodes look good by their old distances: then it gives up, and the distances are repaired first.

When it has not ended soon it asks whether there is a way at all: a flood from the start, which has no order to keep and
so takes a tenth of an expansion a node, comes to a node whose stored way is whole, or to all that can be reached.

Bounds from earlier searches: S. Koenig, M. Likhachev, "Adaptive A*", AAMAS 2005; ends at a stored path: C. Hernandez,
J. Baier, R. Asin, "Making A* run faster than D*-Lite for path-planning in partially known terrain", ICAPS 2014.

Nodes that were never expanded have bounds, too. The last search, which ended at the distance C of its start s, expanded
every node u with d(u) + h(s, u) < C, so d(u) >= C - h(s, u) for all others.

The distances are repaired later (`planarm.search.stored_tree`), when they are asked for again.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.search.digraph import Bounds, Digraph, Links, bound
from planarm.search.indexed_heap import Heap, new_heap, put, take_out
from planarm.search.lifelong import CLOSED, DONE, GOAL, START, Lifelong
from planarm_wire.kernel_cache import bare_kernel as kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Marks = NDArray[np.int8]

UNTOLD, WHOLE, CUT_OFF = 0, 1, 2
"""Whether a node's stored way is whole, once that was looked at."""
NOBODY = -1
GAVE_UP = -2
BEGIN = -3

SOON = 48
"""Nodes that are expanded before the start's surroundings are flooded."""
ASKED = 8
"""One of so many flooded nodes is asked whether its stored way is whole."""


class Ahead(NamedTuple):
    """Room for a search from the start on n nodes, as it is left between two searches."""

    distance: Floats
    """From the start; infinite where the search did not come."""
    before: Links
    """The node before each on the way from the start."""
    mark: Marks
    heap: Heap
    visited: Links
    """Nodes that have a distance or a mark: to be cleared; shape (2 n,)."""
    counted: Ints
    """How many of these; then nodes expanded, nodes put, edges looked at, and nodes flooded; shape (5,)."""
    flooded: Marks
    """Nodes that a flood has come to."""
    waiting: Links
    """The same in the order in which it came to them, and room for the neighbours of one."""
    limit: Floats
    """C of the last search that expanded from the goal, shape (1,)."""
    limit_start: Ints
    """Its start, shape (1,)."""
    starts: Ints
    """Where the search may begin instead of at the start, each node once; shape (n,)."""
    steps: Floats
    """What it costs to come to each."""
    many: Ints
    """How many of these there are, shape (1,); 0 for the start alone."""


def new_ahead(graph: Digraph) -> Ahead:
    """Return the room."""
    nodes, most = graph.nodes, int(np.diff(graph.out_first).max(initial=0))
    return Ahead(
        distance=np.full(nodes, np.inf),
        before=np.full(nodes, NOBODY, np.int32),
        mark=np.zeros(nodes, np.int8),
        heap=new_heap(nodes),
        visited=np.zeros(2 * nodes, np.int32),
        counted=np.zeros(5, np.int64),
        flooded=np.zeros(nodes, np.int8),
        waiting=np.zeros(nodes + most, np.int32),
        limit=np.zeros(1),
        limit_start=np.zeros(1, np.int64),
        starts=np.zeros(nodes, np.int64),
        steps=np.zeros(nodes),
        many=np.zeros(1, np.int64),
    )


@kernel
def answer_ahead(
    graph: Digraph, bounds: Bounds, state: Lifelong, ahead: Ahead, most: int, needing: int, path: Ints
) -> tuple[int, int, float]:
    """Find the best path after costs have risen; arguments as for `search_ahead`, and room for a path, shape (n,).

    Returns:
        (DONE, how many nodes the path has, 0 for no path, and its cost); or (what else `search_ahead` returns, 0, 0).
    """
    start = state.ends[START]
    if needing == BEGIN and ahead.many[0] == 0 and (start == ahead.limit_start[0] or state.g[start] < np.inf):
        count = stored_way(state, path)
        if count:  # it was the best, and is whole
            _count_nothing(ahead)
            return DONE, count, float(min(state.g[start], state.rhs[start]))
    found, whole = search_ahead(graph, bounds, state, ahead, min(SOON, most), needing)
    if found == GAVE_UP:
        if ahead.counted[4] == 0 and is_lost(graph, state, ahead):
            return DONE, 0, np.inf
        if most > SOON:
            found, whole = search_ahead(graph, bounds, state, ahead, most, GAVE_UP)
    if found != DONE:
        return found, 0, 0.0
    if whole == NOBODY:
        return DONE, 0, np.inf
    return DONE, path_ahead(state, ahead, whole, path), ahead.distance[whole] + state.g[whole]


@kernel
def stored_way(state: Lifelong, path: Ints) -> int:
    """Fill in the nodes from the start by the stored successors; return how many, or 0 when they are cut off."""
    u, count = state.ends[START], 0
    while u >= 0:
        path[count] = u
        count += 1
        if u == state.ends[GOAL]:
            return count
        u = state.best[u]
    return 0


@kernel
def _count_nothing(ahead: Ahead) -> None:
    for k in range(1, 5):
        ahead.counted[k] = 0


@kernel
def is_lost(graph: Digraph, state: Lifelong, ahead: Ahead) -> bool:
    """Tell whether no node whose stored way is whole can be reached from the start; the goal is such a node.

    Edges are open that no change has closed. Its time goes into branches that no processor foresees, so there are few:
    first all neighbours are listed that were not flooded, then those are taken to which the edge is open; and only some
    nodes are asked whether their stored way is whole, since their neighbours mostly are what they are.
    """
    flooded, waiting, out_first, out_head = ahead.flooded, ahead.waiting, graph.out_first, graph.out_head
    flooded[:] = 0
    waiting[0] = state.ends[START]
    count, done = max(1, ahead.many[0]), 0
    for k in range(ahead.many[0]):
        waiting[k] = ahead.starts[k]
    for k in range(count):
        flooded[waiting[k]] = 1
    while done < count:
        u = waiting[done]
        if done % ASKED == 0 and _leads_on(state, ahead, u):
            break
        done += 1
        new = np.uint64(count)  # unsigned, since Numba asks of other indices whether they are negative
        for k in range(np.uint64(out_first[u]), np.uint64(out_first[u + 1])):
            waiting[new] = np.int32(k)
            new += np.uint64(flooded[np.uint32(out_head[k])] == 0)
        for i in range(np.uint64(count), new):
            v, e = np.uint32(out_head[np.uint32(waiting[i])]), np.uint32(graph.out_edge[np.uint32(waiting[i])])
            closed = (state.edge_marks[e >> np.uint32(4)] >> (np.uint32(2) * (e & np.uint32(15)))) & np.uint32(CLOSED)
            if closed == 0 and flooded[v] == 0:  # parallel edges are listed twice
                flooded[v], waiting[np.uint64(count)] = 1, v
                count += 1
    ahead.counted[4] = count
    return bool(done == count and flooded[state.ends[GOAL]] == 0)


@kernel
def search_ahead(
    graph: Digraph, bounds: Bounds, state: Lifelong, ahead: Ahead, most: int, needing: int
) -> tuple[int, int]:
    """Search from the start to the first node whose stored way is whole; `needing` is BEGIN, or what it returned last.

    After GAVE_UP it may go on with a larger `most`.

    Costs have only risen since the search began anew; edges that did, and are on stored ways, have cut these (their
    tails store no successor).

    Returns:
        (DONE, the node; NOBODY when there is no way); (a node whose incoming costs are needed, NOBODY): then it goes on
        when called again; or (GAVE_UP, NOBODY) when more than `most` nodes would be expanded.
    """
    distance, heap, counted = ahead.distance, ahead.heap, ahead.counted
    if needing == BEGIN:
        begin_ahead(bounds, state, ahead)
    while heap.size[0] > 0:
        u = heap.nodes[0]
        if _is_whole(state, ahead, u):
            return DONE, int(u)
        if counted[1] >= most:
            return GAVE_UP, NOBODY
        counted[1] += 1
        counted[3] += graph.out_first[u + 1] - graph.out_first[u]
        so_far = distance[u]
        for k in range(np.uint64(graph.out_first[u]), np.uint64(graph.out_first[u + 1])):
            cost = graph.cost[np.uint32(graph.out_edge[k])]
            if np.isnan(cost):
                return int(graph.out_head[k]), NOBODY
            through = so_far + cost
            if through < distance[np.uint32(graph.out_head[k])]:
                v = graph.out_head[k]
                if distance[v] == np.inf:
                    ahead.visited[counted[0]] = v
                    counted[0] += 1
                distance[v], ahead.before[v] = through, u
                counted[2] += 1
                left = _to_goal(bounds, state, ahead, v)
                if left < np.inf:
                    put(heap, v, through + left, left)
        take_out(heap, u)
    return DONE, NOBODY


@kernel
def begin_ahead(bounds: Bounds, state: Lifelong, ahead: Ahead) -> None:
    """Clear what the search before left, and begin at the start, or at those that are given."""
    for k in range(ahead.counted[0]):
        u = ahead.visited[k]
        ahead.distance[u], ahead.mark[u] = np.inf, UNTOLD
        take_out(ahead.heap, u)
    ahead.counted[0] = 0
    _count_nothing(ahead)
    if ahead.many[0] == 0:
        _begin_at(bounds, state, ahead, state.ends[START], 0.0)
    for k in range(ahead.many[0]):
        _begin_at(bounds, state, ahead, ahead.starts[k], ahead.steps[k])


@kernel
def _begin_at(bounds: Bounds, state: Lifelong, ahead: Ahead, u: int, step: float) -> None:
    """Begin at a node that it costs a step to come to."""
    ahead.distance[u], ahead.before[u] = step, NOBODY
    ahead.visited[ahead.counted[0]] = u
    ahead.counted[0] += 1
    left = _to_goal(bounds, state, ahead, u)
    if left < np.inf:
        put(ahead.heap, u, step + left, left)


@kernel
def _to_goal(bounds: Bounds, state: Lifelong, ahead: Ahead, u: int) -> float:
    """Return a lower bound of the distance from u to the goal: what it was, where that is known."""
    if state.g[u] < np.inf:
        return float(state.g[u])
    beyond = ahead.limit[0] - bound(bounds, ahead.limit_start[0], u)
    return float(max(beyond, bound(bounds, u, state.ends[GOAL])))


@kernel
def _is_whole(state: Lifelong, ahead: Ahead, u: int) -> bool:
    """Tell whether a node's stored way leads to the goal; what is found is kept for all nodes on it."""
    return bool(state.g[u] < np.inf and _leads_on(state, ahead, u))


@kernel
def _leads_on(state: Lifelong, ahead: Ahead, u: int) -> bool:
    """Follow the stored successors, to the goal or to what is told, and mark all on the way."""
    goal, at = state.ends[GOAL], u
    while at != goal and at >= 0 and ahead.mark[at] == UNTOLD:
        at = state.best[at]
    found = at == goal or (at >= 0 and ahead.mark[at] == WHOLE)
    at = u
    while at != goal and at >= 0 and ahead.mark[at] == UNTOLD:
        ahead.mark[at] = WHOLE if found else CUT_OFF
        ahead.visited[ahead.counted[0]] = at
        ahead.counted[0] += 1
        at = state.best[at]
    return bool(found)


@kernel
def path_ahead(state: Lifelong, ahead: Ahead, whole: int, path: Ints) -> int:
    """Fill in the nodes from the start by what was searched to `whole`, and on to the goal; return how many."""
    count, u = 0, whole
    while ahead.before[u] != NOBODY:
        u = ahead.before[u]
        count += 1
    u = whole
    for k in range(count, -1, -1):
        path[k] = u
        u = ahead.before[u]
    u = whole
    while u != state.ends[GOAL]:
        u = state.best[u]
        count += 1
        path[count] = u
    return count + 1
