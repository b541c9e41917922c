"""A directed graph with costs that may change, become known late, or be infinite; and lower bounds of distances.

Nodes and edges are numbered from 0. A cost is a number of at least 0, infinite where the edge cannot be taken, or not a
number while it is not known yet: a search that needs it says so and goes on once it is there.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm_wire.kernel_cache import bare_kernel as kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Links = NDArray[np.int32]
"""Half as wide, since a search is as fast as it finds these in the cache."""

UNKNOWN = np.nan
BELOW_ONE = 1.0 - 1e-9
"""Bounds are told this much lower, so that rounding does not lift one above the distance it bounds."""


class Digraph(NamedTuple):
    """m directed edges between n nodes, by tail and by head."""

    tail: Links
    """Shape (m,)."""
    head: Links
    out_first: Ints
    """Edges out of node u are `out_edge[out_first[u] : out_first[u + 1]]`; shape (n + 1,)."""
    out_edge: Links
    out_head: Links
    """Their heads, in the same order."""
    in_first: Ints
    in_edge: Links
    in_tail: Links
    cost: Floats
    """Shape (m,); the one array that changes."""

    def turned(self) -> "Digraph":
        """Return the graph with every edge turned round; its costs are the same array."""
        return Digraph(
            self.head,
            self.tail,
            self.in_first,
            self.in_edge,
            self.in_tail,
            self.out_first,
            self.out_edge,
            self.out_head,
            self.cost,
        )

    @property
    def nodes(self) -> int:
        """The number of nodes."""
        return len(self.out_first) - 1


class Bounds(NamedTuple):
    """What bounds distances from below: the largest of potential differences and a straight line, and 0.

    The distance from s to u is at least potentials[k, u] - potentials[k, s] for every k when every edge from a to b
    costs at least potentials[k, b] - potentials[k, a]; and at least the straight line between two points when every
    edge does. Such bounds are consistent, and stay valid while costs only rise.
    """

    potentials: Floats
    """Shape (k, n), k >= 0."""
    points: Floats
    """Shape (n, d), d >= 0; with d = 0 there is no straight line."""

    @classmethod
    def none(cls, nodes: int) -> "Bounds":
        """Return the bound 0."""
        return cls(np.empty((0, nodes)), np.empty((nodes, 0)))


def digraph(nodes: int, tail: ArrayLike, head: ArrayLike, cost: ArrayLike) -> Digraph:
    """Return the graph with these edges, arrays of shape (m,); the costs are copied.

    Raises:
        ValueError: the arrays are not as long as each other, an edge names no node, or a cost is negative.
    """
    tails, heads = np.asarray(tail, np.int64), np.asarray(head, np.int64)
    costs = np.array(cost, np.float64)
    if not tails.shape == heads.shape == costs.shape or tails.ndim != 1:
        raise ValueError(f"tails, heads and costs have the shapes {tails.shape}, {heads.shape}, {costs.shape}")
    ends = np.concatenate([tails, heads])
    if len(ends) and not 0 <= ends.min() <= ends.max() < nodes:
        raise ValueError(f"edges name nodes {ends.min()} to {ends.max()}, there are 0 to {nodes - 1}")
    if (costs < 0.0).any():
        raise ValueError(f"edge {int(np.argmax(costs < 0.0))} costs {costs[costs < 0.0][0]}; costs are at least 0")
    out_first, out_edge = _by(tails, nodes)
    in_first, in_edge = _by(heads, nodes)
    narrow_heads, narrow_tails = heads.astype(np.int32), tails.astype(np.int32)
    out_head, in_tail = narrow_heads[out_edge], narrow_tails[in_edge]
    return Digraph(narrow_tails, narrow_heads, out_first, out_edge, out_head, in_first, in_edge, in_tail, costs)


def _by(ends: Ints, nodes: int) -> tuple[Ints, Links]:
    """Return the edges ordered by an end, and where each node's begin."""
    first = np.zeros(nodes + 1, np.int64)
    np.cumsum(np.bincount(ends, minlength=nodes), out=first[1:])
    return first, np.argsort(ends, kind="stable").astype(np.int32)


@kernel
def bound(bounds: Bounds, start: int, node: int) -> float:
    """Return a lower bound of the distance from start to node."""
    best = 0.0
    for k in range(bounds.potentials.shape[0]):
        best = max(best, bounds.potentials[k, node] - bounds.potentials[k, start])
    line = 0.0
    for j in range(bounds.points.shape[1]):
        apart = bounds.points[node, j] - bounds.points[start, j]
        line += apart * apart
    return BELOW_ONE * max(best, sqrt(line))
