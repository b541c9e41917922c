"""A first answer to costs that rose: searched from the start, with the old distances as bounds.

While costs only rise, a distance to the goal that was right before is a lower bound of what it is now, and an excellent
one: an A* from the start that takes it expands little more than what the new way goes around. And a node whose stored
way to the goal is still whole has that distance for certain, so the search ends at the first such node that it comes
to, and the rest of the path is read off the stored tree. Where the new way is much longer than the old one, nearly all
nodes look good by their old distances: then it gives up, and the distances are repaired first.

Bounds from earlier searches: S. Koenig, M. Likhachev, "Adaptive A*", AAMAS 2005; ends at a stored path: C. Hernandez,
J. Baier, R. Asin, "Making A* run faster than D*-Lite for path-planning in partially known terrain", ICAPS 2014.

Nodes that were never expanded have bounds, too. The last search, which ended at the distance C of its start s, expanded
every node u with d(u) + h(s, u) < C, so d(u) >= C - h(s, u) for all others.

The distances are repaired later (`planarm.search.stored_tree`), when they are asked for again.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.search.digraph import Bounds, Digraph, bound
from planarm.search.indexed_heap import Heap, new_heap, put, take_out
from planarm.search.lifelong import DONE, GOAL, START, Lifelong
from planarm_wire.kernel_cache import bare_kernel as kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Marks = NDArray[np.int8]

UNTOLD, WHOLE, CUT_OFF = 0, 1, 2
"""Whether a node's stored way is whole, once that was looked at."""
NOBODY = -1
GAVE_UP = -2
BEGIN = -3


class Ahead(NamedTuple):
    """Room for a search from the start on n nodes, as it is left between two searches."""

    distance: Floats
    """From the start; infinite where the search did not come."""
    before: Ints
    """The node before each on the way from the start."""
    mark: Marks
    heap: Heap
    visited: Ints
    """Nodes that have a distance or a mark: to be cleared."""
    counted: Ints
    """How many of these; then nodes expanded, nodes put, and edges looked at; shape (4,)."""
    limit: Floats
    """C of the last search that expanded from the goal, shape (1,)."""
    limit_start: Ints
    """Its start, shape (1,)."""


def new_ahead(nodes: int) -> Ahead:
    """Return the room."""
    return Ahead(
        distance=np.full(nodes, np.inf),
        before=np.full(nodes, NOBODY, np.int64),
        mark=np.zeros(nodes, np.int8),
        heap=new_heap(nodes),
        visited=np.empty(2 * nodes, np.int64),
        counted=np.zeros(4, np.int64),
        limit=np.zeros(1),
        limit_start=np.zeros(1, np.int64),
    )


@kernel
def search_ahead(
    graph: Digraph, bounds: Bounds, state: Lifelong, ahead: Ahead, most: int, needing: int
) -> tuple[int, int]:
    """Search from the start to the first node whose stored way is whole; `needing` is BEGIN, or what it returned last.

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
        for k in range(graph.out_first[u], graph.out_first[u + 1]):
            v, cost = graph.out_head[k], graph.cost[graph.out_edge[k]]
            if np.isnan(cost):
                return int(v), NOBODY
            through = distance[u] + cost
            if through < distance[v]:
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
    """Clear what the search before left, and begin at the start."""
    for k in range(ahead.counted[0]):
        u = ahead.visited[k]
        ahead.distance[u], ahead.mark[u] = np.inf, UNTOLD
        take_out(ahead.heap, u)
    start = state.ends[START]
    ahead.distance[start], ahead.visited[0] = 0.0, start
    ahead.counted[0] = 1
    ahead.counted[1] = ahead.counted[2] = ahead.counted[3] = 0
    put(ahead.heap, start, _to_goal(bounds, state, ahead, start), 0.0)


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
    goal, at = state.ends[GOAL], u
    if state.g[u] == np.inf:
        return False
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
    while u != state.ends[START]:
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
