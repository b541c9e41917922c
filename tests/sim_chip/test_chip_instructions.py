"""Cycles, program counter and effects of every instruction.

Cycles: AVR Instruction Set Manual, column AVRe (and ATmega328P datasheet, chapter 37), 16-bit program counter.
"""

import struct

import numpy as np
import pytest

from planarm_sim.cpu.chip import Chip, StopCause
from planarm_sim.cpu.decode import ENCODINGS
from sim_chip.avr_assembler import assemble

ONE_CYCLE = [
    *("add r1, r2", "adc r1, r2", "sub r1, r2", "sbc r1, r2", "and r1, r2", "or r1, r2", "eor r1, r2", "mov r1, r2"),
    *("cp r1, r2", "cpc r1, r2", "subi r16, 1", "sbci r16, 1", "andi r16, 1", "ori r16, 1", "cpi r16, 1"),
    *("ldi r16, 1", "movw r2, r4", "com r1", "neg r1", "inc r1", "dec r1", "swap r1", "lsr r1", "ror r1", "asr r1"),
    *("bset 3", "bclr 3", "bld r1, 2", "bst r1, 2", "sec", "clc", "sei", "cli", "in r1, 0x3F", "out 0x3F, r1"),
    *("in r1, 0x15", "out 0x12, r1", "nop", "wdr", "sleep"),  # SLEEP with SE clear does nothing
]
TWO_CYCLES = [
    *("adiw r24, 1", "sbiw r24, 1", "mul r1, r2", "muls r16, r17", "mulsu r16, r17", "fmul r16, r17"),
    *("fmuls r16, r17", "fmulsu r16, r17", "ld r1, X", "ld r1, X+", "ld r1, -X", "ld r1, Y+", "ld r1, -Y"),
    *("ld r1, Z+", "ld r1, -Z", "ldd r1, Y+5", "ldd r1, Z+63", "st X, r1", "st X+, r1", "st -X, r1", "st Y+, r1"),
    *("st -Y, r1", "st Z+, r1", "st -Z, r1", "std Y+63, r1", "std Z+5, r1", "push r1", "pop r1", "sbi 0x1E, 3"),
    *("cbi 0x1E, 3", "sbi 0x05, 3", "lds r1, 0x100", "sts 0x100, r1", "lds r1, 0x6E", "sts 0x6E, r1"),
]


def chip_with(source: str) -> Chip:
    """A chip whose pointers stand in the middle of the SRAM."""
    chip = Chip(assemble(source))
    chip.registers[:] = np.arange(32)
    chip.registers[26:32] = (0x80, 2, 0x80, 3, 0x80, 4)
    return chip


@pytest.mark.parametrize(
    ("source", "cycles"),
    [(s, 1) for s in ONE_CYCLE] + [(s, 2) for s in TWO_CYCLES] + [(s, 3) for s in ("lpm", "lpm r1, Z", "lpm r1, Z+")],
)
def test_cycles_and_next_instruction(source, cycles):
    chip = chip_with(source)
    words = len(assemble(source)) // 2
    chip.run_to(1)
    assert (chip.cycle, chip.pc) == (cycles, words)


JUMPS = [
    # source, registers, SREG, stack (from the top), cycles, word address
    ("rjmp 7", {}, 0, (), 2, 7),
    ("jmp 0x3ABC", {}, 0, (), 3, 0x3ABC),
    ("ijmp", {30: 0x34, 31: 0x12}, 0, (), 2, 0x1234),
    ("rcall 9", {}, 0, (), 3, 9),
    ("call 0x1234", {}, 0, (), 4, 0x1234),
    ("icall", {30: 0x34, 31: 0x12}, 0, (), 3, 0x1234),
    ("ret", {}, 0, (0x12, 0x34), 4, 0x1234),
    ("reti", {}, 0, (0x12, 0x34), 4, 0x1234),
    ("brcs 9", {}, 0x00, (), 1, 1),
    ("brcs 9", {}, 0x01, (), 2, 9),
    ("brne 9", {}, 0x00, (), 2, 9),
    ("brne 9", {}, 0x02, (), 1, 1),
    ("cpse r1, r2", {1: 5, 2: 6}, 0, (), 1, 1),
    ("cpse r1, r2\nnop", {1: 5, 2: 5}, 0, (), 2, 2),
    ("cpse r1, r2\ncall 0", {1: 5, 2: 5}, 0, (), 3, 3),
    ("sbrc r1, 3\nnop", {1: 8}, 0, (), 1, 1),
    ("sbrc r1, 3\nnop", {1: 0}, 0, (), 2, 2),
    ("sbrc r1, 3\nlds r1, 0x100", {1: 0}, 0, (), 3, 3),
    ("sbrs r1, 3\nnop", {1: 0}, 0, (), 1, 1),
    ("sbrs r1, 3\nnop", {1: 8}, 0, (), 2, 2),
    ("sbrs r1, 3\nsts 0x100, r1", {1: 8}, 0, (), 3, 3),
    ("sbic 0x05, 3\nnop", {}, 0, (), 2, 2),  # PORTB, reads as written
    ("sbis 0x05, 3\nnop", {}, 0, (), 1, 1),
    ("sbic 0x03, 3\nnop", {}, 0, (), 2, 2),  # PINB, goes by the pin
    ("sbis 0x03, 3\nnop", {}, 0, (), 1, 1),
    ("sbic 0x03, 3\njmp 0", {}, 0, (), 3, 3),
]


@pytest.mark.parametrize(("source", "registers", "sreg", "stack", "cycles", "target"), JUMPS)
def test_jumps_branches_and_skips(source, registers, sreg, stack, cycles, target):
    chip = chip_with(source)
    for number, value in registers.items():
        chip.registers[number] = value
    chip.sreg = sreg
    chip.sp = 0x8FF - len(stack)
    chip.sram[0x800 - len(stack) :] = stack
    chip.run_to(1)
    assert (chip.cycle, chip.pc) == (cycles, target)


@pytest.mark.parametrize(("source", "back"), [("rcall 9", 1), ("icall", 1), ("call 0x1234", 2)])
def test_calls_push_the_address_behind_them(source, back):
    # The high byte ends at the lower address, the stack pointer points below it.
    chip = chip_with(".org 0x1000\n" + source)
    chip.pc = 0x1000
    chip.run_to(1)
    assert chip.sp == 0x8FD
    assert list(chip.sram[-2:]) == [0x10, back]


@pytest.mark.parametrize(
    ("source", "address", "pointer", "after"),
    [
        ("ld r1, X", 0x280, 26, 0x280),
        ("ld r1, X+", 0x280, 26, 0x281),
        ("ld r1, -X", 0x27F, 26, 0x27F),
        ("ld r1, Y+", 0x380, 28, 0x381),
        ("ld r1, -Y", 0x37F, 28, 0x37F),
        ("ldd r1, Y+63", 0x3BF, 28, 0x380),
        ("ldd r1, Z+5", 0x485, 30, 0x480),
        ("ld r1, Z+", 0x480, 30, 0x481),
        ("ld r1, -Z", 0x47F, 30, 0x47F),
    ],
)
def test_indirect_addresses(source, address, pointer, after):
    chip = chip_with(source)
    chip.sram[address - 0x100] = 0xA5
    chip.run_to(1)
    assert chip.registers[1] == 0xA5
    assert chip.registers[pointer] | chip.registers[pointer + 1] << 8 == after

    store = chip_with(source.replace("ldd", "std").replace("ld ", "st ").replace("r1, ", "") + ", r1")
    store.registers[1] = 0x5A
    store.run_to(1)
    assert store.sram[address - 0x100] == 0x5A
    assert np.count_nonzero(store.sram) == 1
    assert store.registers[pointer] | store.registers[pointer + 1] << 8 == after


def test_registers_are_in_the_data_space():
    chip = Chip(assemble("ldi r16, 0x77\nsts 5, r16\nlds r6, 5\nldi r26, 6\nldi r27, 0\nld r7, X\nbreak"))
    chip.run_to(100)
    assert list(chip.registers[5:8]) == [0x77, 0x77, 0x77]


def test_lpm_reads_bytes_of_the_flash():
    chip = Chip(assemble("ldi r30, 10\nldi r31, 0\nlpm r1, Z+\nlpm\nbreak\n.word 0x1234"))
    chip.run_to(100)
    assert (chip.registers[1], chip.registers[0], chip.registers[30]) == (0x34, 0x12, 11)


def test_the_program_counter_wraps_at_the_end_of_the_flash():
    chip = Chip(assemble("break\n.org 0x3FFF\nnop"))
    chip.pc = 0x3FFF
    assert chip.run_to(100) is StopCause.BREAK
    assert (chip.pc, chip.cycle) == (1, 2)


def test_relative_jumps_wrap_around_the_flash():
    chip = Chip(assemble(".word 0xCFFF"))  # RJMP -1 to itself
    chip.run_to(10)
    assert (chip.pc, chip.cycle) == (0, 10)
    back = Chip(struct.pack("<H", 0xC000 | (-2 & 0xFFF)))  # from 0 to -1
    back.run_to(1)
    assert back.pc == 0x3FFF


def test_stack_pointer_and_status_are_io_registers():
    source = "ldi r16, 0x03\nout 0x3E, r16\nldi r16, 0x21\nout 0x3D, r16\nin r1, 0x3D\nin r2, 0x3E\nlds r3, 0x5F\nbreak"
    chip = Chip(assemble("sez\n" + source))
    chip.run_to(100)
    assert chip.sp == 0x321
    assert list(chip.registers[1:4]) == [0x21, 0x03, 0x02]


def test_stores_change_the_status_register():
    chip = Chip(assemble("ldi r16, 0x41\nsts 0x5F, r16\nbreak"))
    chip.run_to(100)
    assert chip.sreg == 0x41


def test_every_undefined_word_stops_with_its_address():
    # Words that the manual gives no meaning, and those of instructions that the ATmega328P lacks: EIJMP, EICALL,
    # ELPM, XCH, DES.
    for word in (
        0x0001,
        0x00FF,
        0x9003,
        0x9204,
        0x9419,
        0x9519,
        0x95D8,
        0x9006,
        0x940B,
        0x9404,
        0xFF08,
        0xF808,
        0xFFFF,
    ):
        chip = Chip(struct.pack("<3H", 0, 0, word))
        assert chip.run_to(100) is StopCause.BAD_OPCODE, hex(word)
        assert (chip.pc, chip.cycle) == (2, 2)


def test_the_encodings_exclude_each_other():
    words = np.arange(0x10000)
    hits = sum(((words & e.mask) == e.value).astype(int) for e in ENCODINGS)
    assert hits.max() == 1


def test_break_stops_behind_itself_and_the_run_can_go_on():
    chip = Chip(assemble("nop\nbreak\nnop\nbreak"))
    assert chip.run_to(100) is StopCause.BREAK
    assert (chip.pc, chip.cycle) == (2, 2)
    assert chip.run_to(100) is StopCause.BREAK
    assert (chip.pc, chip.cycle) == (4, 4)
