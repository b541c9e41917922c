"""Parses the rows of a logic analyser's CSV export."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from planarm_wire.kernel_cache import kernel

Bytes = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.int64]
Slots = npt.NDArray[np.int16]

# What one block leaves for the next; the channels' levels follow.
FIRST_LEVEL = 4
ROW, TIME_PS, ERROR_AT, STARTED = range(FIRST_LEVEL)

PS_PER_S = 10**12


@kernel
def _decimal(text: Bytes, begin: int, end: int, unit: int) -> tuple[np.int64, bool]:
    """Return the decimal number text[begin:end] times `unit`, rounded down, and whether it is one."""
    whole = np.int64(0)
    part = np.int64(0)
    scale = np.int64(unit)
    digits = 0
    after = False
    sign = 1
    for i in range(begin, end):
        c = np.int64(text[i])
        if c >= 48 and c <= 57:
            digits += 1
            if not after:
                whole = whole * 10 + (c - 48)
            elif scale >= 10:
                scale //= 10
                part += (c - 48) * scale
        elif c == 46 and not after:
            after = True
        elif c == 45 and i == begin:
            sign = -1
        else:
            return np.int64(0), False
    return sign * (whole * unit + part), digits > 0


@kernel
def parse_rows(
    text: Bytes,
    slot: Slots,
    time_unit_ps: int,
    rate_hz: int,
    state: Ints,
    times: Ints,
    channels: Bytes,
    levels: Slots,
) -> tuple[int, int]:
    """Parse the whole lines of `text`; return the number of edges and of bytes taken.

    Args:
        text: uint8[n]; the line that its end may cut is left for the next block.
        slot: for each column of levels its channel, or -1, int16[columns].
        time_unit_ps: unit of the first column, or 0 when rows are samples at `rate_hz`.
        rate_hz: samples a second.
        state: int64[FIRST_LEVEL + columns]; ERROR_AT is the number of the first wrong row, from 1, or 0.
        times: receives the edges' moments, ps.
        channels: receives their channels.
        levels: receives their levels.
    """
    columns = len(slot)
    count = 0
    line = 0
    size = len(text)
    while True:
        end = line
        while end < size and text[end] != 10:
            end += 1
        if end >= size:
            return count, line
        stop = end
        while stop > line and text[stop - 1] <= 32:
            stop -= 1
        if stop == line:  # an empty line
            line = end + 1
            continue
        at = line
        row = state[ROW]
        state[ROW] = row + 1
        if time_unit_ps > 0:
            comma = at
            while comma < stop and text[comma] != 44:
                comma += 1
            now, fine = _decimal(text, at, comma, time_unit_ps)
            at = comma + 1
        else:
            now = row // rate_hz * PS_PER_S + np.int64(np.floor(row % rate_hz * (PS_PER_S / rate_hz)))
            fine = True
        if not fine or (state[STARTED] == 1 and now < state[TIME_PS]) or stop - at != 2 * columns - 1:
            state[ERROR_AT] = row + 1
            return count, line
        state[TIME_PS] = now
        state[STARTED] = 1
        for column in range(columns):
            level = np.int64(text[at + 2 * column]) - 48
            if level < 0 or level > 1 or (column + 1 < columns and text[at + 2 * column + 1] != 44):
                state[ERROR_AT] = row + 1
                return count, line
            if level != state[FIRST_LEVEL + column]:
                state[FIRST_LEVEL + column] = level
                if slot[column] >= 0:
                    times[count] = now
                    channels[count] = slot[column]
                    levels[count] = level
                    count += 1
        line = end + 1
