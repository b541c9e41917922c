"""Fit one run of steps by the wire's closed form: T_n = first + floor((n I + n (n - 1) / 2 A) / 2^16).

Each step has a window of allowed ticks. In real numbers T is a quadratic in n; `best_polynomial` finds the one
whose largest error, in window widths, is least. Its I and A are rounded to integers, and only the exact expansion of
these decides: it leaves a range for `first`, or none. Where the quadratic is inside all windows but an interval is too
short, as when a joint goes on at its top speed, the first interval is held at its limit and the rest fitted.
"""

from math import floor

import numpy as np
from numpy.typing import NDArray

from planarm.stepping.chebyshev import best_polynomial
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import MAX_INTERVAL_TICKS

Ticks = NDArray[np.int64]
Floats = NDArray[np.float64]
Fit = tuple[bool, int, int, int]
"""(found, first_ticks, interval_q16, add_q16)"""

ONE_Q16 = 65536
LEAST_ADD = -(1 << 31)
"""The wire's add is a signed number of 32 bits."""


@kernel
def fit_run(low: Ticks, high: Ticks, least_interval: int) -> Fit:
    """Return a run whose steps lie in their windows and whose intervals are in their limits, if one is found.

    Args:
        low: earliest tick of each step, relative to the segment's start.
        high: latest tick of each step.
        least_interval: no interval may be shorter.
    """
    steps = low.shape[0]
    for n in range(steps):
        if low[n] > high[n]:
            return False, 0, 0, 0
    if steps < 3:
        # Any interval between the steps' windows; with one step, none.
        apart = max(least_interval, (low[-1] + high[-1] - low[0] - high[0]) // 2) if steps == 2 else 0
        return placed(low, high, least_interval, apart * ONE_Q16, 0)
    inside, interval, add, held = False, 0, 0, 0
    for _ in range(2):
        inside, interval, add = fitted(low, high, held)
        if not inside or min(interval, interval + (steps - 2) * add) >= least_interval * ONE_Q16:
            break
        held = least_interval
    return placed(low, high, least_interval, interval, add) if inside else (False, 0, 0, 0)


@kernel
def placed(low: Ticks, high: Ticks, least_interval: int, interval: int, add: int) -> Fit:
    """Return the run with the given intervals that lies in all windows, expanded exactly, if there is one."""
    steps = low.shape[0]
    last_interval = interval + (steps - 2) * add
    if steps > 1 and min(interval, last_interval) < least_interval * ONE_Q16:
        return False, 0, 0, 0
    if steps > 1 and max(interval, last_interval) > MAX_INTERVAL_TICKS * ONE_Q16:
        return False, 0, 0, 0
    if not LEAST_ADD <= add <= -LEAST_ADD - 1:
        return False, 0, 0, 0
    earliest, latest = low[0], high[0]
    for n in range(1, steps):
        since_first = (n * interval + n * (n - 1) // 2 * add) >> 16
        earliest = max(earliest, low[n] - since_first)
        latest = min(latest, high[n] - since_first)
    return earliest <= latest, earliest + (latest - earliest) // 2, interval, add


@kernel
def fitted(low: Ticks, high: Ticks, held: int) -> tuple[bool, int, int]:
    """Return (inside, interval_q16, add_q16) of the best quadratic through three or more windows.

    With `held` > 0 the first interval is that, and only the add is fitted, 0 or more: what the held interval leaves of
    the times is a straight line over n (n - 1) / 2. Steps 0 and 1 share its zero and become one point, in both windows.
    """
    steps = low.shape[0]
    at, center, half = np.empty(steps), np.empty(steps), np.empty(steps)
    for n in range(steps):
        # The real time of a step, between low and high + 1, is rounded down.
        center[n], half[n] = 0.5 * (low[n] + high[n] + 1) - held * n, 0.5 * (high[n] + 1 - low[n])
        at[n] = 0.5 * n * (n - 1.0) if held > 0 else n
    skipped = 0
    if held > 0:
        skipped = 1
        bottom = max(center[0] - half[0], center[1] - half[1])
        top = min(center[0] + half[0], center[1] + half[1])
        center[1], half[1] = 0.5 * (bottom + top), max(0.5, 0.5 * (top - bottom))
    inside, nodes, newton = best_polynomial(at[skipped:], center[skipped:], half[skipped:], 2 - skipped)
    if held > 0:
        return inside, held * ONE_Q16, max(0, floor(newton[1] * ONE_Q16 + 0.5))
    # c0 + c1 (n - n0) + c2 (n - n0) (n - n1), written with n and n (n - 1) / 2
    interval, add = newton[1] + newton[2] * (1.0 - nodes[0] - nodes[1]), 2.0 * newton[2]
    add_q16 = floor(add * ONE_Q16 + 0.5)
    # What rounding A bends is taken back by I, so that both ends of the run stay.
    bent = add - add_q16 / ONE_Q16
    return inside, floor((interval + 0.5 * bent * (steps - 2)) * ONE_Q16 + 0.5), add_q16
