"""Integer costs and the norm of a stencil: Dijkstra in the open is the oracle."""

from decimal import Decimal, getcontext
from math import gcd

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from planarm.search.costs import COST_BITS, UNITS_PER_CELL, move_costs, norm, norm_planes
from planarm.search.stencils import stencil
from search_maps import PLANNERS

getcontext().prec = 60


@pytest.mark.parametrize(("algorithm", "neighbours"), PLANNERS)
def test_costs_are_lengths_rounded_to_the_nearest_unit(algorithm, neighbours):
    offsets = stencil(algorithm, neighbours)
    for (dx, dy), cost in zip(offsets.tolist(), move_costs(offsets).tolist(), strict=True):
        exact = Decimal(dx * dx + dy * dy).sqrt() * 2**COST_BITS
        assert cost % 2 == 0 and abs(Decimal(cost // 2) - exact) <= Decimal("0.5")
    assert move_costs(np.array([[1, 0]], np.int16))[0] == UNITS_PER_CELL


@pytest.mark.parametrize(("algorithm", "neighbours"), PLANNERS)
def test_the_norm_is_the_shortest_way_in_the_open(algorithm, neighbours):
    """Dijkstra on an empty lattice of 41 x 41 nodes, from its middle to the nodes far enough from the border."""
    offsets, size, middle = stencil(algorithm, neighbours), 41, 20
    costs, planes = move_costs(offsets).tolist(), norm_planes(offsets)
    edges = [
        (y * size + x, (y + dy) * size + x + dx, cost)
        for y in range(size)
        for x in range(size)
        for (dx, dy), cost in zip(offsets.tolist(), costs, strict=True)
        if 0 <= x + dx < size and 0 <= y + dy < size
    ]
    tails, heads, lengths = zip(*edges, strict=True)
    found = dijkstra(csr_matrix((lengths, (tails, heads)), shape=(size**2,) * 2), indices=middle * size + middle)
    for y in range(-10, 11):
        for x in range(-10, 11):
            assert norm(planes, x, y) == found[(middle + y) * size + middle + x]


@pytest.mark.parametrize(("algorithm", "neighbours"), PLANNERS)
def test_the_norm_never_falls_by_more_than_a_move_costs(algorithm, neighbours):
    """Consistency, in integers, far out where products are large."""
    offsets = stencil(algorithm, neighbours)
    planes, rng = norm_planes(offsets), np.random.default_rng(neighbours)
    for x, y in rng.integers(-(10**6), 10**6, (300, 2)).tolist():
        for (dx, dy), cost in zip(offsets.tolist(), move_costs(offsets).tolist(), strict=True):
            assert norm(planes, x, y) <= cost + norm(planes, x + dx, y + dy)


def test_a_stencil_with_a_gap_between_directions_is_refused():
    offsets = np.array([(x, y) for x in range(-3, 4) for y in range(-3, 4) if gcd(x, y) == 1 and x * y != 2], np.int16)
    offsets = offsets[~((np.abs(offsets).max(axis=1) == 1) & (offsets.prod(axis=1) != 0))]
    with pytest.raises(ValueError, match="out of reach"):
        norm_planes(offsets)
