"""Codes for the largest rates at which the path clock may slow down or speed up (SEGMENTS, slow and fast).

The path clock runs at a rate u = 1 / stretch, 1 when nothing holds it. An allowance of r per second means
|du/dt| <= r. On the wire it is one byte on a logarithmic scale, 16 mantissas an octave:

    v = code                                        code < 16
    v = (16 + code mod 16) 2^(code div 16 - 1)      otherwise

and stands for v 2^-32 a tick. Codes round down, so a device never changes the rate faster than it may.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from planarm_wire.messages import (
    CRC_BYTES,
    HEADER_BYTES,
    HOST_WINDOW_BYTES,
    NEED_UNIT_TICKS,
    QUEUE_FRAME_BYTES,
    TICKS_HZ,
)

RATE_UNIT_PER_S: Final = TICKS_HZ / 2**32
"""What v = 1 means, 0.0037 1/s."""
MAX_CODE: Final = 0xFF
MANTISSAS: Final = 16
MESSAGE_SEGMENTS: Final = 2
"""Most segments that hosts put into one message: its head, the least of their allowances, holds for all of them."""
SEGMENTS_HEAD_BYTES: Final = 3
"""The head of a message of segments: slow, fast and need."""
QUEUED_HEAD_BYTES: Final = SEGMENTS_HEAD_BYTES + QUEUE_FRAME_BYTES
"""What the device's queue keeps of a message besides its segments: its head, and its length."""
SEGMENTS_FRAME_BYTES: Final = HEADER_BYTES + SEGMENTS_HEAD_BYTES + 2 * CRC_BYTES + 1
"""What the line carries of a message besides its segments: header, head, checks and delimiter; no stuffed bytes."""
SHARED_PAYLOAD_BYTES: Final = HOST_WINDOW_BYTES // 2 - 8
"""Longest payload of a message with several segments: its frame takes half of the window. One segment may take more."""


def rate_value(code: int) -> int:
    """Return the v of a code, in 2^-32 a tick."""
    if not 0 <= code <= MAX_CODE:
        raise ValueError(f"a rate code is 0 to {MAX_CODE}, not {code}")
    if code < MANTISSAS:
        return code
    return (MANTISSAS + code % MANTISSAS) << (code // MANTISSAS - 1)


def rate_code(rate_per_s: float) -> int:
    """Return the code of the largest rate that is not above `rate_per_s` [1/s]; infinity is the largest code."""
    if not rate_per_s >= 0.0:
        raise ValueError(f"a rate is 0 or more, not {rate_per_s}")
    value = min(rate_per_s / RATE_UNIT_PER_S, float(rate_value(MAX_CODE)))
    whole = math.floor(value)
    if whole < MANTISSAS:
        return whole
    exponent = whole.bit_length() - MANTISSAS.bit_length()
    return MANTISSAS * (exponent + 1) + (whole >> exponent) - MANTISSAS


def rate_per_s(code: int) -> float:
    """Return the rate that a code stands for [1/s]."""
    return rate_value(code) * RATE_UNIT_PER_S


def need_code(need_ticks: float) -> int:
    """Return a path time to rest in units of NEED_UNIT_TICKS, rounded up; what is too long becomes the largest code."""
    if not need_ticks >= 0.0:
        raise ValueError(f"a path time is 0 or more, not {need_ticks}")
    return MAX_CODE if need_ticks > MAX_CODE * NEED_UNIT_TICKS else math.ceil(need_ticks / NEED_UNIT_TICKS)


@dataclass(frozen=True, slots=True)
class Allowance:
    """How the path clock may change in one segment, and the path time to rest from its start."""

    slow_per_s: float
    fast_per_s: float
    need_ticks: float


NO_ALLOWANCE: Final = Allowance(0.0, 0.0, 0.0)
"""The path clock keeps its rate: a hold acts where all joints are below their start-stop speeds, or not at all."""


def head_of(allowances: Iterable[Allowance]) -> tuple[int, int, int]:
    """Return slow, fast and need of a SEGMENTS message that holds segments with these allowances, at least one."""
    every = tuple(allowances)
    slow = min(allowance.slow_per_s for allowance in every)
    fast = min(allowance.fast_per_s for allowance in every)
    return rate_code(slow), rate_code(fast), need_code(max(allowance.need_ticks for allowance in every))
