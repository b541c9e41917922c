"""The best polynomial within given widths, against linear programming (scipy's HiGHS)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from planarm.stepping.chebyshev import best_polynomial, spread


def least_largest_error(at, center, half, degree):
    """The least possible largest error in widths, by linear programming over coefficients and the error."""
    scaled = np.vander(at / at[-1], degree + 1)
    a = np.vstack([np.column_stack([scaled, -half]), np.column_stack([-scaled, -half])])
    solved = linprog(
        [*np.zeros(degree + 1), 1.0],
        A_ub=a,
        b_ub=np.concatenate([center, -center]),
        bounds=[(None, None)] * (degree + 1) + [(0, None)],
        method="highs",
    )
    assert solved.status == 0
    return solved.x[-1]


def value(x, nodes, coefficients):
    total = np.zeros_like(x)
    for k in range(len(coefficients) - 1, -1, -1):
        total = total * (x - nodes[k]) + coefficients[k]
    return total


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 10**6), points=st.integers(3, 40), degree=st.sampled_from([1, 2]), level=st.floats(0.2, 3.0))
def test_it_is_found_exactly_when_there_is_one(seed, points, degree, level):
    rng = np.random.default_rng(seed)
    at = np.cumsum(rng.uniform(0.5, 2.0, points))
    half = rng.uniform(0.5, 2.0, points)
    center = rng.uniform(-50.0, 50.0) + 3.0 * at + 0.2 * at**2 + level * rng.uniform(-1.0, 1.0, points) * half
    least = least_largest_error(at, center, half, degree)
    inside, nodes, coefficients = best_polynomial(at, center, half, degree)
    if abs(least - 1.0) > 1e-4:
        assert inside == (least < 1.0)
    if inside:
        assert (np.abs(value(at, nodes, coefficients) - center) <= half * (1.0 + 1e-9)).all()


def test_a_polynomial_of_the_degree_is_met():
    at = np.arange(100.0)
    center = 5.0 - 2.0 * at + 0.25 * at**2
    inside, nodes, coefficients = best_polynomial(at, center, np.full(100, 1e-6), 2)
    assert inside
    assert value(at, nodes, coefficients) == pytest.approx(center, abs=1e-6)


@pytest.mark.parametrize("indices", [[0, 0, 0, 3], [0, 1, 3, 3], [0, 2, 2, 4], [0, 0, 9, 9]])
def test_indices_are_spread_within_their_ends(indices):
    spread_out = np.array(indices)
    spread(spread_out)
    assert (np.diff(spread_out) > 0).all()
    assert spread_out[0] == 0
    assert spread_out[-1] == indices[-1]
