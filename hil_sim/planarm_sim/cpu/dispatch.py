"""The CPU loop: one flat chain over the operations of decoded instructions.

Program counter, cycle, SREG and stack pointer live in locals. Whatever is not an instruction's own business
(events, interrupts, I/O) happens at one place, when the cycle has reached the horizon; an instruction that
accesses I/O notes the access and pulls the horizon in. Cycles: AVR Instruction Set Manual, column AVRe, 16-bit
program counter.
"""

from __future__ import annotations

from planarm_sim.cpu import access as io
from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.access import access_data, note_access, take_interrupt
from planarm_sim.cpu.compiled import kernel  # kernel_cache: see there
from planarm_sim.cpu.events import process_events
from planarm_sim.cpu.flags import (
    KEEP_IT,
    KEEP_ITH,
    KEEP_ITHC,
    C,
    H,
    I,
    N,
    S,
    T,
    V,
    Z,
    add_flags,
    shift_flags,
    sign_flags,
    subtract_flags,
)
from planarm_sim.cpu.layout import (
    ACCESS,
    ACCESS_PC,
    CYCLE,
    HORIZON,
    IRQ_EARLIEST,
    PC,
    PENDING,
    SOMETHING_CHANGED,
    SP,
    SREG_BITS,
    Bytes,
    State,
)
from planarm_sim.cpu.registers import SRAM_END, SRAM_START
from planarm_sim.cpu.service import AT_BAD_OPCODE, AT_BREAK, FIRST_STOP, FLASH_WRITE, RUNNING, service

PC_MASK = 0x3FFF
FLASH_MASK = 0x7FFF
Z_LOW, Z_HIGH = 30, 31
LOWEST_PUSH = SRAM_START + 1
"""A return address that is pushed with SP from here to the end of the SRAM lies in it entirely."""
KEEP_PRODUCT = I | T | H | S | V | N
"""What a product leaves alone."""


@kernel
def run(st: State, sram: Bytes, eeprom: Bytes, code: State, flash: Bytes, target: int) -> int:  # noqa: C901, PLR0912, PLR0915
    """Run whole instructions until `target` is reached or something else ends the loop; returns why."""
    pc = int(st[PC])
    cycle = int(st[CYCLE])
    sreg = int(st[SREG_BITS])
    sp = int(st[SP])
    horizon = cycle
    st[HORIZON] = SOMETHING_CHANGED  # whatever was done to the chip between two runs
    while True:
        if cycle >= horizon:
            st[CYCLE] = cycle
            st[SREG_BITS] = sreg
            st[SP] = sp
            access = st[ACCESS]
            if access != io.NOTHING:
                until = cycle - 1 if access <= io.LAST_READ else cycle
                if until >= st[HORIZON]:  # no event is due before the horizon
                    process_events(st, eeprom, until)
                st[PC] = st[ACCESS_PC]
                pc = access_data(st, sram, eeprom, pc)
            st[PC] = pc
            if st[CYCLE] >= st[HORIZON]:
                cause = service(st, eeprom, target)
                while RUNNING < cause < FIRST_STOP:
                    take_interrupt(st, sram, cause)
                    cause = service(st, eeprom, target)
                if cause != RUNNING:
                    return cause
                pc = int(st[PC])
            cycle = int(st[CYCLE])
            sreg = int(st[SREG_BITS])
            sp = int(st[SP])
            horizon = int(st[HORIZON])
        word = code[pc]
        operation = word & 0xFF
        d = (word >> 8) & 0xFF
        r = (word >> 16) & 0xFFFF
        k = word >> 32

        # --- Arithmetic and logic -------------------------------------------------------------------------
        if operation == op.ADD:
            a = st[d]
            b = st[r]
            result = (a + b) & 0xFF
            st[d] = result
            sreg = (sreg & KEEP_IT) | add_flags(a, b, result)
            pc += 1
            cycle += 1
        elif operation == op.ADC:
            a = st[d]
            b = st[r]
            result = (a + b + (sreg & C)) & 0xFF
            st[d] = result
            sreg = (sreg & KEEP_IT) | add_flags(a, b, result)
            pc += 1
            cycle += 1
        elif operation == op.SUB:
            a = st[d]
            b = st[r]
            result = (a - b) & 0xFF
            st[d] = result
            sreg = (sreg & KEEP_IT) | subtract_flags(a, b, result)
            pc += 1
            cycle += 1
        elif operation == op.SBC:
            a = st[d]
            b = st[r]
            result = (a - b - (sreg & C)) & 0xFF
            st[d] = result
            sreg = (sreg & KEEP_IT) | (subtract_flags(a, b, result) & (sreg | ~Z))
            pc += 1
            cycle += 1
        elif operation == op.CP:
            a = st[d]
            b = st[r]
            sreg = (sreg & KEEP_IT) | subtract_flags(a, b, (a - b) & 0xFF)
            pc += 1
            cycle += 1
        elif operation == op.CPC:
            a = st[d]
            b = st[r]
            result = (a - b - (sreg & C)) & 0xFF
            sreg = (sreg & KEEP_IT) | (subtract_flags(a, b, result) & (sreg | ~Z))
            pc += 1
            cycle += 1
        elif operation == op.AND:
            result = st[d] & st[r]
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | sign_flags(result, 0)
            pc += 1
            cycle += 1
        elif operation == op.OR:
            result = st[d] | st[r]
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | sign_flags(result, 0)
            pc += 1
            cycle += 1
        elif operation == op.EOR:
            result = st[d] ^ st[r]
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | sign_flags(result, 0)
            pc += 1
            cycle += 1
        elif operation == op.COM:
            result = 0xFF - st[d]
            st[d] = result
            sreg = (sreg & KEEP_ITH) | sign_flags(result, 0) | C
            pc += 1
            cycle += 1
        elif operation == op.NEG:
            b = st[d]
            result = -b & 0xFF
            st[d] = result
            sreg = (sreg & KEEP_IT) | subtract_flags(0, b, result)
            pc += 1
            cycle += 1
        elif operation == op.INC:
            result = (st[d] + 1) & 0xFF
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | sign_flags(result, 1 if result == 0x80 else 0)
            pc += 1
            cycle += 1
        elif operation == op.DEC:
            result = (st[d] - 1) & 0xFF
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | sign_flags(result, 1 if result == 0x7F else 0)
            pc += 1
            cycle += 1
        elif operation == op.LSR:
            a = st[d]
            result = a >> 1
            st[d] = result
            sreg = (sreg & KEEP_ITH) | shift_flags(result, a & 1)
            pc += 1
            cycle += 1
        elif operation == op.ROR:
            a = st[d]
            result = (a >> 1) | ((sreg & C) << 7)
            st[d] = result
            sreg = (sreg & KEEP_ITH) | shift_flags(result, a & 1)
            pc += 1
            cycle += 1
        elif operation == op.ASR:
            a = st[d]
            result = (a >> 1) | (a & 0x80)
            st[d] = result
            sreg = (sreg & KEEP_ITH) | shift_flags(result, a & 1)
            pc += 1
            cycle += 1
        elif operation == op.SWAP:
            a = st[d]
            st[d] = (a >> 4) | ((a & 15) << 4)
            pc += 1
            cycle += 1
        elif operation == op.ADIW:
            before = st[d] | (st[d + 1] << 8)
            after = (before + r) & 0xFFFF
            st[d] = after & 0xFF
            st[d + 1] = after >> 8
            wide = sign_flags(after >> 8, (~before & after) >> 15) & ~Z
            sreg = (sreg & KEEP_ITH) | wide | ((before & ~after) >> 15) | (Z if after == 0 else 0)
            pc += 1
            cycle += 2
        elif operation == op.SBIW:
            before = st[d] | (st[d + 1] << 8)
            after = (before - r) & 0xFFFF
            st[d] = after & 0xFF
            st[d + 1] = after >> 8
            wide = sign_flags(after >> 8, (before & ~after) >> 15) & ~Z
            sreg = (sreg & KEEP_ITH) | wide | ((~before & after) >> 15) | (Z if after == 0 else 0)
            pc += 1
            cycle += 2
        elif operation == op.MUL:
            product = st[d] * st[r]
            st[0] = product & 0xFF
            st[1] = product >> 8
            sreg = (sreg & KEEP_PRODUCT) | (product >> 15) | (Z if product == 0 else 0)
            pc += 1
            cycle += 2
        elif operation == op.MULX:
            a = st[d]
            b = st[r]
            if k & op.D_SIGNED:
                a = (a ^ 0x80) - 0x80
            if k & op.R_SIGNED:
                b = (b ^ 0x80) - 0x80
            product = (a * b) & 0xFFFF
            carry = product >> 15
            if k & op.FRACTIONAL:
                product = (product << 1) & 0xFFFF
            st[0] = product & 0xFF
            st[1] = product >> 8
            sreg = (sreg & KEEP_PRODUCT) | carry | (Z if product == 0 else 0)
            pc += 1
            cycle += 2

        # --- Moves, loads and stores ----------------------------------------------------------------------
        elif operation == op.MOV:
            st[d] = st[r]
            pc += 1
            cycle += 1
        elif operation == op.MOVW:
            st[d] = st[r]
            st[d + 1] = st[r + 1]
            pc += 1
            cycle += 1
        elif operation == op.LDD:
            address = (st[r] + (st[r + 1] << 8) + k) & 0xFFFF
            if SRAM_START <= address < SRAM_END:
                st[d] = sram[address - SRAM_START]
            else:
                note_access(st, io.READ, address, d, pc)
                horizon = 0
            pc += 1
            cycle += 2
        elif operation == op.STD:
            address = (st[r] + (st[r + 1] << 8) + k) & 0xFFFF
            value = st[d]
            if SRAM_START <= address < SRAM_END:
                sram[address - SRAM_START] = value
            else:
                note_access(st, io.WRITE, address, value, pc)
                horizon = 0
            pc += 1
            cycle += 2
        elif operation == op.LD_INC:
            address = st[r] + (st[r + 1] << 8)
            st[r] = (address + 1) & 0xFF
            st[r + 1] = ((address + 1) >> 8) & 0xFF
            if SRAM_START <= address < SRAM_END:
                st[d] = sram[address - SRAM_START]
            else:
                note_access(st, io.READ, address, d, pc)
                horizon = 0
            pc += 1
            cycle += 2
        elif operation == op.LD_DEC:
            address = (st[r] + (st[r + 1] << 8) - 1) & 0xFFFF
            st[r] = address & 0xFF
            st[r + 1] = address >> 8
            if SRAM_START <= address < SRAM_END:
                st[d] = sram[address - SRAM_START]
            else:
                note_access(st, io.READ, address, d, pc)
                horizon = 0
            pc += 1
            cycle += 2
        elif operation == op.ST_INC:
            address = st[r] + (st[r + 1] << 8)
            value = st[d]
            st[r] = (address + 1) & 0xFF
            st[r + 1] = ((address + 1) >> 8) & 0xFF
            if SRAM_START <= address < SRAM_END:
                sram[address - SRAM_START] = value
            else:
                note_access(st, io.WRITE, address, value, pc)
                horizon = 0
            pc += 1
            cycle += 2
        elif operation == op.ST_DEC:
            address = (st[r] + (st[r + 1] << 8) - 1) & 0xFFFF
            value = st[d]
            st[r] = address & 0xFF
            st[r + 1] = address >> 8
            if SRAM_START <= address < SRAM_END:
                sram[address - SRAM_START] = value
            else:
                note_access(st, io.WRITE, address, value, pc)
                horizon = 0
            pc += 1
            cycle += 2
        elif operation == op.LDS:
            address = k
            if SRAM_START <= address < SRAM_END:
                st[d] = sram[address - SRAM_START]
            else:
                note_access(st, io.READ, address, d, pc)
                horizon = 0
            pc += 2
            cycle += 2
        elif operation == op.STS:
            address = k
            value = st[d]
            if SRAM_START <= address < SRAM_END:
                sram[address - SRAM_START] = value
            else:
                note_access(st, io.WRITE, address, value, pc)
                horizon = 0
            pc += 2
            cycle += 2
        elif operation == op.LDS_PLAIN:
            st[d] = st[k]
            pc += 2
            cycle += 2
        elif operation == op.STS_PLAIN:
            st[k] = st[d]
            pc += 2
            cycle += 2
        elif operation == op.LPM:
            st[d] = flash[(st[Z_LOW] | (st[Z_HIGH] << 8)) & FLASH_MASK]
            pc += 1
            cycle += 3
        elif operation == op.LPM_INC:
            address = st[Z_LOW] | (st[Z_HIGH] << 8)
            st[Z_LOW] = (address + 1) & 0xFF
            st[Z_HIGH] = ((address + 1) >> 8) & 0xFF
            st[d] = flash[address & FLASH_MASK]
            pc += 1
            cycle += 3
        elif operation == op.POP:
            sp = (sp + 1) & 0xFFFF
            if SRAM_START <= sp < SRAM_END:
                st[d] = sram[sp - SRAM_START]
            else:
                note_access(st, io.READ, sp, d, pc)
                horizon = 0
            pc += 1
            cycle += 2
        elif operation == op.PUSH:
            address = sp
            value = st[d]
            sp = (sp - 1) & 0xFFFF
            if SRAM_START <= address < SRAM_END:
                sram[address - SRAM_START] = value
            else:
                note_access(st, io.WRITE, address, value, pc)
                horizon = 0
            pc += 1
            cycle += 2

        # --- I/O ------------------------------------------------------------------------------------------
        elif operation == op.IN:
            note_access(st, io.READ, r, d, pc)
            horizon = 0
            pc += 1
            cycle += 1
        elif operation == op.OUT:
            note_access(st, io.WRITE, d, st[r], pc)
            horizon = 0
            pc += 1
            cycle += 1
        elif operation == op.IN_SREG:
            st[d] = sreg
            pc += 1
            cycle += 1
        elif operation == op.OUT_SREG:
            value = st[r]
            pc += 1
            cycle += 1
            if value & I and not sreg & I:
                st[IRQ_EARLIEST] = cycle + 1
                if st[PENDING] != 0:
                    st[HORIZON] = min(st[HORIZON], cycle + 1)
                    horizon = min(horizon, cycle + 1)
            sreg = value
        elif operation == op.CBI:
            note_access(st, io.CLEAR_BIT, d, r, pc)
            horizon = 0
            pc += 1
            cycle += 2
        elif operation == op.SBI:
            note_access(st, io.SET_BIT, d, r, pc)
            horizon = 0
            pc += 1
            cycle += 2
        elif operation == op.SBIC:
            note_access(st, io.SKIP_CLEAR, d, r | (k << 8), pc)
            horizon = 0
            pc += 1
            cycle += 1
        elif operation == op.SBIS:
            note_access(st, io.SKIP_SET, d, r | (k << 8), pc)
            horizon = 0
            pc += 1
            cycle += 1

        # --- Bits -----------------------------------------------------------------------------------------
        elif operation == op.BSET:
            sreg |= d
            pc += 1
            cycle += 1
            if d == I:
                st[IRQ_EARLIEST] = cycle + 1
                if st[PENDING] != 0:
                    st[HORIZON] = min(st[HORIZON], cycle + 1)
                    horizon = min(horizon, cycle + 1)
        elif operation == op.BCLR:
            sreg &= ~d
            pc += 1
            cycle += 1
        elif operation == op.BLD:
            st[d] = (st[d] | r) if sreg & T else (st[d] & ~r)
            pc += 1
            cycle += 1
        elif operation == op.BST:
            sreg = (sreg | T) if st[d] & r else (sreg & ~T)
            pc += 1
            cycle += 1

        # --- Jumps, calls, branches and skips -------------------------------------------------------------
        elif operation == op.JUMP2:
            pc = k
            cycle += 2
        elif operation == op.JUMP3:
            pc = k
            cycle += 3
        elif operation == op.IJMP:
            pc = (st[Z_LOW] | (st[Z_HIGH] << 8)) & PC_MASK
            cycle += 2
        elif operation == op.RCALL:
            if LOWEST_PUSH <= sp < SRAM_END:
                sram[sp - SRAM_START] = (pc + 1) & 0xFF
                sram[sp - LOWEST_PUSH] = (pc + 1) >> 8
                sp -= 2
            else:
                note_access(st, io.CALL, sp, pc + 1, pc)
                horizon = 0
            pc = k
            cycle += 3
        elif operation == op.CALL:
            if LOWEST_PUSH <= sp < SRAM_END:
                sram[sp - SRAM_START] = (pc + 2) & 0xFF
                sram[sp - LOWEST_PUSH] = (pc + 2) >> 8
                sp -= 2
            else:
                note_access(st, io.CALL, sp, pc + 2, pc)
                horizon = 0
            pc = k
            cycle += 4
        elif operation == op.ICALL:
            if LOWEST_PUSH <= sp < SRAM_END:
                sram[sp - SRAM_START] = (pc + 1) & 0xFF
                sram[sp - LOWEST_PUSH] = (pc + 1) >> 8
                sp -= 2
            else:
                note_access(st, io.CALL, sp, pc + 1, pc)
                horizon = 0
            pc = (st[Z_LOW] | (st[Z_HIGH] << 8)) & PC_MASK
            cycle += 3
        elif operation == op.RET:
            if LOWEST_PUSH <= sp + 2 < SRAM_END:
                pc = ((int(sram[sp + 1 - SRAM_START]) << 8) | int(sram[sp + 2 - SRAM_START])) & PC_MASK
                sp += 2
            else:
                note_access(st, io.RETURN, pc, pc, pc)
                horizon = 0
            cycle += 4
        elif operation == op.RETI:
            if LOWEST_PUSH <= sp + 2 < SRAM_END:
                pc = ((int(sram[sp + 1 - SRAM_START]) << 8) | int(sram[sp + 2 - SRAM_START])) & PC_MASK
                sp += 2
            else:
                note_access(st, io.RETURN, pc, pc, pc)
                horizon = 0
            sreg |= I
            cycle += 4
            st[IRQ_EARLIEST] = cycle + 1
            if st[PENDING] != 0:
                st[HORIZON] = min(st[HORIZON], cycle + 1)
                horizon = min(horizon, cycle + 1)
        elif operation == op.BRBS:
            if sreg & d:
                pc = k
                cycle += 2
            else:
                pc += 1
                cycle += 1
        elif operation == op.BRBC:
            if sreg & d:
                pc += 1
                cycle += 1
            else:
                pc = k
                cycle += 2
        elif operation == op.CPSE:
            if st[d] == st[r]:
                pc += k
                cycle += k
            pc += 1
            cycle += 1
        elif operation == op.SBRC:
            if st[d] & r == 0:
                pc += k
                cycle += k
            pc += 1
            cycle += 1
        elif operation == op.SBRS:
            if st[d] & r:
                pc += k
                cycle += k
            pc += 1
            cycle += 1

        # --- The chip itself ------------------------------------------------------------------------------
        elif operation == op.NOP:
            pc += 1
            cycle += 1
        elif operation == op.WRAP:
            pc &= PC_MASK
        elif operation == op.SLEEP:
            note_access(st, io.SLEEP, pc, pc, pc)
            horizon = 0
            pc += 1
            cycle += 1
        elif operation == op.WDR:
            note_access(st, io.RESTART_WATCHDOG, pc, pc, pc)
            horizon = 0
            pc += 1
            cycle += 1
        else:
            cause = AT_BAD_OPCODE
            if operation == op.BREAK:
                cause = AT_BREAK
                pc += 1
                cycle += 1
            elif operation == op.SPM:
                cause = FLASH_WRITE
            st[PC] = pc
            st[CYCLE] = cycle
            st[SREG_BITS] = sreg
            st[SP] = sp
            return cause
