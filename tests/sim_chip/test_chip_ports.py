"""Pins, external and pin-change interrupts (ATmega328P datasheet, chapters 13 and 14)."""

import pytest

from planarm_sim.cpu.chip import Chip, StopCause
from planarm_sim.errors import PinError, UsageError
from sim_chip.avr_assembler import assemble

PB0, PB5, PD2, PD3 = 0, 5, 18, 19


def edges(chip: Chip) -> list[tuple[int, int, int]]:
    return [(int(e["cycle"]), int(e["pin"]), int(e["level"])) for e in chip.drain_edges()]


def run(source: str, cycles: int = 10_000) -> Chip:
    chip = Chip(assemble(source))
    assert chip.run_to(cycles) is StopCause.BREAK
    return chip


def test_outputs_change_at_the_end_of_the_instruction():
    # LDI 1, OUT DDRB 2, OUT PORTB 3, SBI 5, CBI 7, STS 9. PB1 is an input: SBI pulls it up, STS lets it go.
    chip = run("ldi r16, 0x21\nout 0x04, r16\nout 0x05, r16\nsbi 0x05, 1\ncbi 0x05, 5\nsts 0x25, r16\nbreak")
    assert edges(chip) == [(3, 0, 1), (3, 5, 1), (5, 1, 1), (7, 5, 0), (9, 1, 0), (9, 5, 1)]


def test_a_pin_that_becomes_an_output_is_an_edge_only_when_its_level_changes():
    chip = run("sbi 0x05, 0\nsbi 0x04, 0\nsbi 0x04, 1\ncbi 0x05, 0\nbreak")  # the pull-up holds PB0 high from 2 on
    assert edges(chip) == [(2, 0, 1), (8, 0, 0)]


def test_what_the_outside_does_to_an_input_is_no_edge_of_the_chip():
    chip = Chip(assemble("nop\nnop\nnop\nnop\nbreak"))
    chip.drive_pin(PB0, 1, 2)
    chip.run_to(100)
    assert edges(chip) == []


def test_sbi_on_pinx_toggles_one_pin_only():
    # 14.2.2, and note 3 of the register summary; OUT PINx toggles every pin written one.
    chip = run("ldi r16, 0x0F\nout 0x04, r16\nout 0x05, r16\nsbi 0x03, 1\nsbi 0x03, 1\ncbi 0x03, 2\nin r1, 0x05\nbreak")
    assert edges(chip)[4:] == [(5, 1, 0), (7, 1, 1)]
    assert chip.registers[1] == 0x0F
    toggled = run("ldi r16, 0x0F\nldi r17, 5\nout 0x04, r16\nout 0x03, r17\nin r1, 0x05\nbreak")
    assert toggled.registers[1] == 0x05


def test_pinx_follows_an_output_one_instruction_later():
    # 14.2.4, figure 14-4: an IN right behind the OUT still reads the old level, with a NOP between the new one.
    chip = run("ldi r16, 1\nout 0x04, r16\nout 0x05, r16\nin r1, 0x03\nnop\nin r2, 0x03\nbreak")
    assert list(chip.registers[1:3]) == [0, 1]
    with_nop = run("ldi r16, 1\nout 0x04, r16\nout 0x05, r16\nnop\nin r1, 0x03\nbreak")
    assert with_nop.registers[1] == 1


@pytest.mark.parametrize(("change", "seen"), [(0, 1), (1, 1), (2, 1), (3, 0), (4, 0)])
def test_pinx_follows_an_input_one_cycle_late(change, seen):
    # The third NOP ends at 3 and IN takes the cycle from 3 to 4: it sees changes up to cycle 2.
    chip = Chip(assemble("nop\nnop\nnop\nin r1, 0x03\nbreak"))
    chip.drive_pin(PB0, 1, change)
    chip.run_to(100)
    assert chip.registers[1] == seen


def test_pull_ups_and_what_drives_them_over():
    chip = Chip(assemble("ldi r16, 0x03\nout 0x05, r16\nloop: rjmp loop"))
    chip.drive_pin(1, 0)
    chip.run_to(10)
    assert [chip.pin_level(pin) for pin in range(3)] == [1, 0, 0]
    chip.drive_pin(1, None)
    assert chip.pin_level(1) == 1
    no_pull_ups = run("ldi r16, 0x10\nldi r17, 3\nout 0x05, r17\nout 0x35, r16\nbreak")  # MCUCR: PUD
    assert [no_pull_ups.pin_level(pin) for pin in range(2)] == [0, 0]


def test_an_output_wins_over_the_outside():
    chip = Chip(assemble("sbi 0x04, 0\nloop: rjmp loop"))
    chip.drive_pin(PB0, 1)
    chip.run_to(10)
    assert chip.pin_level(PB0) == 0


def test_inputs_do_not_enter_the_log():
    chip = Chip(assemble("loop: rjmp loop"))
    for n in range(10):
        chip.drive_pin(PB0, n % 2, 10 * n)
    chip.run_to(200)
    assert edges(chip) == []
    assert chip.pin_level(PB0) == 1


def test_wrong_pins_levels_and_times_are_refused():
    chip = Chip(assemble("loop: rjmp loop"))
    with pytest.raises(PinError, match="numbered 0 to 23"):
        chip.drive_pin(24, 1)
    with pytest.raises(PinError, match="level 2"):
        chip.drive_pin(0, 2)
    chip.run_to(100)
    with pytest.raises(UsageError, match="earliest is 100"):
        chip.drive_pin(0, 1, 99)
    chip.drive_pin(0, 1, 500)
    with pytest.raises(UsageError, match="earliest is 500"):
        chip.drive_pin(0, 1, 400)


EXTERNAL = """
        jmp main
        .org 2
        {int0}
        .org 4
        {int1}
        .org 6
        {pci0}
        .org 60
main:   sbi 0x04, 5
        ldi r16, {eicra}
        sts 0x69, r16
        ldi r16, {eimsk}
        out 0x1D, r16
        ldi r16, {pcicr}
        sts 0x68, r16
        ldi r16, 1
        sts 0x6B, r16
        sei
"""
IDLE = {"int0": "reti", "int1": "reti", "pci0": "reti", "eicra": 0, "eimsk": 0, "pcicr": 0}


@pytest.mark.parametrize(
    ("sense", "moves", "taken"),
    [(1, (0, 1), [0, 1]), (2, (1, 0), [1]), (2, (0, 1), [0]), (3, (1, 0), [0]), (3, (0, 1), [1])],
)
def test_external_interrupts_go_by_their_sense(sense, moves, taken):
    # 13.2.1. The pin starts high; a change acts three cycles later, the handler's SBI PINB ends 4 + 2 cycles after.
    source = EXTERNAL.format(**(IDLE | {"int0": "sbi 0x03, 5\nreti", "eicra": sense, "eimsk": 1}))
    chip = Chip(assemble(source + "nop\n" * 300))
    chip.drive_pin(PD2, 1 - moves[0])
    times = (100, 200)
    for cycle, level in zip(times, moves, strict=True):
        chip.drive_pin(PD2, level, cycle)
    chip.run_to(300)
    first = [(1 - moves[0]) != moves[0]] * len(taken)
    assert all(first)
    assert [e[0] for e in edges(chip)] == [times[n] + 3 + 4 + 2 for n in taken]


def test_a_low_level_asks_as_long_as_it_lasts():
    source = EXTERNAL.format(**(IDLE | {"int1": "inc r20\nreti", "eimsk": 2}))
    chip = Chip(assemble(source + "nop\n" * 300))
    chip.drive_pin(PD3, 1)
    chip.drive_pin(PD3, 0, 100)
    chip.drive_pin(PD3, 1, 150)
    chip.run_to(300)
    # From 103 on: entry 4, INC 1, RETI 4, one NOP: every 10 cycles, the last entry begins before 153.
    assert chip.registers[20] == 5


def test_pin_changes_set_their_group_flag_for_enabled_pins_only():
    source = EXTERNAL.format(**(IDLE | {"pci0": "sbi 0x03, 5\nreti", "pcicr": 1}))
    chip = Chip(assemble(source + "nop\n" * 300))
    chip.drive_pin(1, 1, 80)  # PB1 is not in PCMSK0
    chip.drive_pin(PB0, 1, 100)
    chip.drive_pin(PB0, 0, 150)
    chip.run_to(300)
    assert [e[0] for e in edges(chip)] == [100 + 9, 150 + 9]


def test_flags_are_cleared_by_ones_and_stand_without_their_enable():
    # EIFR (0x1C) rises although EIMSK is 0; OUT of another bit leaves it, SBI of its own clears it.
    source = EXTERNAL.format(**(IDLE | {"eicra": 1})).replace("sei", "") + "nop\n" * 60
    source += "in r1, 0x1C\nldi r16, 2\nout 0x1C, r16\nin r2, 0x1C\nsbi 0x1C, 0\nin r3, 0x1C\nbreak"
    chip = Chip(assemble(source))
    chip.drive_pin(PD2, 1, 50)
    assert chip.run_to(1000) is StopCause.BREAK
    assert list(chip.registers[1:4]) == [1, 1, 0]


def test_a_timer_output_can_raise_a_pin_change():
    # 13: the interrupts will trigger even if the pins are configured as outputs. OC1A toggles at 14 + 100.
    source = """
        jmp main
        .org 6
        sbi 0x03, 5
        reti
        .org 60
main:   ldi r16, 0x22
        out 0x04, r16
        ldi r16, 2
        sts 0x6B, r16       ; PCMSK0: PB1
        ldi r16, 1
        sts 0x68, r16
        ldi r16, 0x40
        sts 0x80, r16
        ldi r16, 99
        sts 0x88, r16
        ldi r16, 1
        sts 0x81, r16       ; at 20
        sei
    """
    chip = Chip(assemble(source + "nop\n" * 300))
    chip.run_to(250)
    assert edges(chip) == [(120, 1, 1), (120 + 9, 5, 1)]
