"""Reading the way off a search that has ended: by the stored successors, or along the gradient."""

import numpy as np
from numpy.typing import NDArray

from planarm.search.digraph import Digraph
from planarm.search.lifelong import GOAL, START, Lifelong
from planarm_wire.kernel_cache import kernel

Ints = NDArray[np.int64]


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
