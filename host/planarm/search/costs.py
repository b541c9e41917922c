"""Move lengths as integers, and the distance that a stencil needs in the open: what makes the search exact.

A move's cost is its length in cells in units of 2^-36, rounded, and doubled (the search keeps a mark in the lowest
bit). Sums of integers do not depend on their order, so two ways of the same moves tie exactly, on every platform. A
path of n moves is in error by at most n 2^-37 cells. With 8 neighbours that is proved harmless: two lengths
a + b sqrt 2 that differ do so by at least 1 / (|da| + |db| sqrt 2), far more. With more neighbours the path may be
longer than the shortest by that error, less than 1e-7 cells for ten thousand moves.

Away from obstacles the shortest way between two nodes takes two neighbouring directions of the stencil only: its
length is a norm, linear between directions. It is the search's heuristic: it sees the stencil's own excess over the
straight line, so far fewer nodes are expanded than with the straight distance, and in integers it is consistent.
"""

from itertools import pairwise
from math import gcd, isqrt

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import kernel

Ints = NDArray[np.int64]

COST_BITS = 36
UNITS_PER_CELL = 2 << COST_BITS
"""Cost of a move of one cell. Any path on the largest grid stays below 2^62."""


def move_costs(offsets: NDArray[np.int16]) -> Ints:
    """Return the even cost of each move (dx, dy)."""
    return np.array([2 * _rounded_root((int(x) ** 2 + int(y) ** 2) << 2 * COST_BITS) for x, y in offsets], np.int64)


def _rounded_root(value: int) -> int:
    root = isqrt(value)
    return root + (value > root * (root + 1))  # (root + 1/2)^2 = root (root + 1) + 1/4


def norm_planes(offsets: NDArray[np.int16]) -> Ints:
    """Return planes (a, b), int64[n, 2], with the norm of (x, y) = max of a max(|x|, |y|) + b min(|x|, |y|).

    Each plane passes through two neighbouring directions of the first octant. The stencil must be symmetric in the
    eight octants and its neighbouring directions u, v must have u x v = 1, which is so for all of paper C's.
    """
    costs = move_costs(offsets)
    octant = {
        (int(x), int(y)): int(cost)
        for (x, y), cost in zip(offsets, costs, strict=True)
        if 0 <= y <= x and gcd(int(x), int(y)) == 1
    }
    directions = sorted(octant, key=lambda d: d[1] / d[0])
    planes = []
    for u, v in pairwise(directions):
        if u[0] * v[1] - u[1] * v[0] != 1:
            raise ValueError(f"directions {u} and {v} leave lattice nodes between them out of reach")
        planes.append((octant[u] * v[1] - octant[v] * u[1], octant[v] * u[0] - octant[u] * v[0]))
    return np.array(planes, np.int64)


@kernel
def norm(planes: Ints, x: int, y: int) -> int:
    """Return the cost of the shortest way from (0, 0) to (x, y) in the open."""
    across, along = abs(x), abs(y)
    if across < along:
        across, along = along, across
    cost = 0
    for i in range(planes.shape[0]):
        cost = max(cost, planes[i, 0] * across + planes[i, 1] * along)
    return cost
