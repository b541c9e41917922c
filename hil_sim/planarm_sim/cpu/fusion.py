"""Instructions that the CPU loop does in one go, and loops that only wait.

Going from one instruction to the next costs about as much as a simple instruction. Pairs that compilers write again
and again (saving registers, loading or adding two bytes, comparing and branching), and the five instructions with
which their interrupt handlers begin and end, are therefore decoded once more, as one operation that does the first and,
if nothing is due in between, the others. The others' own words stay as they are: a program may jump to them, and when
something is due the first is done alone. Only `dispatch.run` sees fused words; whoever looks for instructions takes
`Program.code`.

Jumps back that close a loop which only waits are given the length of its turn (see `waiting`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.registers import SRAM_END, SRAM_START
from planarm_sim.cpu.waiting import waiting_turns

_Words = NDArray[np.int64]
MASK_SHIFT, SENSE_SHIFT, TURN_SHIFT = 16, 24, 25
"""Where COMPARE_BRANCH has the branch's mask in SREG, whether it asks for a set bit, and the turn's length; below is
its target."""


def fuse(code: _Words) -> _Words:
    """Return `code` with the first words of pairs replaced, and with the lengths of turns."""
    fused = code.copy()
    operation = code & 0xFF
    d, r, k = code >> 8 & 0xFF, code >> 16 & 0xFFFF, code >> 32
    turns = waiting_turns(code)
    turn_after = np.zeros_like(code)
    for place, cycles in turns.items():
        fused[place] |= cycles << 16
        turn_after[place - 1] = cycles
    operation = fuse_handlers(fused, operation, d, r)
    for one, pair, four in ((op.PUSH, op.PUSH2, op.PUSH4), (op.POP, op.POP2, op.POP4)):
        at = runs(operation, one, one)
        fused[at] = pair | d[at] << 8 | d[at + 1] << 16
        at = runs(operation, one, one, one, one)
        fused[at] = four | d[at] << 8 | d[at + 1] << 16 | (d[at + 2] | d[at + 3] << 8) << 32
    for first, second, pair in (
        (op.MOV, op.MOV, op.MOV2),
        (op.ADD, op.ADC, op.ADD_ADC),
        (op.SUB, op.SBC, op.SUB_SBC),
    ):
        at = runs(operation, first, second)
        fused[at] = pair | d[at] << 8 | r[at] << 16 | (d[at + 1] | r[at + 1] << 8) << 32
    in_sram = (operation == op.LDS) & (k >= SRAM_START) & (k < SRAM_END)
    at = np.nonzero(in_sram[:-2] & in_sram[2:])[0]
    fused[at] = op.LDS2 | d[at] << 8 | d[at + 2] << 16 | (k[at] | k[at + 2] << 16) << 32
    for branch, sense in ((op.BRBS, 1), (op.BRBS_BACK, 1), (op.BRBC, 0), (op.BRBC_BACK, 0)):
        at = np.nonzero((operation[:-1] == op.CP) & (operation[1:] == branch))[0]
        what = k[at + 1] | d[at + 1] << MASK_SHIFT | sense << SENSE_SHIFT | turn_after[at] << TURN_SHIFT
        fused[at] = op.COMPARE_BRANCH | r[at] << 16 | d[at] << 8 | what << 32
    return fused


def runs(operation: _Words, *wanted: int) -> _Words:
    """Return where operations stand one after the other."""
    last = len(operation) - len(wanted) + 1
    return np.nonzero(np.logical_and.reduce([operation[n : last + n] == o for n, o in enumerate(wanted)]))[0]


def fuse_handlers(fused: _Words, operation: _Words, d: _Words, r: _Words) -> _Words:
    """Replace the first words of what avr-gcc begins and ends interrupt handlers with, which are no pairs' then.

    push a, push b, in b SREG, push b, eor a a; and pop b, out SREG b, pop b, pop a, reti. Returns `operation` with
    these words' new ones.
    """
    operation = operation.copy()
    enter = runs(operation, op.PUSH, op.PUSH, op.IN_SREG, op.PUSH, op.EOR)
    a, b = d[enter], d[enter + 1]
    same = (a != b) & (d[enter + 2] == b) & (d[enter + 3] == b) & (d[enter + 4] == a) & (r[enter + 4] == a)
    leave = runs(operation, op.POP, op.OUT_SREG, op.POP, op.POP, op.RETI)
    c, e = d[leave + 3], d[leave]
    like = (c != e) & (r[leave + 1] == e) & (d[leave + 2] == e)
    for at, first, second, what in (
        (enter[same], a[same], b[same], op.ENTER),
        (leave[like], c[like], e[like], op.LEAVE),
    ):
        fused[at] = what | first << 8 | second << 16
        operation[at] = what
    return operation
