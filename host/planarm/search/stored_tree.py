"""MPD* Lite's answer to changed costs: stored successors are a tree, and edges that rise cut branches off it.

Paper A stores each node's best successor (Fig. 6) to read paths off. The stored successors also lead from every node on
the way that gave it its distance, so they tell at once which nodes a risen edge concerns: those whose stored ways lead
over it, the branch behind it. D* Lite finds the same nodes one by one in its open list, and expands each twice, once to
forget its distance and once to learn it. Here the branch forgets all at once, each of its nodes takes the best of the
successors that were not cut off, if there is one, and the search goes on: every node is expanded once. All other nodes
keep distances that are right, since nothing on their ways has changed.

An edge that has fallen lowers its tail's rhs, as in D* Lite.
"""

import numpy as np
from numpy.typing import NDArray

from planarm.search.digraph import Bounds, Digraph
from planarm.search.indexed_heap import take_out
from planarm.search.lifelong import CLOSED, GOAL, STORED, Lifelong, compare_all, follow_start, set_mark, update
from planarm_wire.kernel_cache import bare_kernel as kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TOO_MANY = -1
CUT = -2
"""Stands for the stored successor of a node that is cut off, until it has another."""


@kernel
def change_stored(
    graph: Digraph, bounds: Bounds, state: Lifelong, changed: tuple[Ints, Floats], most: int, branch: Ints
) -> int:
    """Give edges new costs, and make the state ready for `repair`.

    Args:
        graph: its costs are changed.
        bounds: as ever.
        state: of MPD* Lite.
        changed: edges and their new costs, both of shape (k,).
        most: nodes that may be cut off.
        branch: room for the nodes, shape (n,).

    Returns:
        How many nodes were cut off; TOO_MANY when more than `most` would be: then the edges have their costs, but the
        state is of no more use.
    """
    edges, costs = changed
    roots, falls = change_costs(graph, state, edges, costs, branch, 0)
    return cut_off(graph, bounds, state, edges if falls else edges[:0], most, branch, roots)


@kernel
def change_costs(
    graph: Digraph, state: Lifelong, edges: Ints, costs: Floats, branch: Ints, roots: int
) -> tuple[int, bool]:
    """Give edges new costs, and cut the stored ways that lead over one that rose.

    The nodes at which they are cut are added to `branch`, which holds `roots` of them; nothing else is done yet.

    Returns:
        (how many there are now, whether any edge fell).
    """
    falls, marks, cost, stored = False, state.edge_marks, graph.cost, state.told
    for begin in range(0, edges.shape[0], stored.shape[0]):
        count = np.uint64(0)
        for k in range(np.uint64(begin), np.uint64(min(begin + stored.shape[0], edges.shape[0]))):
            e, new = np.uint32(edges[k]), costs[k]
            old = cost[e]
            cost[e] = new
            falls = falls or new < old
            word, shift = e >> np.uint32(4), np.uint32(2) * (e & np.uint32(15))
            mark = marks[word]
            stored[count] = np.int32(e)  # listed without a branch: whether an edge is stored nobody foresees
            count += np.uint64((mark >> shift) & np.uint32(STORED) & np.uint32(new > old))
            marks[word] = (mark & ~(np.uint32(CLOSED) << shift)) | (np.uint32(new == np.inf) << (shift + np.uint32(1)))
        for k in range(count):
            e = stored[k]
            u = graph.tail[e]
            if state.best[u] == graph.head[e] and u != state.ends[GOAL]:
                state.best[u], branch[roots] = CUT, u
                roots += 1
    return roots, falls


@kernel
def cut_off(graph: Digraph, bounds: Bounds, state: Lifelong, fallen: Ints, most: int, branch: Ints, roots: int) -> int:
    """Let all nodes forget whose stored ways are cut, and learn from the others; returns as `change_stored`.

    Args:
        graph: as there.
        bounds: as there.
        state: as there.
        most: as there.
        fallen: edges among which are those that fell.
        branch: its first `roots` nodes are those at which the ways were cut.
        roots: how many.
    """
    follow_start(bounds, state)
    count, done = roots, 0
    while done < count:
        u = branch[done]
        done += 1
        if count > most:
            return TOO_MANY
        if state.g[u] == np.inf:
            continue  # nobody's way leads over it
        for k in range(graph.in_first[u], graph.in_first[u + 1]):
            p = graph.in_tail[k]
            if state.best[p] == u:
                state.best[p], branch[count] = CUT, p
                count += 1
    for k in range(count):
        u = branch[k]
        state.g[u] = state.rhs[u] = np.inf
        take_out(state.heap, u)
    for k in range(count):
        compare_all(graph, state, branch[k])
        update(bounds, state, branch[k])
    if fallen.shape[0]:
        _take_what_fell(graph, bounds, state, fallen)
    return count


@kernel
def _take_what_fell(graph: Digraph, bounds: Bounds, state: Lifelong, edges: Ints) -> None:
    """Lower rhs of tails for which one of these edges, with its new cost, is a better way."""
    for k in range(edges.shape[0]):
        u, v = graph.tail[edges[k]], graph.head[edges[k]]
        through = graph.cost[edges[k]] + state.g[v]
        if u != state.ends[GOAL] and through < state.rhs[u]:
            state.rhs[u], state.best[u] = through, v
            set_mark(state, edges[k], STORED)
            update(bounds, state, u)
