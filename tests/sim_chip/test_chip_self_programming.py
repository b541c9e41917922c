"""SPM: the flash erased and written by the program (ATmega328P datasheet, 27)."""

import numpy as np
import pytest

from planarm_sim.cpu.chip import Chip, ResetCause, StopCause
from planarm_sim.cpu.decode import FLASH_WORDS, decode
from planarm_sim.cpu.program import Program
from planarm_sim.errors import UsageError
from sim_chip.avr_assembler import assemble

BOOT, NRWW = 0x3F00, 0x3800  # words: the boot section of BOOTSZ = 11, and table 27-14
FILL, ERASE, WRITE, ENABLE, WRONG = 0x01, 0x03, 0x05, 0x11, 0x07
PAGE_CYCLES = 72_000  # 4.5 ms
SPMCSR = 0x37


def spm(command, nops=0):
    """Three instructions, 3 cycles and `nops` more: the SPM ends 1 + nops cycles behind the write of SPMCSR."""
    return f"ldi r16, {command}\nout {SPMCSR}, r16\n" + "nop\n" * nops + "spm\n"


def at_z(word):
    return f"ldi r30, {2 * word & 0xFF}\nldi r31, {2 * word >> 8}\n"


def load(value, word):
    return f"ldi r17, {value & 0xFF}\nmov r0, r17\nldi r17, {value >> 8}\nmov r1, r17\n" + at_z(word) + spm(FILL)


WAIT = "{0}: in r18, 0x37\nsbrc r18, 0\nrjmp {0}\n"


def booted(source, application="", **fuses):
    """A chip whose boot section holds `source`, at its start."""
    flash = bytearray(assemble(f".org {BOOT}\n{source}").ljust(2 * FLASH_WORDS, b"\xff"))
    flash[: 2 * BOOT] = assemble(application or "nop").ljust(2 * BOOT, b"\xff")
    return Chip(bytes(flash), boot_reset=True, **fuses)


def words(chip, first, count=1):
    return chip.flash.view("<u2")[first : first + count].tolist()


def test_a_page_is_loaded_erased_written_and_read():
    source = load(0x1234, 0x40) + load(0xABCD, 0x7F) + at_z(0x45) + spm(ERASE) + WAIT.format("a")
    source += spm(WRITE) + WAIT.format("b") + spm(ENABLE) + at_z(0x7F) + "lpm\nmov r20, r0\nbreak"
    chip = booted(source, application=".org 63\n.word 7, 0, 0\n.org 128\n.word 9")
    assert chip.run_to(200_000) is StopCause.BREAK
    assert words(chip, 0x3F, 3) == [7, 0x1234, 0xFFFF]
    assert words(chip, 0x7F, 2) == [0xABCD, 9], "the pages on either side stay as they are"
    assert chip.registers[20] == 0xCD
    assert 2 * PAGE_CYCLES < chip.cycle < 2 * PAGE_CYCLES + 100


def test_writing_without_erasing_clears_bits_only():
    chip = booted(load(0x0FF0, 0) + spm(WRITE) + "break", application=".word 0x3C3C, 0x5555")
    chip.run_to(100)
    assert words(chip, 0, 2) == [0x0C30, 0x5555]


def test_a_word_of_the_buffer_takes_one_value_until_the_buffer_is_erased():
    # 27.8.2: not more than once to each address; the page write and RWWSRE erase the buffer.
    chip = booted(load(0x1111, 1) + load(0x2222, 1) + spm(ENABLE) + load(0x3333, 2) + load(4, 2) + spm(WRITE) + "break")
    chip.run_to(200)
    assert words(chip, 1, 2) == [0xFFFF, 0x3333]


@pytest.mark.parametrize(("nops", "erased"), [(0, True), (3, True), (4, False)])
def test_the_window_is_four_cycles(nops, erased):
    source = at_z(0) + spm(ERASE, nops) + "in r19, 0x37\nbreak"
    chip = booted(source, application=".word 0x1234")
    chip.run_to(100)
    assert (words(chip, 0) == [0xFFFF]) is erased
    assert chip.registers[19] == (0x43 if erased else 0), "RWWSB with the command while busy; else all is cleared"


def test_other_combinations_have_no_effect():
    chip = booted(at_z(0) + spm(WRONG) + "in r19, 0x37\nbreak", application=".word 0x1234")
    chip.run_to(100)
    assert words(chip, 0) == [0x1234]
    assert chip.registers[19] == 0


def test_spm_works_from_the_boot_section_only():
    chip = booted("jmp 0", application=at_z(0x100) + spm(ERASE) + "break\n.org 256\n.word 0x1234")
    chip.run_to(100)
    assert words(chip, 0x100) == [0x1234]
    larger = Chip(assemble(f".org {0x3800}\n" + at_z(0) + spm(ERASE) + "l: rjmp l"), boot_words=2048, boot_reset=True)
    larger.run_to(100)
    assert words(larger, 0) == [0xFFFF]
    smaller = Chip(assemble(".org 14336\n" + at_z(0x3800) + spm(ERASE) + "break"))
    smaller.pc = 0x3800
    assert smaller.run_to(100) is StopCause.BREAK
    assert words(smaller, 0x3800) != [0xFFFF]


def test_the_rww_section_is_blocked_until_it_is_enabled_again():
    # The CPU goes on in the other section, reads of the RWW one give nothing of use, and no program runs there.
    read = at_z(0x200) + "lpm\n"
    source = at_z(0) + spm(ERASE) + read + "mov r20, r0\n" + WAIT.format("a") + read + "mov r21, r0\nin r22, 0x37\n"
    source += spm(ENABLE) + read + "mov r23, r0\nin r24, 0x37\nbreak"
    chip = booted(source, application=".org 0x200\n.word 0x5A5A")
    assert chip.run_to(100_000) is StopCause.BREAK
    assert chip.registers[20:25].tolist() == [0xFF, 0xFF, 0x40, 0x5A, 0]
    runs_there = booted(at_z(0) + spm(ERASE) + "jmp 0x200", application=".org 0x200\nloop: rjmp loop")
    assert runs_there.run_to(100) is StopCause.BAD_OPCODE
    assert runs_there.pc == 0x200


def test_loading_the_buffer_unblocks_the_rww_section():
    # 27.9.1, RWWSB: cleared as well when a page load is started.
    chip = booted(at_z(0) + spm(ERASE) + WAIT.format("a") + spm(FILL) + "in r24, 0x37\nbreak")
    chip.run_to(100_000)
    assert chip.registers[24] & 0x40 == 0


def test_the_cpu_halts_for_a_page_of_its_own_section_and_time_goes_on():
    # Timer 0 runs at clk/1024: the halt shows in its count.
    source = "ldi r16, 5\nout 0x25, r16\n" + at_z(NRWW) + spm(ERASE) + "in r20, 0x26\nin r21, 0x37\nbreak"
    chip = booted(source)
    start = 2 + 2 + 3
    assert chip.run_to(start + 1000) is StopCause.REACHED
    assert chip.cycle == start + 1000
    assert chip.run_to(100_000) is StopCause.BREAK
    assert chip.cycle == start + PAGE_CYCLES + 3
    assert chip.registers[20] == (start + PAGE_CYCLES) // 1024
    assert chip.registers[21] == 0, "nothing is blocked"


def test_the_watchdog_bites_a_halted_cpu():
    source = "in r20, 0x34\nsbrc r20, 3\nbreak\nldi r16, 0x18\nsts 0x60, r16\nldi r16, 8\nsts 0x60, r16\n"
    source += at_z(NRWW) + (spm(ERASE) * 4) + "loop: rjmp loop"
    chip = booted(source)
    assert chip.run_to(400_000) is StopCause.BREAK
    assert 256_000 < chip.cycle < 256_030


def test_the_interrupt_comes_when_the_flash_is_ready():
    # Vector 25 of the boot section (IVSEL); SPMIE with the command, and the flash busy for 4.5 ms.
    source = "rjmp main\n.org 16178\nbreak\n.org 16200\nmain: ldi r16, 1\nout 0x35, r16\nldi r16, 2\nout 0x35, r16\n"
    chip = booted(source + at_z(0) + spm(0x80 | ERASE) + "sei\nloop: rjmp loop")
    assert chip.run_to(100_000) is StopCause.BREAK
    ready = 2 + 4 + 2 + 3 + PAGE_CYCLES
    assert ready + 4 + 1 <= chip.cycle <= ready + 4 + 1 + 1  # RJMP of two cycles under way


def test_eeprom_and_flash_are_not_written_at_once():
    # 27.8.8: SPMCSR cannot be written while EEPE is set; 27.8.2: an EEPROM write loses the page load.
    source = load(0, 0) + "sbi 0x1F, 2\nsbi 0x1F, 1\n" + spm(WRITE) + "wait: sbic 0x1F, 1\nrjmp wait\n"
    source += load(0x1234, 1) + spm(WRITE) + "sbi 0x1F, 2\nsbi 0x1F, 1\nin r20, 0x1F\nbreak"
    chip = booted(source, application=".word 0x5555")
    assert chip.run_to(100_000) is StopCause.BREAK
    assert words(chip, 0, 2) == [0x5555, 0x1234]
    assert chip.registers[20] & 2 == 0


def test_written_code_runs_and_a_skip_into_it_is_decoded_anew():
    # 0x3F: SBRS r31, 0 skips the two words of JMP once the page behind it holds that.
    jump = load(0x940C, 0x40) + load(0x3F80, 0x41) + load(0x9598, 0x42)
    source = jump + at_z(0x40) + spm(WRITE) + WAIT.format("a") + spm(ENABLE) + "ldi r31, 1\njmp 0x3F"
    chip = booted(source, application=".org 63\nsbrs r31, 0")
    assert chip.run_to(100_000) is StopCause.BREAK
    assert chip.pc == 0x43


@pytest.mark.parametrize("erased_runs", [False, True])
def test_pages_changed_one_by_one_decode_as_the_whole(erased_runs):
    random = np.random.default_rng(3)
    flash = random.integers(0, 256, 2 * FLASH_WORDS).astype(np.uint8)
    program = Program.of(flash, erased_runs=erased_runs)
    for word in [0, 63, 64, 5000, FLASH_WORDS - 1]:
        program = program.with_page_erased(word)
        program = program.with_page_written(word, random.integers(0, 0x10000, 64))
        np.testing.assert_array_equal(program.code, decode(program.flash, erased_runs=erased_runs))


def test_a_snapshot_keeps_the_flash_of_its_moment():
    source = (
        at_z(0x40) + "nop\n" * 8 + spm(ERASE) + "lpm\nmov r20, r0\n" + WAIT.format("a") + spm(ENABLE) + "lpm\nbreak"
    )
    chip = booted(source, application=".org 64\n.word 0x1234")
    chip.run_to(5)
    before = chip.snapshot()
    chip.run_to(40)
    during = chip.snapshot()
    chip.run_to(100_000)
    end = chip.cycle
    other = Chip(b"")
    other.restore(before)
    assert words(other, 0x40) == [0x1234]
    other.run_to(100_000)
    assert (other.cycle, words(other, 0x40)) == (end, [0xFFFF])
    other.restore(during)
    other.run_to(100_000)
    assert (other.cycle, int(other.registers[0])) == (end, 0xFF)


def test_resets_lead_to_the_boot_section_and_free_the_flash():
    chip = booted(at_z(0) + spm(ERASE) + "loop: rjmp loop")
    assert chip.pc == BOOT
    chip.run_to(100)
    chip.reset(ResetCause.EXTERNAL)
    assert chip.pc == BOOT
    chip.pc = 0x20
    chip.run_to(110)
    assert chip.pc > 0x20, "an erased word runs on, and is not blocked"
    assert Chip(b"", boot_words=1024).pc == 0


def test_an_empty_chip_comes_round_to_its_boot_loader():
    # Reset, jump to the empty application, through it, and again: BREAK at the second time.
    chip = booted("inc r2\nsbrc r2, 1\nbreak\njmp 0", application=".word 0xFFFF")
    assert chip.run_to(40_000) is StopCause.BREAK
    assert chip.cycle == pytest.approx(BOOT, abs=20)


def test_the_fuses_know_four_sizes():
    with pytest.raises(UsageError, match="300"):
        Chip(b"", boot_words=300)
