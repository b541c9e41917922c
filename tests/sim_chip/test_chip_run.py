"""The run as a whole: slices, snapshots, growing logs, the uncompiled kernel, parts that are not modelled."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from planarm_sim.cpu import layout as at
from planarm_sim.cpu.bus import touch
from planarm_sim.cpu.chip import Chip, FirstTouch, StopCause
from planarm_sim.cpu.queues import FIRST_ENTRIES
from planarm_sim.errors import DefectError, ImageError
from sim_chip.avr_assembler import assemble

# Two compare outputs with interrupts that move them on, an overflow, a serial echo, a pin change, a pin in software.
BUSY = """
        jmp main
        .org 6
        jmp change
        .org 22
        jmp match_a
        .org 24
        jmp match_b
        .org 32
        jmp overflow
        .org 36
        jmp received
        .org 60
match_a:
        in r10, 0x3F
        lds r11, 0x88
        lds r12, 0x89
        ldi r18, 97
        add r11, r18
        ldi r18, 0
        adc r12, r18
        sts 0x89, r12
        sts 0x88, r11
        out 0x3F, r10
        reti
match_b:
        in r10, 0x3F
        lds r11, 0x8A
        lds r12, 0x8B
        ldi r18, 211
        add r11, r18
        ldi r18, 0
        adc r12, r18
        sts 0x8B, r12
        sts 0x8A, r11
        out 0x3F, r10
        reti
overflow:
        sbi 0x0B, 4
        cbi 0x0B, 4
        reti
received:
        lds r13, 0xC6
        sts 0xC6, r13
        reti
change: sbi 0x0B, 5
        cbi 0x0B, 5
        reti
main:   ldi r16, 0x26
        out 0x04, r16
        ldi r16, 0xF0
        out 0x0A, r16
        ldi r16, 0x50
        sts 0x80, r16
        ldi r16, 150
        sts 0x88, r16
        sts 0x8A, r16
        ldi r16, 6
        sts 0x6F, r16
        ldi r16, 1
        sts 0x6E, r16
        sts 0x6B, r16
        sts 0x68, r16
        sts 0x81, r16
        out 0x25, r16       ; timer 0, clk/1
        ldi r16, 3
        sts 0xC4, r16
        ldi r16, 0x98
        sts 0xC1, r16
        sei
loop:   call work
        sbi 0x03, 5
        push r20
        pop r21
        rjmp loop
work:   mul r20, r21
        inc r20
        sts 0x300, r20
        ret
"""
IMAGE = assemble(BUSY)


def busy_chip() -> Chip:
    chip = Chip(IMAGE)
    for n in range(12):
        chip.push_rx(700 + 650 * n, 64.0 + n % 3, 16 * n + 3)
    for n in range(20):
        chip.drive_pin(0, (n + 1) % 2, 500 + 333 * n)
    return chip


def outcome(chip: Chip) -> tuple:
    """Everything that can be seen from outside, and the registers."""
    return (
        chip.drain_edges().tolist(),
        chip.drain_tx().tolist(),
        chip.cycle,
        chip.pc,
        chip.sreg,
        chip.registers.tolist(),
        chip.sram.tolist(),
    )


END = 12_000
WHOLE = None


def whole() -> tuple:
    global WHOLE  # noqa: PLW0603 - computed once for all examples
    if WHOLE is None:
        chip = busy_chip()
        chip.run_to(END)
        WHOLE = outcome(chip)
    return WHOLE


def test_the_busy_program_exercises_what_it_is_meant_to():
    edges, sent, *_ = whole()
    assert {pin for _, pin, _ in edges} == {1, 2, 5, 17, 20, 21}
    assert len(sent) >= 10


@settings(max_examples=60, deadline=None)
@given(some.lists(some.integers(0, END), max_size=60))
def test_slices_do_not_change_the_run(stops):
    chip = busy_chip()
    for stop in sorted(stops):
        chip.run_to(stop)
    chip.run_to(END)
    assert outcome(chip) == whole()


def test_one_instruction_at_a_time_is_the_same_run():
    chip = busy_chip()
    while chip.cycle < END:
        assert chip.run_to(chip.cycle + 1) is StopCause.REACHED
    assert outcome(chip) == whole()


def test_edges_come_in_the_order_of_time():
    cycles = np.array([e[0] for e in whole()[0]])
    assert np.all(np.diff(cycles) >= 0)


@settings(max_examples=30, deadline=None)
@given(some.integers(0, END), some.integers(0, END))
def test_a_restored_snapshot_runs_the_same_way_again(at, detour):
    chip = busy_chip()
    chip.run_to(at)
    snapshot = chip.snapshot()
    chip.run_to(at + detour)
    chip.drain_edges()
    chip.push_rx(max(chip.cycle, 20_000), 64.0, 1)
    chip.restore(snapshot)
    chip.run_to(END)
    assert outcome(chip) == whole()
    other = Chip(b"")
    other.restore(snapshot)
    other.run_to(END)
    assert outcome(other) == whole()


def test_logs_grow_and_lose_nothing():
    # SBI PINB toggles every 4 cycles (SBI 2, RJMP 2) from cycle 4 on: 250,000 edges in a million cycles, in one run.
    chip = Chip(assemble("sbi 0x04, 0\nloop: sbi 0x03, 0\nrjmp loop"))
    assert chip.run_to(1_000_000) is StopCause.REACHED
    edges = chip.drain_edges()
    np.testing.assert_array_equal(edges["cycle"], np.arange(4, 1_000_001, 4))
    np.testing.assert_array_equal(edges["level"], np.arange(1, len(edges) + 1) % 2)
    assert len(chip.drain_edges()) == 0


UNCOMPILED = """
import json, sys
sys.path[:0] = json.loads(sys.argv[1])
from sim_chip.test_chip_run import busy_chip, outcome
from planarm_sim.cpu.dispatch import run
assert not hasattr(run, "py_func"), "the kernel is compiled"
chip = busy_chip()
chip.run_to(4000)
print(json.dumps(outcome(chip)))
"""


def test_the_kernel_runs_the_same_without_its_compiler():
    paths = [p for p in sys.path if p] + [str(Path(__file__).parents[1])]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", UNCOMPILED, json.dumps(paths)],
        env=environment,
        capture_output=True,
        check=False,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    chip = busy_chip()
    chip.run_to(4000)
    assert json.loads(run.stdout) == json.loads(json.dumps(outcome(chip)))


def test_what_is_not_modelled_is_noted_once_with_its_place():
    # TWBR is written at word 3 and again later, SPDR read at word 6, beyond the SRAM at word 8.
    source = (
        "nop\nnop\nldi r16, 0x80\nsts 0xB8, r16\nnop\nin r1, 0x2E\nsts 0xB8, r16\nlds r2, 0x0A00\nlds r3, 0xB8\nbreak"
    )
    chip = Chip(assemble(source))
    assert chip.unmodelled() == ()
    assert chip.run_to(100) is StopCause.BREAK
    assert chip.unmodelled() == (
        FirstTouch(0x4E, "SPDR", 6),
        FirstTouch(0xB8, "TWBR", 3),
        FirstTouch(0x0A00, "0x0A00", 9),
    )
    assert chip.registers[3] == 0x80


@pytest.mark.parametrize(
    ("instruction", "register"),
    [
        *[(f"{m} 0x0C, 0", "0x2C") for m in ("sbi", "cbi", "sbic", "sbis")],
        ("in r0, 0x2C", "SPCR"),
        ("out 0x30, r0", "ACSR"),
        ("lds r0, 0xBC", "TWCR"),
        ("sts 0xBC, r0", "TWCR"),
        ("ldd r0, Z+1", "TWBR"),
        ("std Z+1, r0", "TWBR"),
        ("ld r0, Z+", "0xB7"),
        ("st -Z, r0", "ASSR"),
    ],
)
def test_every_kind_of_access_is_noted_with_its_place(instruction, register):
    chip = Chip(assemble(f"ldi r30, 0xB7\nldi r31, 0\nnop\n{instruction}\nbreak\nbreak"))
    chip.run_to(100)
    assert [(touch.register, touch.pc) for touch in chip.unmodelled()] == [(register, 3)]


def test_modes_that_are_not_modelled_are_noted():
    # Power-down sleep (SM2:0 = 2) and the USART as SPI master (UMSEL0 = 3).
    chip = Chip(assemble("ldi r16, 5\nout 0x33, r16\nldi r16, 0xC0\nsts 0xC2, r16\nsleep"))
    chip.run_to(100)
    assert chip.unmodelled() == (FirstTouch(0x53, "SMCR", 5), FirstTouch(0xC2, "UCSR0C", 3))


def test_modelled_registers_leave_no_note():
    chip = busy_chip()
    chip.run_to(END)
    assert chip.unmodelled() == ()


@pytest.mark.parametrize(
    ("word", "value"), [(at.TIMER1 + at.F_COUNT, 1 << 40), (at.PIPE_COUNT, 1 << 40)], ids=["counter", "pipeline"]
)
def test_a_state_that_contradicts_itself_ends_the_run_instead_of_running_for_ever(word, value):
    # No program brings the chip there: a counter beyond its range, and an input pipeline with no end. Both would have
    # the events of one instruction never end.
    chip = Chip(assemble("ldi r16, 1\nsts 0x6F, r16\nsts 0x81, r16\nloop: rjmp loop"))
    chip.run_to(100)
    chip._state[word] = value
    chip._state[at.DUE_PIPE if word == at.PIPE_COUNT else at.DUE_TIMER1] = 150
    with pytest.raises(DefectError, match="two versions"):
        chip.run_to(1000)


def test_an_image_larger_than_the_flash_is_refused():
    with pytest.raises(ImageError, match="32770"):
        Chip(bytes(32770))


def test_queued_drives_and_frames_survive_a_reset():
    chip = Chip(assemble("ldi r16, 3\nsts 0xC4, r16\nldi r16, 0x10\nsts 0xC1, r16\nloop: rjmp loop"))
    chip.push_rx(2000, 64.0, 7)
    chip.drive_pin(0, 1, 3000)
    chip.run_to(1000)
    chip.reset()
    chip.run_to(4000)
    assert chip.pin_level(0) == 1
    assert chip.snapshot().state[0xC0] & 0x80


def test_a_kernel_for_kernels_alone_refuses_python():
    with pytest.raises(TypeError, match=r"planarm_sim\.cpu\.bus\.touch is for kernels; make it a @kernel"):
        touch(np.zeros(1, np.int64), 0)


# PB0 toggles, and a new character goes out every 80 cycles: U2X (UCSR0A), TXEN (UCSR0B), then UDR0 again and again.
CHATTY = """
        sbi 0x04, 0
        ldi r16, 2
        sts 0xC0, r16
        ldi r16, 8
        sts 0xC1, r16
loop:   sts 0xC6, r17
        inc r17
        sbi 0x03, 0
        rjmp loop
"""


def test_logs_that_run_over_are_those_of_a_chip_that_is_asked_often_in_copies_too():
    end, step = 500_000, 1600
    whole, often = Chip(assemble(CHATTY)), Chip(assemble(CHATTY))
    pieces = []
    for cycle in range(step, end, step):
        often.run_to(cycle)
        pieces.append((often.drain_edges(), often.drain_tx()))
    expected = [np.concatenate(parts) for parts in zip(*pieces, strict=True)]
    assert min(map(len, expected)) > FIRST_ENTRIES, "both logs ran over"

    def drained(chip):
        return chip.drain_edges(), chip.drain_tx()

    whole.run_to(often.cycle)
    middle, twin = whole.snapshot(), whole.fork()
    for chip in (whole, twin):
        assert all(np.array_equal(got, wanted) for got, wanted in zip(drained(chip), expected, strict=True))
        assert [len(log) for log in drained(chip)] == [0, 0]
    whole.run_to(whole.cycle + end)
    whole.restore(middle)
    assert all(np.array_equal(got, wanted) for got, wanted in zip(drained(whole), expected, strict=True))
