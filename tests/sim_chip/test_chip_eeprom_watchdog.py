"""EEPROM, watchdog and reset (ATmega328P datasheet, 8.4, 8.6.3, 11.8, 11.9)."""

import pytest

from planarm_sim.cpu.chip import Chip, ResetCause, StopCause
from sim_chip.avr_assembler import assemble

WRITE = """
        ldi r16, {address}
        out 0x21, r16       ; EEARL
        ldi r16, {high}
        out 0x22, r16
        ldi r16, {data}
        out 0x20, r16       ; EEDR
        ldi r16, {mode}
        out 0x1F, r16
        sbi 0x1F, 2         ; EEMPE
        {between}
        sbi 0x1F, 1         ; EEPE
"""
PLAIN = {"address": 5, "high": 0, "data": 0xA5, "mode": 0, "between": ""}


def test_a_write_takes_3_4_ms_and_halts_the_cpu_for_two_cycles():
    # Four LDI and OUT (8), SBI 2, SBI 2: EEPE is written at 12, the CPU goes on at 14; the byte is there 3.4 ms =
    # 54,400 cycles after 12.
    chip = Chip(assemble(WRITE.format(**PLAIN) + "loop: rjmp loop"))
    chip.run_to(14)
    assert chip.cycle == 14
    chip.run_to(12 + 54_400 - 2)
    assert chip.eeprom[5] == 0xFF
    chip.run_to(12 + 54_400)
    assert chip.eeprom[5] == 0xA5


@pytest.mark.parametrize(("nops", "written"), [(0, True), (1, True), (2, True), (3, False)])
def test_the_window_of_eempe_is_four_cycles(nops, written):
    # SBI EEPE ends 2 cycles behind SBI EEMPE, and each NOP adds one.
    chip = Chip(assemble(WRITE.format(**(PLAIN | {"between": "\n".join(["nop"] * nops)})) + "loop: rjmp loop"))
    chip.run_to(60_000)
    assert bool(chip.eeprom[5] == 0xA5) is written


def test_a_read_halts_the_cpu_for_four_cycles():
    chip = Chip(assemble("ldi r16, 7\nout 0x21, r16\nsbi 0x1F, 0\nin r1, 0x20\nbreak"))
    chip.eeprom[7] = 0x3C
    chip.run_to(100)
    assert chip.registers[1] == 0x3C
    assert chip.cycle == 1 + 1 + 2 + 4 + 1 + 1


def test_erase_and_write_alone():
    # EEPM = 1 erases, 2 writes (clears bits only), each in 1.8 ms = 28,800 cycles.
    chip = Chip(assemble(WRITE.format(**(PLAIN | {"mode": 0x20, "data": 0x0F})) + "loop: rjmp loop"))
    chip.eeprom[5] = 0xF3
    chip.run_to(12 + 28_800)
    assert chip.eeprom[5] == 0x03
    chip = Chip(assemble(WRITE.format(**(PLAIN | {"mode": 0x10})) + "loop: rjmp loop"))
    chip.eeprom[5] = 0x55
    chip.run_to(12 + 28_800)
    assert chip.eeprom[5] == 0xFF


def test_the_ready_interrupt_comes_when_the_write_is_done():
    # Vector 22, EERIE (bit 3) with the mode; EEPE is written at 3 + 12 and falls 54,400 cycles later.
    source = "jmp main\n.org 44\nbreak\n.org 60\nmain:" + WRITE.format(**(PLAIN | {"mode": 8})) + "sei\nloop: rjmp loop"
    chip = Chip(assemble(source))
    assert chip.run_to(100_000) is StopCause.BREAK
    ready = 3 + 12 + 54_400
    assert ready + 4 + 1 <= chip.cycle <= ready + 4 + 1 + 1  # RJMP of two cycles under way


def test_the_high_address_bits_reach_the_upper_pages():
    chip = Chip(assemble(WRITE.format(**(PLAIN | {"high": 3, "address": 0xFF})) + "loop: rjmp loop"))
    chip.run_to(60_000)
    assert chip.eeprom[0x3FF] == 0xA5


WATCHDOG = """
        jmp main
        .org 12
        {vector}
        .org 60
main:   in r20, 0x34        ; MCUSR
        sbrc r20, 3
        break
        ldi r16, 0x18
        sts 0x60, r16       ; WDCE, WDE
        ldi r16, {setting}
        sts 0x60, r16
        sei
loop:   {body}
        rjmp loop
"""


def test_a_watchdog_reset_comes_after_16_ms_and_leaves_its_mark():
    # 2048 periods of 128 kHz are 256,000 cycles (table 11-2), from the write that starts it: 3 + 1 + 2 + 1 + 2 = 9.
    chip = Chip(assemble(WATCHDOG.format(vector="reti", setting=0x08, body="inc r5")))
    chip.sram[100] = 0x77
    assert chip.run_to(1_000_000) is StopCause.BREAK
    assert 9 + 256_000 <= chip.cycle <= 9 + 256_000 + 12
    assert chip.registers[20] == ResetCause.POWER_ON | ResetCause.WATCHDOG
    assert chip.sram[100] == 0x77


def test_wdr_keeps_the_watchdog_quiet():
    chip = Chip(assemble(WATCHDOG.format(vector="reti", setting=0x08, body="wdr")))
    assert chip.run_to(1_000_000) is StopCause.REACHED


def test_interrupts_alone_come_again_and_again():
    # WDIE without WDE: WDIE stays, and no time-out resets (table 11-1).
    chip = Chip(assemble(WATCHDOG.format(vector="sbi 0x1E, 0\ninc r6\nreti", setting=0x40, body="nop")))
    assert chip.run_to(9 + 3 * 256_000 + 100) is StopCause.REACHED
    assert chip.registers[6] == 3
    chip.run_to(9 + 4 * 256_000 + 100)
    assert chip.registers[6] == 4


def test_interrupt_first_reset_next():
    # WDIE and WDE: the interrupt clears WDIE, the next time-out resets (table 11-1).
    chip = Chip(assemble(WATCHDOG.format(vector="sbi 0x1E, 0\nreti", setting=0x48, body="nop")))
    chip.run_to(9 + 256_000 + 100)
    assert chip.snapshot().state[0x3E] == 1
    assert chip.run_to(1_000_000) is StopCause.BREAK
    assert chip.cycle > 9 + 2 * 256_000


@pytest.mark.parametrize(("setting", "resets"), [(0x48, True), (0x40, False)], ids=["WDE and WDIE", "WDIE alone"])
def test_an_interrupt_that_is_not_executed_before_the_next_time_out_resets(setting: int, resets: bool):
    # 11.9.2, bit WDIE: so with interrupts off, in interrupt and system reset mode alone (table 11-1).
    chip = Chip(assemble(WATCHDOG.format(vector="sbi 0x1E, 0\nreti", setting=setting, body="cli")))
    assert chip.run_to(9 + 2 * 256_000 - 100) is StopCause.REACHED
    assert chip.snapshot().state[0x60] == setting | 0x80
    assert chip.run_to(9 + 2 * 256_000 + 100) is (StopCause.BREAK if resets else StopCause.REACHED)
    assert chip.snapshot().state[0x3E] == 0


def test_an_interrupt_executed_late_gives_the_program_a_whole_period_more():
    # Interrupts are off until 1.5 periods have passed, by a busy loop of 4 cycles (sbiw, brne) and one around it.
    wait = "cli\nldi r24, 0x00\nldi r25, 0x77\nwait: adiw r24, 1\nnop\nbrne wait\nsei\nstay: rjmp stay"
    chip = Chip(assemble(WATCHDOG.format(vector="sbi 0x1E, 0\nreti", setting=0x48, body=wait)))
    assert chip.run_to(9 + 2 * 256_000 - 100) is StopCause.REACHED
    assert chip.snapshot().state[0x3E] == 1


def test_the_watchdog_cannot_be_stopped_without_the_timed_sequence():
    body = "ldi r16, 0\nsts 0x60, r16"
    chip = Chip(assemble(WATCHDOG.format(vector="reti", setting=0x08, body=body)))
    assert chip.run_to(1_000_000) is StopCause.BREAK
    stopped = Chip(
        assemble(
            WATCHDOG.format(
                vector="reti", setting=0x08, body="ldi r17, 0x18\n" + body.replace("sts", "sts 0x60, r17\nsts")
            )
        )
    )
    assert stopped.run_to(1_000_000) is StopCause.REACHED


def test_after_a_watchdog_reset_the_watchdog_runs_on():
    # WDRF overrides WDE (11.9.2): a program that does not care is reset every 16 ms.
    source = "in r20, 0x34\nlds r21, 0x60\nloop: rjmp loop"
    chip = Chip(assemble(source))
    chip.run_to(10)
    chip.reset(ResetCause.WATCHDOG)
    chip.run_to(chip.cycle + 10)
    assert chip.registers[21] & 8
    start = chip.cycle
    chip.registers[5] = 9
    chip.run_to(start + 256_100)
    assert chip.registers[5] == 0


def test_reset_clears_registers_and_keeps_time_and_sram():
    chip = Chip(assemble("sbi 0x04, 0\nsbi 0x05, 0\nldi r16, 9\nsts 0x200, r16\nsts 0x6F, r16\nloop: rjmp loop"))
    chip.run_to(501)
    chip.drain_edges()
    chip.reset(ResetCause.EXTERNAL)
    assert chip.cycle == 501
    assert (chip.pc, chip.sp, chip.sreg) == (0, 0x8FF, 0)
    assert chip.sram[0x100] == 9
    assert chip.drain_edges().tolist() == [(501, 0, 0)]  # the pin is let go
    chip.reset(ResetCause.POWER_ON)
    assert not chip.sram.any()
