"""The instructions that programs execute least, out of the CPU loop's way; and what ends it.

Beginning and end are those of the loop's cases: PC is behind the instruction's first word, CYCLE one cycle on.
"""

from __future__ import annotations

from planarm_sim.cpu import access as io
from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.access import note_access
from planarm_sim.cpu.compiled import inner  # kernel_cache: see there
from planarm_sim.cpu.flags import KEEP_IT, KEEP_ITH, H, I, N, S, T, V, Z
from planarm_sim.cpu.layout import CARRY_FLAGS, CYCLE, PC, RESULT_FLAGS, SHIFT_FLAGS, SREG_BITS, Bytes, State
from planarm_sim.cpu.memory import Z_HIGH, Z_LOW, call, load, store
from planarm_sim.cpu.service import AT_BAD_OPCODE, AT_BREAK, FLASH_WRITE, RUNNING

PC_MASK = 0x3FFF
KEEP_PRODUCT = I | T | H | S | V | N
"""What a product leaves alone."""


@inner
def do_rare(st: State, memory: Bytes, word: int) -> int:  # noqa: C901, PLR0912, PLR0915 - one case an instruction
    """Execute an instruction for which the CPU loop has no case; returns RUNNING, or why the loop ends."""
    pc = int(st[PC])
    cycle = int(st[CYCLE])
    sreg = int(st[SREG_BITS])
    operation = word & 0xFF
    cause = RUNNING
    if operation == op.NEG:
        d = (word >> 8) & 0xFF
        b = st[d]
        total = -b
        st[d] = total & 0xFF
        sreg = (sreg & KEEP_IT) | (st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((b ^ total) & 0x1FF)])
    elif operation == op.ASR:
        d = (word >> 8) & 0xFF
        a = st[d]
        a |= (a & 0x80) << 1
        st[d] = a >> 1
        sreg = (sreg & KEEP_ITH) | st[SHIFT_FLAGS + (a & 0x1FF)]
    elif operation == op.MULX:
        a = st[(word >> 8) & 0xFF]
        b = st[(word >> 16) & 0xFFFF]
        kind = word >> 32
        if kind & op.D_SIGNED:
            a = (a ^ 0x80) - 0x80
        if kind & op.R_SIGNED:
            b = (b ^ 0x80) - 0x80
        product = (a * b) & 0xFFFF
        carry = product >> 15
        if kind & op.FRACTIONAL:
            product = (product << 1) & 0xFFFF
        st[0] = product & 0xFF
        st[1] = product >> 8
        sreg = (sreg & KEEP_PRODUCT) | carry | (Z if product == 0 else 0)
        cycle += 1
    elif operation == op.LD_DEC:
        r = (word >> 16) & 0xFFFF
        address = ((st[r] | (st[r + 1] << 8)) - 1) & 0xFFFF
        st[r] = address & 0xFF
        st[r + 1] = address >> 8
        load(st, memory, address, (word >> 8) & 0xFF, pc - 1)
        cycle += 1
    elif operation == op.ST_DEC:
        r = (word >> 16) & 0xFFFF
        address = ((st[r] | (st[r + 1] << 8)) - 1) & 0xFFFF
        value = st[(word >> 8) & 0xFF]
        st[r] = address & 0xFF
        st[r + 1] = address >> 8
        store(st, memory, address, value, pc - 1)
        cycle += 1
    elif operation == op.BLD:
        d = (word >> 8) & 0xFF
        r = (word >> 16) & 0xFFFF
        st[d] = (st[d] | r) if sreg & T else (st[d] & ~r)
    elif operation == op.BST:
        sreg = (sreg | T) if st[(word >> 8) & 0xFF] & (word >> 16) & 0xFFFF else (sreg & ~T)
    elif operation == op.IJMP:
        pc = (st[Z_LOW] | (st[Z_HIGH] << 8)) & PC_MASK
        cycle += 1
    elif operation == op.ICALL:
        call(st, memory, pc, pc)
        pc = (st[Z_LOW] | (st[Z_HIGH] << 8)) & PC_MASK
        cycle += 2
    elif operation == op.WRAP:
        pc = (pc - 1) & PC_MASK
        cycle -= 1
    elif operation == op.SLEEP:
        note_access(st, io.SLEEP, pc, pc, pc - 1)
    elif operation == op.WDR:
        note_access(st, io.RESTART_WATCHDOG, pc, pc, pc - 1)
    elif operation == op.BREAK:
        cause = AT_BREAK
    else:
        pc -= 1
        cycle -= 1
        cause = FLASH_WRITE if operation == op.SPM else AT_BAD_OPCODE
    st[PC] = pc
    st[CYCLE] = cycle
    st[SREG_BITS] = sreg
    return cause
