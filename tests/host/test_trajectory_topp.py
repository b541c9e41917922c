"""The solver against linear programming: scipy's HiGHS knows nothing of controllable sets."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from motion_paths import joint, tip_path, tip_points, waves
from planarm.trajectory.timing import time_path
from planarm.trajectory.topp import largest_start


def optimum_s(path, speeds, accelerations, per_piece):
    """Duration of the fastest motion on an even grid: the constraints are linear in x = s_dot^2, and a larger x at one
    gridpoint never forbids a larger one elsewhere for long, so the greatest sum of x is the fastest motion."""
    borders = path.borders_s
    s = np.append(
        np.concatenate([np.linspace(a, b, per_piece, False) for a, b in pairwise(borders)]),
        borders[-1],
    )
    h, n = np.diff(s), len(s) - 1
    rows, right = [], []
    for side, at in (("right", s[:-1]), ("left", s[1:])):
        _, dq, ddq = path.evaluate(at, side)
        for j in range(2):
            slope = dq[:, j] / (2.0 * h)
            start = -slope + (ddq[:, j] if side == "right" else 0.0)
            end = slope + (ddq[:, j] if side == "left" else 0.0)
            rows.append(sparse.diags([start, end], [0, 1], shape=(n, n + 1)))
            right.append(np.full(n, accelerations[j]))
    strips = sparse.vstack(rows)
    bounds = np.full(n + 1, np.inf)
    for side, part in (("right", slice(None)), ("left", slice(None))):
        dq = np.abs(path.evaluate(s[part], side).dq_rad)
        bounds = np.minimum(bounds, ((np.array(speeds) / np.maximum(dq, 1e-9)) ** 2).min(axis=1))
    bounds[np.isin(s, [s[0], s[-1], *path.stops_s])] = 0.0
    solved = linprog(
        -np.ones(n + 1),
        A_ub=sparse.vstack([strips, -strips]),
        b_ub=np.concatenate([*right, *right]),
        bounds=np.column_stack([np.zeros(n + 1), bounds]),
        method="highs",
    )
    assert solved.status == 0, solved.message
    rate = np.sqrt(np.maximum(0.0, solved.x))
    return float(np.sum(2.0 * h / (rate[:-1] + rate[1:])))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("cornered", [False, True])
def test_the_duration_is_the_optimum_of_linear_programming(seed, cornered):
    rng = np.random.default_rng(seed)
    path = tip_path(tip_points(rng, 5)) if cornered else waves(rng)
    speeds, accelerations = rng.uniform(0.5, 3.0, 2), rng.uniform(3.0, 20.0, 2)
    made = time_path(path, [joint(*limits) for limits in zip(speeds, accelerations, strict=True)], share=1.0)
    assert made.duration_s == pytest.approx(optimum_s(path, speeds, accelerations, 120), rel=0.01)


numbers = st.floats(-100.0, 100.0).filter(lambda x: x == 0.0 or abs(x) > 1e-3)


@settings(max_examples=150, deadline=None)
@given(
    strips=st.lists(st.tuples(numbers, numbers, st.floats(0.1, 50.0)), min_size=1, max_size=6),
    limits=st.tuples(st.floats(0.01, 100.0), st.floats(0.0, 100.0)),
)
def test_the_largest_start_is_that_of_linear_programming(strips, limits):
    lines = np.array([(c, d) for c, d, _ in strips])
    widths = np.array([a for _, _, a in strips])
    solved = linprog(
        [-1.0, 0.0],
        A_ub=np.vstack([lines, -lines]),
        b_ub=np.concatenate([widths, widths]),
        bounds=[(0.0, limits[0]), (0.0, limits[1])],
        method="highs",
    )
    assert solved.status == 0
    both = np.concatenate([lines, -lines]), np.concatenate([widths, widths])
    assert largest_start(*both, limits[0], limits[1]) == pytest.approx(solved.x[0], rel=1e-6, abs=1e-6)
