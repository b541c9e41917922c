"""The CPU loop: one flat chain over the operations of decoded instructions.

Program counter, cycle and SREG live in locals, flags come out of tables. Whatever is not an instruction's own
business (events, interrupts, I/O) happens at one place, when the cycle has reached LOOK_AT; an instruction that
accesses I/O notes the access and pulls LOOK_AT in. Each instruction begins as one of one word and one cycle.
It is one function, longer than others may be: an interpreter's table, whose entries share those locals. What is
rare is in `rare`, what is fused in `fusion`.
Cycles: AVR Instruction Set Manual, column AVRe, 16-bit program counter.
"""

from __future__ import annotations

import numpy as np

from planarm_sim.cpu import access as io
from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.access import look_early, note_access
from planarm_sim.cpu.compiled import kernel  # kernel_cache: see there
from planarm_sim.cpu.flags import KEEP_IT, KEEP_ITH, KEEP_ITHC, C, I, S, V, Z, sign_flags
from planarm_sim.cpu.layout import (
    CARRY_FLAGS,
    CHANGES,
    CYCLE,
    HORIZON,
    IRQ_EARLIEST,
    LOOK_AT,
    PC,
    PENDING,
    RESULT_FLAGS,
    SHIFT_FLAGS,
    SOMETHING_CHANGED,
    SP,
    SREG_BITS,
    STORES,
    Bytes,
    State,
)
from planarm_sim.cpu.memory import (
    LOWEST_POP,
    LOWEST_PUSH,
    PC_BITS,
    SRAM_BYTES,
    Z_HIGH,
    Z_LOW,
    call,
    go_back,
    load,
    moment,
    pass_turns,
    pop,
    push,
    store,
)
from planarm_sim.cpu.rare import KEEP_PRODUCT, do_rare
from planarm_sim.cpu.registers import READS_PLAIN, SRAM_START
from planarm_sim.cpu.service import RUNNING, look_up
from planarm_sim.cpu.tables import WRITES_WORD

PC_MASK = 0x3FFF
FLASH_MASK = 0x7FFF


@kernel
def run(st: State, memory: Bytes, words: State, code: State, flash: Bytes, target: int) -> int:  # noqa: C901, PLR0912, PLR0915
    """Run whole instructions until `target` is reached or something else ends the loop; returns why.

    `memory` is the SRAM with the EEPROM behind it, `words` the same as int64 words.
    """
    pc = int(st[PC])
    cycle = int(st[CYCLE])
    sreg = int(st[SREG_BITS])
    st[HORIZON] = SOMETHING_CHANGED  # whatever was done to the chip between two runs
    st[LOOK_AT] = 0
    st[CHANGES] += 1
    turned = -1  # where and when a loop that only waits (see `waiting`) last turned
    while True:
        if cycle >= st[LOOK_AT]:
            st[PC] = pc
            st[CYCLE] = cycle
            st[SREG_BITS] = sreg
            cause = look_up(st, memory, words, target)
            if cause != RUNNING:
                return cause
            pc = int(st[PC])
            cycle = int(st[CYCLE])
            sreg = int(st[SREG_BITS])
        word = code[np.uint64(pc)]  # unsigned, so that it is not taken for a place counted from the end
        operation = word & 0xFF
        pc += 1
        cycle += 1

        # --- Pairs (see `fusion`): the second only when nothing is due before it --------------------------
        if operation == op.PUSH2:
            offset = st[SP] - LOWEST_PUSH
            value = st[(word >> 8) & 0xFF]
            if 0 <= offset < SRAM_BYTES - 1 and cycle + 1 < st[LOOK_AT]:
                memory[offset + 1] = value
                memory[offset] = st[(word >> 16) & 0xFFFF]
                st[SP] -= 2
                st[STORES] += 1
                pc += 1
                cycle += 2
            else:
                push(st, memory, value, pc - 1)
            cycle += 1
        elif operation == op.POP2:
            offset = st[SP] - LOWEST_POP
            if 0 <= offset < SRAM_BYTES - 1 and cycle + 1 < st[LOOK_AT]:
                st[(word >> 8) & 0xFF] = memory[offset]
                st[(word >> 16) & 0xFFFF] = memory[offset + 1]
                st[SP] += 2
                pc += 1
                cycle += 2
            else:
                pop(st, memory, (word >> 8) & 0xFF, pc - 1)
            cycle += 1
        elif operation == op.PUSH4:
            offset = st[SP] - LOWEST_PUSH - 2
            value = st[(word >> 8) & 0xFF]
            if 0 <= offset < SRAM_BYTES - 3 and cycle + 5 < st[LOOK_AT]:
                memory[offset + 3] = value
                memory[offset + 2] = st[(word >> 16) & 0xFFFF]
                memory[offset + 1] = st[(word >> 32) & 0xFF]
                memory[offset] = st[(word >> 40) & 0xFF]
                st[SP] -= 4
                st[STORES] += 1
                pc += 3
                cycle += 6
            else:
                push(st, memory, value, pc - 1)
            cycle += 1
        elif operation == op.POP4:
            offset = st[SP] - LOWEST_POP
            if 0 <= offset < SRAM_BYTES - 3 and cycle + 5 < st[LOOK_AT]:
                st[(word >> 8) & 0xFF] = memory[offset]
                st[(word >> 16) & 0xFFFF] = memory[offset + 1]
                st[(word >> 32) & 0xFF] = memory[offset + 2]
                st[(word >> 40) & 0xFF] = memory[offset + 3]
                st[SP] += 4
                pc += 3
                cycle += 6
            else:
                pop(st, memory, (word >> 8) & 0xFF, pc - 1)
            cycle += 1
        elif operation == op.ADD_ADC:
            d = (word >> 8) & 0xFF
            a = st[d]
            b = st[(word >> 16) & 0xFFFF]
            total = a + b
            st[d] = total & 0xFF
            flags = st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)]
            if cycle < st[LOOK_AT]:
                d = (word >> 32) & 0xFF
                a = st[d]
                b = st[(word >> 40) & 0xFFFF]
                total = a + b + (flags & C)
                st[d] = total & 0xFF
                flags = st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)]
                pc += 1
                cycle += 1
            sreg = (sreg & KEEP_IT) | flags
        elif operation == op.SUB_SBC:
            d = (word >> 8) & 0xFF
            a = st[d]
            b = st[(word >> 16) & 0xFFFF]
            total = a - b
            st[d] = total & 0xFF
            flags = st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)]
            if cycle < st[LOOK_AT]:
                d = (word >> 32) & 0xFF
                a = st[d]
                b = st[(word >> 40) & 0xFFFF]
                total = a - b - (flags & C)
                st[d] = total & 0xFF
                wide = st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)]
                flags = wide & (flags | ~Z)
                pc += 1
                cycle += 1
            sreg = (sreg & KEEP_IT) | flags
        elif operation == op.MOV2:
            st[(word >> 8) & 0xFF] = st[(word >> 16) & 0xFFFF]
            if cycle < st[LOOK_AT]:
                st[(word >> 32) & 0xFF] = st[(word >> 40) & 0xFFFF]
                pc += 1
                cycle += 1
        elif operation == op.LDS2:
            st[(word >> 8) & 0xFF] = memory[((word >> 32) & 0xFFFF) - SRAM_START]
            pc += 1
            cycle += 1
            if cycle < st[LOOK_AT]:
                st[(word >> 16) & 0xFFFF] = memory[((word >> 48) & 0xFFFF) - SRAM_START]
                pc += 2
                cycle += 2
        elif operation == op.COMPARE_BRANCH:
            a = st[(word >> 8) & 0xFF]
            b = st[(word >> 16) & 0xFFFF]
            total = a - b
            sreg = (sreg & KEEP_IT) | (st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)])
            if cycle < st[LOOK_AT]:
                pc += 1
                cycle += 1
                if ((sreg & (word >> 48) & 0xFF) != 0) == ((word >> 56) & 1 != 0):
                    back = (word >> 32) & 0xFFFF < pc
                    pc = (word >> 32) & 0xFFFF
                    cycle += 1
                    turn = word >> 57
                    if turn:
                        if turned + (turn << PC_BITS) == moment(pc, cycle):
                            cycle = pass_turns(st, cycle, turn)
                        turned = moment(pc, cycle)
                    elif back:
                        go_back(st, pc)

        # --- How handlers begin and end: all five instructions, or the first -----------------------------------
        elif operation == op.ENTER:
            offset = st[SP] - LOWEST_PUSH - 1
            if 0 <= offset < SRAM_BYTES - 2 and cycle + 6 < st[LOOK_AT]:
                a = (word >> 8) & 0xFF
                b = (word >> 16) & 0xFFFF
                memory[offset + 2] = st[a]
                memory[offset + 1] = st[b]
                memory[offset] = sreg
                st[b] = sreg
                st[a] = 0
                sreg = (sreg & KEEP_ITHC) | st[RESULT_FLAGS]
                st[SP] -= 3
                st[STORES] += 1
                pc += 4
                cycle += 6
            else:
                push(st, memory, st[(word >> 8) & 0xFF], pc - 1)
            cycle += 1
        elif operation == op.LEAVE:
            offset = st[SP] - LOWEST_POP
            b = (word >> 16) & 0xFFFF
            if 0 <= offset < SRAM_BYTES - 4 and cycle + 6 < st[LOOK_AT] and memory[offset] & I == 0:
                sreg = int(memory[offset]) | I
                st[b] = memory[offset + 1]
                st[(word >> 8) & 0xFF] = memory[offset + 2]
                pc = ((int(memory[offset + 3]) << 8) | int(memory[offset + 4])) & PC_MASK
                st[SP] += 5
                cycle += 10
                st[IRQ_EARLIEST] = cycle + 1
                if st[PENDING] != 0:
                    look_early(st, cycle + 1)
            else:
                pop(st, memory, b, pc - 1)
                cycle += 1

        # --- What programs do most: arithmetic and logic -----------------------------------------------------
        elif operation == op.ADD:
            d = (word >> 8) & 0xFF
            a = st[d]
            b = st[(word >> 16) & 0xFFFF]
            total = a + b
            st[d] = total & 0xFF
            sreg = (sreg & KEEP_IT) | (st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)])
        elif operation == op.ADC:
            d = (word >> 8) & 0xFF
            a = st[d]
            b = st[(word >> 16) & 0xFFFF]
            total = a + b + (sreg & C)
            st[d] = total & 0xFF
            sreg = (sreg & KEEP_IT) | (st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)])
        elif operation == op.SUB:
            d = (word >> 8) & 0xFF
            a = st[d]
            b = st[(word >> 16) & 0xFFFF]
            total = a - b
            st[d] = total & 0xFF
            sreg = (sreg & KEEP_IT) | (st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)])
        elif operation == op.SBC:
            d = (word >> 8) & 0xFF
            a = st[d]
            b = st[(word >> 16) & 0xFFFF]
            total = a - b - (sreg & C)
            st[d] = total & 0xFF
            flags = st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)]
            sreg = (sreg & KEEP_IT) | (flags & (sreg | ~Z))
        elif operation == op.CP:
            a = st[(word >> 8) & 0xFF]
            b = st[(word >> 16) & 0xFFFF]
            total = a - b
            sreg = (sreg & KEEP_IT) | (st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)])
        elif operation == op.CPC:
            a = st[(word >> 8) & 0xFF]
            b = st[(word >> 16) & 0xFFFF]
            total = a - b - (sreg & C)
            flags = st[RESULT_FLAGS + (total & 0xFF)] ^ st[CARRY_FLAGS + ((a ^ b ^ total) & 0x1FF)]
            sreg = (sreg & KEEP_IT) | (flags & (sreg | ~Z))
        elif operation == op.AND:
            d = (word >> 8) & 0xFF
            result = st[d] & st[(word >> 16) & 0xFFFF]
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | st[RESULT_FLAGS + (result & 0xFF)]
        elif operation == op.OR:
            d = (word >> 8) & 0xFF
            result = st[d] | st[(word >> 16) & 0xFFFF]
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | st[RESULT_FLAGS + (result & 0xFF)]
        elif operation == op.EOR:
            d = (word >> 8) & 0xFF
            result = st[d] ^ st[(word >> 16) & 0xFFFF]
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | st[RESULT_FLAGS + (result & 0xFF)]
        elif operation == op.INC:
            d = (word >> 8) & 0xFF
            result = (st[d] + 1) & 0xFF
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | (st[RESULT_FLAGS + result] ^ (V | S if result == 0x80 else 0))
        elif operation == op.DEC:
            d = (word >> 8) & 0xFF
            result = (st[d] - 1) & 0xFF
            st[d] = result
            sreg = (sreg & KEEP_ITHC) | (st[RESULT_FLAGS + result] ^ (V | S if result == 0x7F else 0))
        elif operation == op.LSR:
            d = (word >> 8) & 0xFF
            a = st[d]
            st[d] = a >> 1
            sreg = (sreg & KEEP_ITH) | st[SHIFT_FLAGS + (a & 0x1FF)]
        elif operation == op.ROR:
            d = (word >> 8) & 0xFF
            a = st[d] | ((sreg & C) << 8)
            st[d] = a >> 1
            sreg = (sreg & KEEP_ITH) | st[SHIFT_FLAGS + (a & 0x1FF)]
        elif operation == op.SWAP:
            d = (word >> 8) & 0xFF
            a = st[d]
            st[d] = (a >> 4) | ((a & 15) << 4)
        elif operation == op.ADIW:
            d = (word >> 8) & 0xFF
            before = st[d] | (st[d + 1] << 8)
            after = (before + ((word >> 16) & 0xFFFF)) & 0xFFFF
            st[d] = after & 0xFF
            st[d + 1] = after >> 8
            wide = sign_flags(after >> 8, (~before & after) >> 15) & ~Z
            sreg = (sreg & KEEP_ITH) | wide | ((before & ~after) >> 15) | (Z if after == 0 else 0)
            cycle += 1
        elif operation == op.SBIW:
            d = (word >> 8) & 0xFF
            before = st[d] | (st[d + 1] << 8)
            after = (before - ((word >> 16) & 0xFFFF)) & 0xFFFF
            st[d] = after & 0xFF
            st[d + 1] = after >> 8
            wide = sign_flags(after >> 8, (before & ~after) >> 15) & ~Z
            sreg = (sreg & KEEP_ITH) | wide | ((~before & after) >> 15) | (Z if after == 0 else 0)
            cycle += 1

        # --- Moves, loads and stores -------------------------------------------------------------------------
        elif operation == op.MOV:
            st[(word >> 8) & 0xFF] = st[(word >> 16) & 0xFFFF]
        elif operation == op.MOVW:
            d = (word >> 8) & 0xFF
            r = (word >> 16) & 0xFFFF
            st[d] = st[r]
            st[d + 1] = st[r + 1]
        elif operation == op.LDD:
            r = (word >> 16) & 0xFFFF
            address = (st[r] + (st[r + 1] << 8) + (word >> 32)) & 0xFFFF
            offset = address - SRAM_START
            if 0 <= offset < SRAM_BYTES:
                st[(word >> 8) & 0xFF] = memory[offset]
            elif offset < 0 and READS_PLAIN[address & 0xFF]:
                st[(word >> 8) & 0xFF] = st[address & 0xFF]
            else:
                note_access(st, io.READ, address, (word >> 8) & 0xFF, pc - 1)
            cycle += 1
        elif operation == op.STD:
            r = (word >> 16) & 0xFFFF
            address = (st[r] + (st[r + 1] << 8) + (word >> 32)) & 0xFFFF
            value = st[(word >> 8) & 0xFF]
            offset = address - SRAM_START
            if 0 <= offset < SRAM_BYTES:
                memory[offset] = value
                st[STORES] += 1
            elif offset < 0 and WRITES_WORD[address & 0xFF] >= 0:
                st[WRITES_WORD[address & 0xFF]] = value
            else:
                note_access(st, io.WRITE, address, value, pc - 1)
            cycle += 1
        elif operation == op.LD_INC:
            r = (word >> 16) & 0xFFFF
            address = st[r] | (st[r + 1] << 8)
            st[r] = (address + 1) & 0xFF
            st[r + 1] = ((address + 1) >> 8) & 0xFF
            load(st, memory, address, (word >> 8) & 0xFF, pc - 1)
            cycle += 1
        elif operation == op.ST_INC:
            r = (word >> 16) & 0xFFFF
            address = st[r] | (st[r + 1] << 8)
            value = st[(word >> 8) & 0xFF]
            st[r] = (address + 1) & 0xFF
            st[r + 1] = ((address + 1) >> 8) & 0xFF
            store(st, memory, address, value, pc - 1)
            cycle += 1
        elif operation == op.LDS:
            load(st, memory, word >> 32, (word >> 8) & 0xFF, pc - 1)
            pc += 1
            cycle += 1
        elif operation == op.STS:
            store(st, memory, word >> 32, st[(word >> 8) & 0xFF], pc - 1)
            pc += 1
            cycle += 1
        elif operation == op.LDS_PLAIN:
            st[(word >> 8) & 0xFF] = st[(word >> 32) & 0xFFFF]
            pc += 1
            cycle += 1
        elif operation == op.STS_PLAIN:
            st[(word >> 32) & 0xFFFF] = st[(word >> 8) & 0xFF]
            pc += 1
            cycle += 1
        elif operation == op.POP:
            pop(st, memory, (word >> 8) & 0xFF, pc - 1)
            cycle += 1
        elif operation == op.PUSH:
            push(st, memory, st[(word >> 8) & 0xFF], pc - 1)
            cycle += 1

        # --- Jumps, calls, branches and skips ----------------------------------------------------------------
        elif operation == op.BRBS:
            if sreg & (word >> 8) & 0xFF:
                pc = word >> 32
                cycle += 1
        elif operation == op.BRBC:
            if sreg & (word >> 8) & 0xFF == 0:
                pc = word >> 32
                cycle += 1
        elif operation == op.BRBS_BACK:
            if sreg & (word >> 8) & 0xFF:
                pc = word >> 32
                cycle += 1
                turn = (word >> 16) & 0xFFFF
                if turn:
                    if turned + (turn << PC_BITS) == moment(pc, cycle):
                        cycle = pass_turns(st, cycle, turn)
                    turned = moment(pc, cycle)
                else:
                    go_back(st, pc)
        elif operation == op.BRBC_BACK:
            if sreg & (word >> 8) & 0xFF == 0:
                pc = word >> 32
                cycle += 1
                turn = (word >> 16) & 0xFFFF
                if turn:
                    if turned + (turn << PC_BITS) == moment(pc, cycle):
                        cycle = pass_turns(st, cycle, turn)
                    turned = moment(pc, cycle)
                else:
                    go_back(st, pc)
        elif operation == op.JUMP2:
            pc = word >> 32
            cycle += 1
        elif operation == op.JUMP2_BACK:
            pc = word >> 32
            cycle += 1
            turn = (word >> 16) & 0xFFFF
            if turn:
                if turned + (turn << PC_BITS) == moment(pc, cycle):
                    cycle = pass_turns(st, cycle, turn)
                turned = moment(pc, cycle)
            else:
                go_back(st, pc)
        elif operation == op.JUMP3:
            back = word >> 32 < pc
            pc = word >> 32
            cycle += 2
            if back:
                go_back(st, pc)
        elif operation == op.RCALL:
            call(st, memory, pc, pc)
            pc = word >> 32
            cycle += 2
        elif operation == op.CALL:
            call(st, memory, pc + 1, pc)
            pc = word >> 32
            cycle += 3
        elif operation == op.RET:
            place = st[SP] - LOWEST_POP
            if 0 <= place < SRAM_BYTES - 1:
                pc = ((int(memory[place]) << 8) | int(memory[place + 1])) & PC_MASK
                st[SP] += 2
            else:
                note_access(st, io.RETURN, pc, pc, pc - 1)
            cycle += 3
        elif operation == op.RETI:
            place = st[SP] - LOWEST_POP
            if 0 <= place < SRAM_BYTES - 1:
                pc = ((int(memory[place]) << 8) | int(memory[place + 1])) & PC_MASK
                st[SP] += 2
            else:
                note_access(st, io.RETURN, pc, pc, pc - 1)
            cycle += 3
            sreg |= I
            st[IRQ_EARLIEST] = cycle + 1
            if st[PENDING] != 0:
                look_early(st, cycle + 1)
        elif operation == op.CPSE:
            if st[(word >> 8) & 0xFF] == st[(word >> 16) & 0xFFFF]:
                pc += word >> 32
                cycle += word >> 32
        elif operation == op.SBRC:
            if st[(word >> 8) & 0xFF] & (word >> 16) & 0xFFFF == 0:
                pc += word >> 32
                cycle += word >> 32
        elif operation == op.SBRS:
            if st[(word >> 8) & 0xFF] & (word >> 16) & 0xFFFF:
                pc += word >> 32
                cycle += word >> 32

        # --- I/O and SREG ------------------------------------------------------------------------------------
        elif operation == op.IN:
            note_access(st, io.READ, (word >> 16) & 0xFFFF, (word >> 8) & 0xFF, pc - 1)
        elif operation == op.OUT:
            note_access(st, io.WRITE, (word >> 8) & 0xFF, st[(word >> 16) & 0xFFFF], pc - 1)
        elif operation == op.IN_SREG:
            st[(word >> 8) & 0xFF] = sreg
        elif operation == op.OUT_SREG:
            value = st[(word >> 16) & 0xFFFF]
            if value & I and not sreg & I:
                st[IRQ_EARLIEST] = cycle + 1
                if st[PENDING] != 0:
                    look_early(st, cycle + 1)
            sreg = value
        elif operation == op.SBI:
            note_access(st, io.SET_BIT, (word >> 8) & 0xFF, (word >> 16) & 0xFFFF, pc - 1)
            cycle += 1
        elif operation == op.CBI:
            note_access(st, io.CLEAR_BIT, (word >> 8) & 0xFF, (word >> 16) & 0xFFFF, pc - 1)
            cycle += 1
        elif operation == op.BSET:
            d = (word >> 8) & 0xFF
            sreg |= d
            if d == I:
                st[IRQ_EARLIEST] = cycle + 1
                if st[PENDING] != 0:
                    look_early(st, cycle + 1)
        elif operation == op.BCLR:
            sreg &= ~((word >> 8) & 0xFF)
        elif operation == op.SBIC:
            note_access(st, io.SKIP_CLEAR, (word >> 8) & 0xFF, ((word >> 16) & 0xFFFF) | (word >> 32 << 8), pc - 1)
        elif operation == op.SBIS:
            note_access(st, io.SKIP_SET, (word >> 8) & 0xFF, ((word >> 16) & 0xFFFF) | (word >> 32 << 8), pc - 1)

        # --- What programs do less; what they do least is `rare`'s -------------------------------------------
        elif operation == op.COM:
            d = (word >> 8) & 0xFF
            result = st[d] ^ 0xFF
            st[d] = result
            sreg = (sreg & KEEP_ITH) | st[RESULT_FLAGS + (result & 0xFF)] | C
        elif operation == op.MUL:
            product = st[(word >> 8) & 0xFF] * st[(word >> 16) & 0xFFFF]
            st[0] = product & 0xFF
            st[1] = product >> 8
            sreg = (sreg & KEEP_PRODUCT) | (product >> 15) | (Z if product == 0 else 0)
            cycle += 1
        elif operation == op.LPM:
            st[(word >> 8) & 0xFF] = flash[(st[Z_LOW] | (st[Z_HIGH] << 8)) & FLASH_MASK]
            cycle += 2
        elif operation == op.LPM_INC:
            address = st[Z_LOW] | (st[Z_HIGH] << 8)
            st[Z_LOW] = (address + 1) & 0xFF
            st[Z_HIGH] = ((address + 1) >> 8) & 0xFF
            st[(word >> 8) & 0xFF] = flash[address & FLASH_MASK]
            cycle += 2
        elif operation == op.NOP:
            pass
        else:
            st[PC] = pc
            st[CYCLE] = cycle
            st[SREG_BITS] = sreg
            cause = do_rare(st, memory, word)
            if cause != RUNNING:
                return cause
            pc = int(st[PC])
            cycle = int(st[CYCLE])
            sreg = int(st[SREG_BITS])
