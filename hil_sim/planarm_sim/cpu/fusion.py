"""Pairs of instructions that the CPU loop does in one go.

Going from one instruction to the next costs about as much as a simple instruction. Pairs that compilers write again
and again (saving registers, loading two bytes, comparing and branching) are therefore decoded once more, as one
operation that does the first and, if nothing is due in between, the second. The second's own word stays as it is: a
program may jump to it, and when something is due the first is done alone. Only `dispatch.run` sees fused words; whoever
looks for instructions takes `Program.code`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.registers import SRAM_END, SRAM_START

_Words = NDArray[np.int64]
MASK_SHIFT, SENSE_SHIFT = 16, 24
"""Where COMPARE_BRANCH has the branch's mask in SREG, and whether it asks for a set bit; below is its target."""


def fuse(code: _Words) -> _Words:
    """Return `code` with the first words of pairs replaced."""
    fused = code.copy()
    operation = code & 0xFF
    d, r, k = code >> 8 & 0xFF, code >> 16 & 0xFFFF, code >> 32
    for first, second, pair in ((op.PUSH, op.PUSH, op.PUSH2), (op.POP, op.POP, op.POP2)):
        at = np.nonzero((operation[:-1] == first) & (operation[1:] == second))[0]
        fused[at] = pair | d[at] << 8 | d[at + 1] << 16
    at = np.nonzero((operation[:-1] == op.MOV) & (operation[1:] == op.MOV))[0]
    fused[at] = op.MOV2 | d[at] << 8 | r[at] << 16 | (d[at + 1] | r[at + 1] << 8) << 32
    in_sram = (operation == op.LDS) & (k >= SRAM_START) & (k < SRAM_END)
    at = np.nonzero(in_sram[:-2] & in_sram[2:])[0]
    fused[at] = op.LDS2 | d[at] << 8 | d[at + 2] << 16 | (k[at] | k[at + 2] << 16) << 32
    for branch, sense in ((op.BRBS, 1), (op.BRBS_BACK, 1), (op.BRBC, 0), (op.BRBC_BACK, 0)):
        at = np.nonzero((operation[:-1] == op.CP) & (operation[1:] == branch))[0]
        what = k[at + 1] | d[at + 1] << MASK_SHIFT | sense << SENSE_SHIFT
        fused[at] = op.COMPARE_BRANCH | r[at] << 16 | d[at] << 8 | what << 32
    return fused
