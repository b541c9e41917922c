"""When interrupts are taken, in which order, and what they cost (ATmega328P datasheet, 7.7, 7.7.1 and 12.1)."""

import pytest

from planarm_sim.cpu.chip import Chip, StopCause
from sim_chip.avr_assembler import assemble

# Timer 1 counts from the end of the STS to TCCR1B. TCNT1 = OCR1A during one clock, OCF1A rises at its end.
PROLOGUE = """
        jmp main
        .org 22                 ; TIMER1_COMPA, vector 11
        {vector}
        .org 60
main:   ldi r16, {ocr}          ; 3 + 1
        sts 0x88, r16           ; OCR1AL
        ldi r16, 2
        sts 0x6F, r16           ; OCIE1A
        sbi 0x04, 5             ; PB5 output
        ldi r16, 1
        sts 0x81, r16           ; TCCR1B: clk/1, from cycle 14 on
        sei
"""
START = 3 + 1 + 2 + 1 + 2 + 2 + 1 + 2
NOPS = "\n".join(["nop"] * 300)


def edges(chip: Chip) -> list[tuple[int, int]]:
    return [(int(e["cycle"]), int(e["level"])) for e in chip.drain_edges() if e["pin"] == 5]


def test_entry_jump_and_return_take_eleven_cycles():
    # 4 (entry) + 3 (JMP) + 4 (RETI) = 11: the same 300 NOPs take exactly 11 cycles more.
    source = PROLOGUE.format(vector="jmp handler", ocr=50) + NOPS + "\nbreak\nhandler: reti"
    with_interrupt = Chip(assemble(source))
    without = Chip(assemble(source.replace("\n        sei\n", "\n        cli\n")))
    assert with_interrupt.run_to(10_000) is without.run_to(10_000) is StopCause.BREAK
    assert with_interrupt.cycle - without.cycle == 11


def test_from_flag_to_pin_edge():
    # NOPs: the flag rises at cycle 119, an instruction ends there. Entry to 123, JMP to 126, SBI PINB to 128.
    ocr = 119 - START - 1
    chip = Chip(assemble(PROLOGUE.format(vector="jmp handler", ocr=ocr) + NOPS + "\nbreak\nhandler: sbi 0x03, 5\nreti"))
    chip.run_to(400)
    assert edges(chip) == [(128, 1)]


@pytest.mark.parametrize("offset", range(8))
def test_an_instruction_under_way_is_finished_first(offset):
    # A loop of CALL (4) and RET (4) beginning at 16: the flag's cycle is rounded up to the next multiple of 4.
    body = "loop: call sub\nrjmp loop\nnop\nsub: ret"
    source = PROLOGUE.format(vector="sbi 0x03, 5\nreti", ocr=60 + offset) + "nop\n" + body
    flag = START + 60 + offset + 1
    boundaries = [16 + 10 * n + k for n in range(20) for k in (0, 4, 8)]  # CALL 4, RET 4, RJMP 2
    taken = next(b for b in boundaries if b >= flag)
    chip = Chip(assemble(source))
    chip.run_to(200)
    assert edges(chip)[0] == (taken + 4 + 2, 1)


@pytest.mark.parametrize("enable", ["sei", "bset 7", "out 0x3F, r17", "sts 0x5F, r17"])
def test_one_instruction_runs_after_interrupts_are_enabled(enable):
    # The flag is up long before; the INC behind the enabling instruction still runs, the second one does not.
    body = f"ldi r17, 0x80\n{NOPS}\n{enable}\ninc r20\ninc r20\nbreak"
    chip = Chip(assemble(PROLOGUE.replace("sei", "cli").format(vector="break", ocr=20) + body))
    assert chip.run_to(10_000) is StopCause.BREAK
    assert chip.registers[20] == 1


def test_one_instruction_of_the_main_program_runs_between_two_interrupts():
    # EE_READY (vector 22) asks for as long as the EEPROM is ready: the handler runs after every instruction.
    source = """
        jmp main
        .org 44
        inc r21
        reti
        .org 60
main:   ldi r16, 8
        out 0x1F, r16       ; EERIE
        sei
        nop
loop:   inc r20
        inc r20
        inc r20
        inc r20
        break
    """
    chip = Chip(assemble(source))
    assert chip.run_to(10_000) is StopCause.BREAK
    assert (chip.registers[20], chip.registers[21]) == (4, 5)


@pytest.mark.parametrize("access", ["in r1, 0x15", "sbi 0x05, 0", "sts 0x88, r20", "lds r1, 0x84"])
def test_an_access_to_io_behind_sei_does_not_lose_the_interrupt(access):
    body = f"{NOPS}\nsei\n{access}\ninc r20\nbreak"
    chip = Chip(assemble(PROLOGUE.replace("sei", "cli").format(vector="break", ocr=20) + body))
    assert chip.run_to(10_000) is StopCause.BREAK
    assert chip.registers[20] == 0


def test_lower_vectors_come_first():
    # OCF1A, OCF1B and TOV1 are all up when interrupts are enabled: vectors 11, 12, 13 in this order.
    source = """
        jmp main
        .org 22
        mov r2, r20
        rjmp bump
        .org 24
        mov r3, r20
        rjmp bump
        .org 26
        mov r4, r20
        rjmp bump
        .org 60
bump:   inc r20
        reti
main:   ldi r16, 0xFF
        sts 0x85, r16
        ldi r16, 0xF0
        sts 0x84, r16       ; TCNT1 = 0xFFF0
        ldi r16, 7
        sts 0x6F, r16       ; OCIE1A, OCIE1B, TOIE1; both OCR1x are 0
        ldi r16, 1
        sts 0x81, r16
        ldi r20, 1
        NOPS
        sei
        nop
        nop
        nop
        break
    """
    chip = Chip(assemble(source.replace("NOPS", NOPS)))
    assert chip.run_to(10_000) is StopCause.BREAK
    assert list(chip.registers[2:5]) == [1, 2, 3]


def test_taking_an_interrupt_clears_its_flag_and_the_enable():
    chip = Chip(assemble(PROLOGUE.format(vector="in r1, 0x16\nin r2, 0x3F\nbreak", ocr=50) + NOPS))
    assert chip.run_to(10_000) is StopCause.BREAK
    assert chip.registers[1] & 2 == 0  # OCF1A
    assert chip.registers[2] & 0x80 == 0  # I


def test_sleep_adds_four_cycles():
    # Flag at START + 101. Asleep from 17 on; entry 4 + 4, then SBI 2.
    ocr = 100
    source = PROLOGUE.format(vector="sbi 0x03, 5\nreti", ocr=ocr).replace("sei", "ldi r16, 1\nout 0x33, r16\nsei")
    chip = Chip(assemble(source + "sleep\nnop\nbreak"))
    assert chip.run_to(10_000) is StopCause.BREAK
    flag = START + ocr + 1
    assert edges(chip) == [(flag + 4 + 4 + 2, 1)]
    assert chip.cycle == flag + 10 + 4 + 1 + 1  # RETI, NOP, BREAK


def test_asleep_with_interrupts_off_nothing_can_wake_the_chip():
    chip = Chip(assemble("ldi r16, 1\nout 0x33, r16\nsleep\nnop\nbreak"))
    assert chip.run_to(1000) is StopCause.ASLEEP
    assert chip.cycle == 3


def test_vectors_move_to_the_boot_section():
    # IVSEL is changed within four cycles of IVCE (datasheet, 12.5); 0x3F00 + 22 is TIMER1_COMPA then.
    source = PROLOGUE.format(vector="break", ocr=50).replace(
        "sei", "ldi r16, 1\nldi r17, 2\nout 0x35, r16\nout 0x35, r17\nsei"
    )
    chip = Chip(assemble(source + NOPS + "\nbreak\n.org 0x3F16\nldi r25, 77\nbreak"))
    assert chip.run_to(10_000) is StopCause.BREAK
    assert (chip.registers[25], chip.pc) == (77, 0x3F18)


def test_late_change_of_ivsel_is_ignored():
    # The write of IVSEL ends five cycles after that of IVCE.
    source = "ldi r16, 1\nldi r17, 2\nout 0x35, r16\nnop\nnop\nnop\nnop\nout 0x35, r17\nin r18, 0x35\nbreak"
    chip = Chip(assemble(source))
    chip.run_to(100)
    assert chip.registers[18] == 0
