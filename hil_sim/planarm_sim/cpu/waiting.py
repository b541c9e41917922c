"""Finds loops in the flash that only wait for an interrupt to change something in the SRAM.

Such a loop runs straight from its head to a jump back, and one turn of it leaves registers and flags as the turn before
left them: it stores nothing but registers, and what it reads it has written itself in the same turn, or never writes.
Once such a turn has passed without an interrupt, all further ones do nothing until one comes, and the CPU loop passes
over them without a look. Loops that wait in less simple ways are found while they run; see `idle`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.registers import SRAM_END, SRAM_START

_Words = NDArray[np.int64]
CARRIES, SIGNS = -1, -2
"""Stand for the flags C and H, and Z, N, V and S."""
_CARRY_MASKS = 1 << 0 | 1 << 5
_SIGN_MASKS = 0b11110
MOST_WORDS = 12
"""Longest loop that is looked at."""
_JUMPS = (op.BRBS_BACK, op.BRBC_BACK, op.JUMP2_BACK)
JUMP_CYCLES = 2
MOST_CYCLES = 63
"""Longest turn that there is room for in a fused word."""


def waiting_turns(code: _Words) -> dict[int, int]:
    """Return, for each word that closes a loop which only waits, the cycles of a turn."""
    operation, target = code & 0xFF, code >> 32
    places = np.arange(len(code))
    back = np.isin(operation, _JUMPS) & (target <= places) & (places - target < MOST_WORDS)
    found = {int(at): _turn(code, int(target[at]), int(at)) for at in np.nonzero(back)[0]}
    return {at: cycles for at, cycles in found.items() if 0 < cycles <= MOST_CYCLES}


def _turn(code: _Words, head: int, jump: int) -> int:
    """Cycles of a turn from `head` to the jump back at `jump`; 0 when it may do more than wait."""
    cycles, at = 0, head
    early_reads: set[int] = set()
    writes: set[int] = set()
    while at < jump:
        effect = _effect(int(code[at]))
        if effect is None:
            return 0
        words, takes, reads, wrote = effect
        early_reads |= reads - writes
        writes |= wrote
        cycles, at = cycles + takes, at + words
    if at != jump:
        return 0  # the jump is the second word of what stands before it
    operation = int(code[jump]) & 0xFF
    if operation in (op.BRBS_BACK, op.BRBC_BACK):
        mask = int(code[jump]) >> 8 & 0xFF
        asked = {CARRIES} if mask & _CARRY_MASKS else {SIGNS} if mask & _SIGN_MASKS else set()
        early_reads |= asked - writes
    return 0 if early_reads & writes else cycles + JUMP_CYCLES


def _effect(word: int) -> tuple[int, int, set[int], set[int]] | None:
    """Words, cycles, what is read and what is written, as places in the state; None for what is not only waiting."""
    operation, d, r, k = word & 0xFF, word >> 8 & 0xFF, word >> 16 & 0xFFFF, word >> 32
    both, carried = {CARRIES, SIGNS}, {d, r, CARRIES, SIGNS}
    known = {
        op.NOP: (1, 1, set[int](), set[int]()),
        op.MOV: (1, 1, {r}, {d}),
        op.MOVW: (1, 1, {r, r + 1}, {d, d + 1}),
        op.LDS_PLAIN: (2, 2, {k}, {d}),
        op.CP: (1, 1, {d, r}, both),
        op.CPC: (1, 1, carried, both),
        **dict.fromkeys((op.ADD, op.SUB), (1, 1, {d, r}, {d, *both})),
        **dict.fromkeys((op.ADC, op.SBC), (1, 1, carried, {d, *both})),
        **dict.fromkeys((op.AND, op.OR, op.EOR), (1, 1, {d, r}, {d, SIGNS})),
    }
    if operation == op.LDS and SRAM_START <= k < SRAM_END:
        return 2, 2, set(), {d}
    return known.get(operation)
