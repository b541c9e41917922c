"""Fit one run of steps by the wire's closed form: T_n = first + floor((256 n I + n (n - 1) / 2 A) / 2^16).

Each step has a window of allowed ticks. In real numbers T is a quadratic in n; `best_polynomial` finds the one
whose largest error, in window widths, is least. Its I is rounded to 2^-8 ticks, A to 2^-16, and only the exact
expansion of these decides: it leaves a range for `first`, or none. Where the quadratic is inside all windows but an
interval is too short or too long, as where a joint comes to or goes on at its top speed, that interval is held at its
limit and the rest fitted. A slow move, one that begins with SLOW_INTERVAL_TICKS or more, has an A in 2^-8 ticks and
limits of its own.
"""

from math import floor

import numpy as np
from numpy.typing import NDArray

from planarm.stepping.chebyshev import best_polynomial
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import (
    MAX_COARSE_STEPS,
    MAX_INTERVAL_TICKS,
    MIN_SLOW_INTERVAL_TICKS,
    SLOW_INTERVAL_TICKS,
)
from planarm_wire.steps import COARSE_ADD_BITS, LONGEST_INTERVAL_TICKS

Ticks = NDArray[np.int64]
Floats = NDArray[np.float64]
Fit = tuple[bool, int, int, int]
"""(found, first_ticks, interval_q16, add_q16); the interval is a multiple of UNIT_Q16"""

ONE_Q16 = 65536
UNIT_Q16 = 256
"""The wire's unit of the first interval."""
LEAST_ADD = -(1 << 31)
"""The wire's add is a signed number of 32 bits."""
COARSE_UNIT = 1 << COARSE_ADD_BITS
"""Of the add of a run of few steps."""
SLOW_Q16 = SLOW_INTERVAL_TICKS * ONE_Q16


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
        return placed(low, high, least_interval, apart * ONE_Q16, int(np.int64(0)))
    inside, interval, add = fitted(low, high)
    slower, faster = int(np.int64(1)), int(np.int64(-1))  # no literals: `fitted_held` would be compiled for each
    (least, most), unit = limits_of(interval, least_interval), add_unit(steps)
    last = interval + (steps - 2) * add
    if inside and min(interval, last) < least * ONE_Q16:
        inside, interval, add = fitted_held(low, high, least, last < interval, slower, unit)
    elif inside and max(interval, last) > most * ONE_Q16:
        inside, interval, add = fitted_held(low, high, most, last > interval, faster, unit)
    return placed(low, high, least_interval, interval, add) if inside else (False, 0, 0, 0)


@kernel
def limits_of(interval: int, least_interval: int) -> tuple[int, int]:
    """Return (least, most), the limits in ticks of the intervals of a run that begins with this one."""
    if interval >= SLOW_Q16:
        return max(least_interval, MIN_SLOW_INTERVAL_TICKS), LONGEST_INTERVAL_TICKS
    return least_interval, MAX_INTERVAL_TICKS


@kernel
def add_unit(steps: int) -> int:
    """Return what the add of a run with so many steps counts, in 2^-16 ticks."""
    return COARSE_UNIT if steps <= MAX_COARSE_STEPS else 1


@kernel
def placed(low: Ticks, high: Ticks, least_interval: int, interval: int, add: int) -> Fit:
    """Return the run with the given intervals that lies in all windows, expanded exactly, if there is one."""
    steps = low.shape[0]
    least, most = limits_of(interval, least_interval)
    last_interval = interval + (steps - 2) * add
    if steps > 1 and min(interval, last_interval) < least * ONE_Q16:
        return False, 0, 0, 0
    if steps > 1 and max(interval, last_interval) > most * ONE_Q16:
        return False, 0, 0, 0
    if interval >= SLOW_Q16 and steps > MAX_COARSE_STEPS:
        return False, 0, 0, 0
    if interval < SLOW_Q16 and not LEAST_ADD <= add < -LEAST_ADD:
        return False, 0, 0, 0
    earliest, latest = low[0], high[0]
    for n in range(1, steps):
        since_first = (n * interval + n * (n - 1) // 2 * add) >> 16
        earliest = max(earliest, low[n] - since_first)
        latest = min(latest, high[n] - since_first)
    return earliest <= latest, fewest_bytes(earliest, latest), interval, add


@kernel
def fewest_bytes(low: int, high: int) -> int:
    """Return the number between low and high that takes the fewest bytes on the wire: the middle, or near a border."""
    middle = low + (high - low) // 2
    border = 128
    while border <= low:
        border <<= 7
    return min(middle, border - 1)


@kernel
def fit_smaller(low: Ticks, high: Ticks, least_interval: int, add: int) -> Fit:
    """Return a run whose add takes fewer bytes than `add`, if one is found: the nearest of each length, shortest first.

    Args:
        low: as for `fit_run`.
        high: as for `fit_run`.
        least_interval: as for `fit_run`.
        add: of a run that fits.
    """
    unit = add_unit(low.shape[0])
    limit = 64 * unit  # zigzag: one byte holds -64 .. 63
    while low.shape[0] > 2 and not -limit <= add < limit:
        smaller = limit - unit if add > 0 else -limit
        inside, interval = fitted_line(low, high, smaller)
        if inside:
            found, first, interval, smaller = placed(low, high, least_interval, interval, smaller)
            if found:
                return found, first, interval, smaller
        limit <<= 7
    return False, 0, 0, 0


@kernel
def fitted_line(low: Ticks, high: Ticks, add_q16: int) -> tuple[bool, int]:
    """Return (inside, interval_q16): the best interval for a given add."""
    steps = low.shape[0]
    at, center, half = np.empty(steps), np.empty(steps), np.empty(steps)
    for n in range(steps):
        at[n] = n
        center[n] = 0.5 * (low[n] + high[n] + 1) - 0.5 * n * (n - 1.0) * add_q16 / ONE_Q16
        half[n] = 0.5 * (high[n] + 1 - low[n])
    inside, _, newton = best_polynomial(at, center, half, 1)
    return inside, UNIT_Q16 * floor(newton[1] * (ONE_Q16 // UNIT_Q16) + 0.5)


@kernel
def fitted(low: Ticks, high: Ticks) -> tuple[bool, int, int]:
    """Return (inside, interval_q16, add_q16) of the best quadratic through three or more windows."""
    steps = low.shape[0]
    at, center, half = np.empty(steps), np.empty(steps), np.empty(steps)
    for n in range(steps):
        # The real time of a step, between low and high + 1, is rounded down.
        at[n], center[n], half[n] = n, 0.5 * (low[n] + high[n] + 1), 0.5 * (high[n] + 1 - low[n])
    inside, nodes, newton = best_polynomial(at, center, half, 2)
    # c0 + c1 (n - n0) + c2 (n - n0) (n - n1), written with n and n (n - 1) / 2
    interval, add = newton[1] + newton[2] * (1.0 - nodes[0] - nodes[1]), 2.0 * newton[2]
    # What rounding the one with the larger unit tilts is taken back by the other, so that both ends of the run stay.
    unit = add_unit(steps)
    if unit > 1:
        add_q16 = unit * floor(add * (ONE_Q16 // unit) + 0.5)
        interval += 0.5 * (steps - 2) * (add - add_q16 / ONE_Q16)
        return inside, UNIT_Q16 * floor(interval * (ONE_Q16 // UNIT_Q16) + 0.5), add_q16
    interval_q16 = UNIT_Q16 * floor(interval * (ONE_Q16 // UNIT_Q16) + 0.5)
    tilted = interval - interval_q16 / ONE_Q16
    return inside, interval_q16, floor((add + 2.0 * tilted / (steps - 2)) * ONE_Q16 + 0.5)


@kernel
def fitted_held(low: Ticks, high: Ticks, held: int, at_end: bool, sense: int, unit: int) -> tuple[bool, int, int]:
    """Return (inside, interval_q16, add_q16) of the best quadratic whose first, or last, interval is `held`.

    Away from there the intervals grow (sense 1) or shrink (-1), or stay, by whole units.

    By convexity, where the best quadratic breaks a limit of the intervals, the best that keeps it stands on the limit.
    Counted from the held end, what the held interval leaves of the times is a straight line over n (n - 1) / 2. The two
    steps at the held end share its zero and become one point, in both windows.
    """
    steps = low.shape[0]
    at, center, half = np.empty(steps - 1), np.empty(steps - 1), np.empty(steps - 1)
    bottom, top = 0.0, 0.0
    for n in range(steps):
        i = steps - 1 - n if at_end else n
        sign = -1.0 if at_end else 1.0
        middle, width = sign * 0.5 * (low[i] + high[i] + 1) - held * n, 0.5 * (high[i] + 1 - low[i])
        if n < 2:
            bottom = max(bottom, middle - width) if n else middle - width
            top = min(top, middle + width) if n else middle + width
        else:
            at[n - 1], center[n - 1], half[n - 1] = 0.5 * n * (n - 1.0), middle, width
    at[0], center[0], half[0] = 0.0, 0.5 * (bottom + top), max(0.5, 0.5 * (top - bottom))
    inside, _, newton = best_polynomial(at, center, half, 1)
    grows = unit * sense * max(0, sense * floor(newton[1] * (ONE_Q16 // unit) + 0.5))
    if at_end:
        # Whole 2^-8 ticks, on the held limit's right side.
        units = -(-sense * (held * ONE_Q16 + (steps - 2) * grows) // UNIT_Q16)
        return inside, sense * units * UNIT_Q16, -grows
    return inside, held * ONE_Q16, grows
