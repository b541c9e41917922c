"""SREG after an arithmetic or logic instruction (AVR Instruction Set Manual, the Boolean formulas of each).

Operands and results are 8-bit values in int64, already masked. Each function returns the bits that the
instruction decides; the caller keeps the others.
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import kernel  # kernel_cache: see there

C, Z, N, V, S, H, T, I = (1 << bit for bit in range(8))  # noqa: E741 - the manual's names
KEEP_IT = I | T
KEEP_ITC = I | T | C
KEEP_ITH = I | T | H
KEEP_ITHC = I | T | H | C


@kernel
def sign_flags(result: int, overflow: int) -> int:
    """Z, N, V and S of an 8-bit result; `overflow` is V as 0 or 1."""
    negative = result >> 7
    zero = 1 if result == 0 else 0
    return (zero << 1) | (negative << 2) | (overflow << 3) | ((negative ^ overflow) << 4)


@kernel
def add_flags(a: int, b: int, result: int) -> int:
    """H, S, V, N, Z, C of a + b (+ C)."""
    carry = (a & b) | ((a | b) & ~result)
    overflow = (((a ^ result) & (b ^ result)) >> 7) & 1
    return ((carry >> 7) & 1) | ((carry & 8) << 2) | sign_flags(result, overflow)


@kernel
def subtract_flags(a: int, b: int, result: int) -> int:
    """H, S, V, N, Z, C of a - b (- C); the instructions with carry further AND Z with the old Z."""
    borrow = (~a & b) | ((~a | b) & result)
    overflow = (((a ^ b) & (a ^ result)) >> 7) & 1
    return ((borrow >> 7) & 1) | ((borrow & 8) << 2) | sign_flags(result, overflow)


@kernel
def shift_flags(result: int, carry: int) -> int:
    """S, V, N, Z, C of a shift to the right: V = N xor C."""
    return carry | sign_flags(result, (result >> 7) ^ carry)
