"""Power reduction (ATmega328P datasheet, 10.10): PRR stops parts, which keep their state and take no writes."""

import pytest

from planarm_sim.cpu.chip import Chip
from sim_chip.avr_assembler import assemble

PRR = 0x64
# Per timer: bit of PRR, TCCRnB and TCNTn (low byte), TIMSKn.
TIMERS = {0: (0x20, 0x45, 0x46, 0x6E), 1: (0x08, 0x81, 0x84, 0x6F), 2: (0x40, 0xB1, 0xB2, 0x70)}


@pytest.mark.parametrize("timer", TIMERS)
def test_a_timer_stands_still_and_counts_on(timer):
    # clk/1 is written at cycle 3; PRR is set at 6 and cleared at 46, two reads of TCNTn end at 29 and 48. A read in the
    # last cycle of its instruction sees the clocks up to that cycle's start: (6 - 3) while it is off; then one more
    # clock a cycle from 46 on: 3 + (47 - 46) = 4.
    bit, control, count, _ = TIMERS[timer]
    source = f"ldi r16, 1\nsts {control}, r16\nldi r17, {bit}\nsts {PRR}, r17\n"
    source += (
        "nop\n" * 21 + f"lds r20, {count}\nldi r17, 0\n" + "nop\n" * 14 + f"sts {PRR}, r17\nlds r21, {count}\nbreak"
    )
    chip = Chip(assemble(source))
    chip.run_to(100)
    assert (chip.cycle, chip.registers[20], chip.registers[21]) == (6 + 21 + 2 + 1 + 14 + 2 + 2 + 1, 3, 4)
    assert chip.unmodelled() == ()


@pytest.mark.parametrize("timer", TIMERS)
def test_registers_of_a_part_that_is_off_take_no_writes(timer):
    bit, control, count, mask = TIMERS[timer]
    source = f"ldi r16, {bit}\nsts {PRR}, r16\nldi r16, 1\nsts {control}, r16\nsts {mask}, r16\nsts {count}, r16\n"
    source += f"ldi r16, 0\nsts {PRR}, r16\nlds r20, {control}\nlds r21, {mask}\nlds r22, {count}\nbreak"
    chip = Chip(assemble(source))
    chip.run_to(100)
    assert chip.registers[20:23].tolist() == [0, 0, 0]


def test_no_interrupt_comes_from_a_timer_that_is_off():
    # Timer 0 overflows 256 cycles after cycle 5 or so; it is off from cycle 9 to 1000 and more.
    source = "rjmp main\n.org 32\nbreak\n.org 60\nmain: ldi r16, 1\nsts 0x6E, r16\nout 0x25, r16\nsei\n"
    source += "ldi r17, 0x20\nsts 0x64, r17\nldi r24, 250\nwait: sbiw r24, 1\nbrne wait\n"
    source += "ldi r17, 0\nsts 0x64, r17\nloop: rjmp loop"
    chip = Chip(assemble(source))
    chip.run_to(900)
    assert chip.pc > 60
    chip.run_to(1400)
    assert 1000 + 240 < chip.cycle < 1000 + 290, "overflow after what was left of the 256 cycles"


def test_the_usart_and_the_adc_stop():
    # UBRR0 = 0: a frame of 160 cycles is under way when the USART is switched off, and never ends; a byte that comes
    # meanwhile is not received, one that comes later is. The ADC's conversion never ends.
    source = "ldi r16, 0x18\nsts 0xC1, r16\nsts 0xC6, r16\nldi r16, 0xC0\nsts 0x7A, r16\nldi r16, 3\nsts 0x64, r16\n"
    source += "ldi r24, 250\nwait: sbiw r24, 1\nbrne wait\nlds r20, 0x7A\nldi r16, 0\nsts 0x64, r16\nloop: rjmp loop"
    chip = Chip(assemble(source))
    chip.push_rx(100, 16, 0x55)
    chip.push_rx(1500, 16, 0xAA)
    chip.run_to(3000)
    assert chip.drain_tx().tolist() == []
    assert chip.registers[20] == 0x80, "ADEN without ADSC and ADIF"
    state = chip.snapshot().state
    assert state[0xC0] & 0x80, "RXC0"
    chip.restore(chip.snapshot())
    probe = Chip(assemble("nop\nlds r0, 0xC6\nlds r1, 0xC0\nbreak"))
    snapshot = chip.snapshot()
    probe.restore(type(snapshot)(snapshot.state, snapshot.memory, probe.snapshot().program, snapshot.queues))
    probe.pc = 1
    probe.run_to(probe.cycle + 10)
    assert probe.registers[0] == 0xAA
    assert not probe.registers[1] & 0x80, "one byte only"
