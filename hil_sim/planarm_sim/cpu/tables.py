"""What the CPU loop looks up: numbers and what instructions do to SREG, behind the chip's state; words of registers.

The flags follow the Boolean formulas of the AVR Instruction Set Manual. Of a sum or a difference of a and b, the
carries (or borrows) into each bit are `a ^ b ^ total`: bit 4 is H, bit 8 is C, and bits 7 and 8 differ when V is
set. S is N xor V, so that what the result says and what the carries say joins by xor.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu.flags import C, H, N, S, V, Z
from planarm_sim.cpu.layout import TEMP
from planarm_sim.cpu.registers import GPIOR0, GPIOR1, GPIOR2, ICR1H, OCR1AH, OCR1BH, TCNT1H

_Flags = NDArray[np.int64]


def result_flags() -> _Flags:
    """Z, N and S of the 256 results, as if V were clear."""
    result = np.arange(256)
    flags: _Flags = Z * (result == 0) | (N | S) * (result >> 7)
    return flags


def carry_flags() -> _Flags:
    """H, C, V, and V once more as what it does to S, for the 512 patterns of carries into bits 0 to 8."""
    carries = np.arange(512)
    overflow = (carries >> 7 ^ carries >> 8) & 1
    return H * (carries >> 4 & 1) | C * (carries >> 8) | (V | S) * overflow


def shift_flags() -> _Flags:
    """Z, N, C, V = N xor C and S = C of a shift to the right of 512 nine-bit values by one bit."""
    value = np.arange(512)
    result, carry = value >> 1, value & 1
    negative = result >> 7
    flags: _Flags = Z * (result == 0) | N * negative | (C | S) * carry | V * (negative ^ carry)
    return flags


WRITES_WORD = np.full(256, -1, dtype=np.int64)
"""The word of the state that a data address writes and nothing else, or -1: general registers, GPIORn, and the high
bytes of timer 1's registers, which wait in TEMP."""
WRITES_WORD[:32] = np.arange(32)
WRITES_WORD[[GPIOR0, GPIOR1, GPIOR2]] = (GPIOR0, GPIOR1, GPIOR2)
WRITES_WORD[[TCNT1H, ICR1H, OCR1AH, OCR1BH]] = TEMP

CONSTANT_WORDS: Final = np.concatenate((np.arange(256), result_flags(), carry_flags(), shift_flags()))
"""What stands at `layout.CONSTANTS` and behind it."""
