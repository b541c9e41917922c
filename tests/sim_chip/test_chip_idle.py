"""Passing over loops that wait (`cpu/idle.py`) changes nothing that can be seen.

The oracle is the same chip run in slices of a few cycles, which leave no room for passing over anything: a run must end
in the same state, with the same edges at the same cycles.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from planarm_sim.cpu import layout as at
from planarm_sim.cpu.chip import Chip
from planarm_sim.cpu.idle import LEAST_ROOM
from planarm_sim.cpu.waiting import waiting_turns
from sim_chip.avr_assembler import assemble

SLICE = LEAST_ROOM // 2
COMPARE_A = 11  # vector of TIMER1 COMPA
# Timer 1 in CTC mode without prescaler, OC1A as a toggled output, interrupt on; then the loop under test.
SET_UP = """
    rjmp start
    .org 22
    rjmp handler
start:
    ldi r16, 2
    out 0x04, r16      ; DDRB: PB1 is OC1A
    ldi r16, 0x40
    sts 0x80, r16      ; TCCR1A: toggle
    ldi r16, {top_high}
    sts 0x89, r16
    ldi r16, {top_low}
    sts 0x88, r16      ; OCR1A
    ldi r16, 2
    sts 0x6F, r16      ; TIMSK1: OCIE1A
    ldi r16, 9
    sts 0x81, r16      ; TCCR1B: CTC, clk/1
    sei
"""
HANDLER = """
handler:
    in r15, 0x3F
    lds r14, 0x200
    inc r14
    sts 0x200, r14
    out 0x3F, r15
    reti
"""
LOOPS = {
    "jump to itself": "loop: rjmp loop",
    "polls a byte of the interrupt": "loop: lds r24, 0x200\ncp r24, r25\nbrne loop\nmov r25, r24\nrjmp loop",
    "calls": "loop: rcall twice\nrjmp loop\ntwice: push r24\nlds r24, 0x200\npop r24\nret",
    "counts in a register": "loop: inc r20\nrjmp loop",
    "counts in the SRAM": "loop: lds r20, 0x300\ninc r20\nsts 0x300, r20\nrjmp loop",
    "counts in GPIOR0": "loop: in r20, 0x1E\ninc r20\nout 0x1E, r20\nldi r20, 0\nrjmp loop",
    "watches the counter": "loop: lds r20, 0x84\nlds r21, 0x85\nsts 0x300, r20\nldi r20, 0\nldi r21, 0\nrjmp loop",
    "toggles a pin": "loop: sbi 0x03, 0\nsbi 0x04, 0\nrjmp loop",
    "waits for a flag": "loop: sbis 0x16, 2\nrjmp loop\nsbi 0x16, 2\nsbi 0x03, 0\nrjmp loop",
    "with interrupts off for a while": "loop: cli\nlds r24, 0x200\nsei\ncp r24, r25\nrjmp loop",
    "an inner loop": "loop: ldi r20, 5\ninner: dec r20\nbrne inner\nlds r24, 0x200\nrjmp loop",
    "an inner loop of many turns": "loop: ldi r20, 100\ninner: dec r20\nbrne inner\nrjmp loop",
    "sleeps": "ldi r20, 1\nout 0x33, r20\nloop: sleep\nlds r24, 0x200\nrjmp loop",
    "restarts the watchdog": "loop: wdr\nrjmp loop",
    "a store that changes nothing": "loop: sts 0x300, r24\nrjmp loop",
    "carry goes round": "loop: ror r20\nrjmp loop",
}
WAITING = {
    *("jump to itself", "polls a byte of the interrupt", "calls", "an inner loop", "a store that changes nothing"),
    "carry goes round",  # comes back to where it was after nine turns
    "with interrupts off for a while",
}


def program(loop: str, top: int) -> bytes:
    return assemble(SET_UP.format(top_high=top >> 8, top_low=top & 255) + loop + "\n" + HANDLER)


def outcome(chip: Chip) -> tuple:
    everything = chip.snapshot()
    visible = [
        chip.cycle,
        chip.pc,
        chip.sreg,
        chip.sp,
        *everything.state[:256].tolist(),
        int(everything.state[at.TEMP]),
    ]
    return visible, everything.memory.tobytes(), chip.drain_edges().tolist()


def run(image: bytes, cycles: int, slice_cycles: int) -> tuple:
    chip = Chip(image)
    while chip.cycle < cycles:
        chip.run_to(min(chip.cycle + slice_cycles, cycles))
    return outcome(chip)


@pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS.keys())
@settings(max_examples=40)
@given(top=some.integers(60, 3000), cycles=some.integers(5_000, 20_000))
def test_same_outcome_as_in_slices_too_short_to_pass_over_anything(loop, top, cycles):
    image = program(loop, top)
    assert run(image, cycles, cycles) == run(image, cycles, SLICE)


@pytest.mark.parametrize("name", LOOPS)
def test_only_loops_that_wait_are_passed_over(name):
    chip = Chip(program(LOOPS[name], 3000))
    chip.run_to(300_000)
    if name in WAITING:
        assert chip.passed_over > 150_000
    else:
        assert chip.passed_over == 0
    before = chip.passed_over
    while chip.cycle < 400_000:
        chip.run_to(chip.cycle + SLICE)
    assert chip.passed_over == before, "the slices of the other tests are a fair oracle"


def test_bytes_that_arrive_end_the_waiting_in_time():
    # Polling UCSR0A (UBRR0 = 0, U2X: 8 cycles a bit) and echoing at once; the byte's cycle is the same in slices.
    image = assemble(
        "ldi r16, 2\nsts 0xC0, r16\nldi r16, 0x18\nsts 0xC1, r16\n"
        "loop: lds r16, 0xC0\nsbrs r16, 7\nrjmp loop\nlds r17, 0xC6\nsts 0xC6, r17\nrjmp loop"
    )
    sent = []
    for slice_cycles in (200_000, SLICE):
        chip = Chip(image)
        for n in range(20):
            chip.push_rx(1000 + 7001 * n, 8, n)
        while chip.cycle < 200_000:
            chip.run_to(min(chip.cycle + slice_cycles, 200_000))
        sent.append(chip.drain_tx().tolist())
    assert sent[0] == sent[1]
    assert [byte for _, byte, _ in sent[0]] == list(range(20))


def test_a_change_between_two_runs_is_seen():
    chip = Chip(assemble("loop: lds r24, 0x200\ntst r24\nbreq loop\nbreak".replace("tst r24", "and r24, r24")))
    chip.run_to(100_000)
    chip.sram[0x100] = 1
    chip.run_to(200_000)
    assert chip.cycle < 100_010
    assert np.all(chip.registers[24] == 1)


# --- Loops whose waiting shows in the flash (`cpu/waiting.py`) ---

TURNS = {
    "loop: rjmp loop": 2,
    "loop: lds r24, 0x200\ncp r24, r25\nbrne loop": 5,
    "loop: lds r24, 0x200\nlds r25, 0x201\ncp r24, r25\nbreq loop": 7,
    "loop: lds r24, 0x200\nand r24, r16\nbreq loop": 5,
    "loop: lds r24, 0x200\nand r24, r16\nbrcs loop": 5,  # the carry stays what it was
    "loop: lds r24, 0x200\nlds r25, 0x201\ncp r24, r16\ncpc r25, r17\nbrne loop": 8,
    "loop: lds r24, 0x84\ncp r24, r25\nbrne loop": 0,  # TCNT1L goes on by itself
    "loop: lds r24, 0x200\nadc r24, r3\ncp r24, r4\nbrne loop": 0,  # adds what the last turn's CP carried
    "loop: inc r20\nbrne loop": 0,
    "loop: mov r1, r2\nmov r2, r3\nmov r3, r1\nrjmp loop": 0,
    "loop: sts 0x200, r1\nrjmp loop": 0,
    "loop: and r24, r16\nbrne loop": 0,
    "loop: lds r24, 0x200\nsbrs r24, 1\nrjmp loop": 0,  # two ways through it
}


@pytest.mark.parametrize("source", TURNS)
def test_a_loop_that_only_waits_is_found_with_the_length_of_its_turn(source):
    code = Chip(assemble("nop\n" + source)).snapshot().program.code
    found = waiting_turns(code)
    assert list(found.values()) == ([TURNS[source]] if TURNS[source] else [])


REGISTERS = some.integers(16, 19)
OPERATIONS = some.sampled_from(["mov", "cp", "cpc", "add", "adc", "sub", "sbc", "and", "or", "eor"])
STRAIGHT = some.one_of(
    some.builds("{} r{}, r{}".format, OPERATIONS, REGISTERS, REGISTERS),
    some.builds("lds r{}, {}".format, REGISTERS, some.sampled_from(["0x200", "0x201", "0x3E"])),
    some.just("nop"),
)
JUMPS = some.sampled_from(["rjmp", "brne", "breq", "brcs", "brcc", "brmi"])


@given(body=some.lists(STRAIGHT, max_size=6), jump=JUMPS, top=some.integers(60, 400))
def test_of_random_straight_loops_none_is_passed_over_that_does_something(body, jump, top):
    """The loop is entered in its middle, too; when it ends it begins again."""
    half = len(body) // 2
    lines = ["rjmp middle", "loop: nop", *body[:half], "middle: nop", *body[half:], f"{jump} loop", "rjmp loop"]
    image = program("\n".join(lines), top)
    assert run(image, 5000, 5000) == run(image, 5000, SLICE)
