"""Time-optimal speed along a path by controllable sets, after Pham and Pham 2018 (TOPP-RA).

With x = (ds/dt)^2 and u = d2s/dt2, the motion of a joint is speed |q'| sqrt(x) and acceleration q' u + q'' x, and over
an interval of length h with constant u, x grows linearly: y = x + 2 h u. So in the plane of x at the start and y at the
end of an interval, each limit that is linear in x and u is a half-plane c x + d y <= e. Each interval has such
half-planes for its start and for its end, with the derivatives as seen from inside the interval, so a jump of q'' at a
border is felt from both sides.

Rest is always possible, e >= 0, so the states from which the end can be reached at rest are x in [0, controllable]. The
backward pass finds them; the forward pass takes the largest y at every step.
"""

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]

MAX_CUTS = 256
"""More than the pairs of lines that can bound x; each cut is done with at least one of them."""

INSIDE = 1.0 - 1e-12
"""Keeps x a hair inside the controllable set, so that rounding never closes the forward pass's range."""


@kernel
def fastest_squared_speeds(planes: Floats, bounds: Floats, squared_limits: Floats) -> Floats:
    """Return the greatest x at each gridpoint, at rest where `squared_limits` is 0.

    Args:
        planes: (c, d) of each half-plane, shape (intervals, planes, 2).
        bounds: e of each half-plane, at least 0, shape (intervals, planes).
        squared_limits: largest x by the joints' speeds, shape (intervals + 1,).

    Returns:
        x at the gridpoints, shape (intervals + 1,).
    """
    intervals = planes.shape[0]
    x = squared_limits.copy()
    for i in range(intervals - 1, -1, -1):
        x[i] = INSIDE * largest_start(planes[i], bounds[i], squared_limits[i], x[i + 1])
    for i in range(intervals):
        _, highest, _ = end_range(planes[i], bounds[i], x[i], x[i + 1])
        x[i + 1] = max(0.0, highest)
    return x


@kernel
def largest_start(planes: Floats, bounds: Floats, limit: float, end_limit: float) -> float:
    """Return the largest x in [0, limit] for which some y in [0, end_limit] lies in all half-planes.

    The room for y, highest less lowest, is a concave function of x that is not negative at 0, so cutting x back to
    where the two lines that now bound y meet never cuts off the answer and ends at it.
    """
    x = limit
    for _ in range(MAX_CUTS):
        lowest, highest, closing = end_range(planes, bounds, x, end_limit)
        room = highest - lowest
        if room >= 0.0 or closing >= 0.0:
            return x
        cut = x - room / closing
        if not cut < x:
            return x
        x = max(0.0, cut)
    return x


@kernel
def end_range(planes: Floats, bounds: Floats, x: float, end_limit: float) -> tuple[float, float, float]:
    """Return (lowest y, highest y, d(highest - lowest)/dx) in all half-planes for a given x; lowest > highest: none."""
    lowest, lowest_slope = 0.0, 0.0
    highest, highest_slope = end_limit, 0.0
    for k in range(planes.shape[0]):
        c, d = planes[k, 0], planes[k, 1]
        if d == 0.0:
            # A line along y bounds x itself: no room beyond it, closing with the slope c.
            if c * x > bounds[k]:
                return 0.0, bounds[k] - c * x, -c
            continue
        slope, at = -c / d, (bounds[k] - c * x) / d
        if d < 0.0:
            if at > lowest:
                lowest, lowest_slope = at, slope
        elif at < highest:
            highest, highest_slope = at, slope
    return lowest, highest, highest_slope - lowest_slope
