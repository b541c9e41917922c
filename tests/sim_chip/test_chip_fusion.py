"""Instructions that run in one go do what they do one after the other, cut at any cycle.

The oracle is the chip that runs one instruction at a time, where no pair ever runs whole.
"""

import numpy as np
import pytest

from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.chip import Chip
from planarm_sim.cpu.decode import FLASH_BYTES
from sim_chip.avr_assembler import assemble

PAIRS = {
    "two pushes": (op.PUSH2, "push r1\npush r2"),
    "two pops": (op.POP2, "pop r1\npop r2"),
    "four pushes": (op.PUSH4, "push r1\npush r2\npush r30\npush r16"),
    "four pops": (op.POP4, "pop r1\npop r2\npop r30\npop r1"),
    "five pops": (op.POP4, "pop r1\npop r2\npop r3\npop r4\npop r5"),
    "the sum of two bytes each": (op.ADD_ADC, "add r30, r31\nadc r31, r30"),
    "their difference, 0": (op.SUB_SBC, "sub r20, r20\nsbc r21, r21"),
    "their difference, with a carry": (op.SUB_SBC, "subi r16, 8\nsbci r17, 200"),
    "two moves": (op.MOV2, "mov r1, r16\nldi r17, 0x5A"),
    "a move that the next one reads": (op.MOV2, "mov r1, r16\nmov r2, r1"),
    "two loads": (op.LDS2, "lds r1, 0x100\nlds r2, 0x8FF"),
    "compare and branch ahead, taken": (op.COMPARE_BRANCH, "cpi r16, 7\nbreq there\nnop\nthere: nop"),
    "compare and branch ahead, not taken": (op.COMPARE_BRANCH, "cpi r16, 7\nbrne there\nnop\nthere: nop"),
    "compare and branch back, taken twice": (op.COMPARE_BRANCH, "back: inc r18\ncpi r18, 3\nbrne back"),
    "how a handler begins": (op.ENTER, "push r1\npush r0\nin r0, 0x3F\npush r0\neor r1, r1"),
    "how a handler ends": (op.LEAVE, "pop r0\nout 0x3F, r0\npop r0\npop r1\nreti"),
}


def state(chip: Chip) -> list:
    return [chip.pc, chip.cycle, chip.sreg, chip.sp, *chip.registers.tolist(), chip.sram.tobytes()]


def prepared(image: bytes, sp: int) -> Chip:
    chip = Chip(image)
    chip.registers[:] = np.arange(32) * 5 & 0xFF
    chip.registers[16:19] = (7, 9, 1)
    chip.sram[:] = np.arange(len(chip.sram)) & 0xFF
    chip.sp = sp
    return chip


@pytest.mark.parametrize("sp", [0x8FF, 0x8FE, 0x400, 0x100, 0xFF])
@pytest.mark.parametrize("name", PAIRS)
def test_what_runs_in_one_go_is_its_instructions(name, sp):
    operation, source = PAIRS[name]
    image = assemble("nop\n" + source).ljust(FLASH_BYTES, b"\0")  # NOPs all over: a return may lead anywhere
    single = prepared(image, sp)
    assert operation in single.snapshot().program.fused & 0xFF
    states = []
    while single.cycle < 20:
        single.run_to(single.cycle + 1)
        states.append(state(single))
    for target in range(1, 20):  # a run ends at the first instruction's end from its target on
        whole = prepared(image, sp)
        whole.run_to(target)
        assert state(whole) == next(s for s in states if s[1] >= target)


def test_a_program_that_jumps_between_the_two_runs_the_second_alone():
    chip = Chip(assemble("ldi r16, 1\nrjmp second\npush r1\nsecond: push r16\nbreak"))
    chip.run_to(100)
    assert (chip.sram[0x7FF], chip.sp) == (1, 0x8FE)
