"""SREG after an arithmetic or logic instruction (AVR Instruction Set Manual, the Boolean formulas of each).

Operands and results are 8-bit values in int64, already masked. Each function returns the bits that the
instruction decides; the caller keeps the others.
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there

C, Z, N, V, S, H, T, I = (1 << bit for bit in range(8))  # noqa: E741 - the manual's names
KEEP_IT = I | T
KEEP_ITC = I | T | C
KEEP_ITH = I | T | H
KEEP_ITHC = I | T | H | C


@inner
def sign_flags(result: int, overflow: int) -> int:
    """Z, N, V and S of an 8-bit result; `overflow` is V as 0 or 1."""
    negative = result >> 7
    zero = 1 if result == 0 else 0
    return (zero << 1) | (negative << 2) | (overflow << 3) | ((negative ^ overflow) << 4)
