"""New costs, search and path in one call: the way from Python into a kernel takes longer than a small repair.

`replan_ahead` is for costs that only rose, on a state that has been searched; `plan_anew` is A*.
"""

import numpy as np
from numpy.typing import NDArray

from planarm.search.ahead import BEGIN, Ahead, answer_ahead, stored_way
from planarm.search.digraph import Bounds, Digraph
from planarm.search.lifelong import DONE, START, Lifelong, best_first, start_over
from planarm.search.stored_tree import change_costs
from planarm_wire.kernel_cache import bare_kernel as kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FELL, UNCUT = -4, -5
"""Nothing was searched: a cost has fallen, so old distances are no bounds; or no stored way was cut and the start has
none, since it moved: then `lifelong.repair` goes on from where it was."""


@kernel
def replan_ahead(
    graph: Digraph,
    bounds: Bounds,
    state: Lifelong,
    ahead: Ahead,
    edges: Ints,
    costs: Floats,
    branch: Ints,
    roots: int,
    most: int,
    path: Ints,
) -> tuple[int, int, float, int]:
    """Do what `change_costs` and `answer_ahead` do; arguments are theirs.

    Returns:
        (FELL or UNCUT, 0, 0, roots); else what `answer_ahead` returns, and how many roots there are now.
    """
    roots, falls = change_costs(graph, state, edges, costs, branch, roots)
    if falls:
        return FELL, 0, 0.0, roots
    start = state.ends[START]
    if roots == 0 and start != ahead.limit_start[0] and state.g[start] == np.inf:
        return UNCUT, 0, 0.0, 0
    outcome, count, cost = answer_ahead(graph, bounds, state, ahead, most, BEGIN, path)
    return outcome, count, cost, roots


@kernel
def plan_anew(
    graph: Digraph, bounds: Bounds, state: Lifelong, edges: Ints, costs: Floats, path: Ints
) -> tuple[int, int, float]:
    """Give edges new costs and search by A* from nothing; fill in the path.

    Returns:
        (DONE, how many nodes the path has, 0 for no path, its cost); or (the node whose incoming costs are needed, 0,
        0): `lifelong.best_first` then goes on.
    """
    for k in range(edges.shape[0]):
        graph.cost[edges[k]] = costs[k]
    start_over(state)
    needing = best_first(graph, bounds, state)
    if needing != DONE:
        return needing, 0, 0.0
    cost = state.rhs[state.ends[START]]
    return DONE, stored_way(state, path) if cost < np.inf else 0, cost
