"""The analogue-to-digital converter (ATmega328P datasheet, 24)."""

import pytest

from planarm_sim.cpu.chip import Chip, ResetCause, StopCause
from planarm_sim.errors import PinError
from sim_chip.avr_assembler import assemble

ADEN, ADSC, ADATE, ADIF, ADIE = 0x80, 0x40, 0x20, 0x10, 0x08
AVCC, BANDGAP_REFERENCE, LEFT = 0x40, 0xC0, 0x20
START = "ldi r16, {mux}\nsts 0x7C, r16\nldi r16, {control}\nsts 0x7A, r16\n"
READ = "lds r20, 0x78\nlds r21, 0x79\n"
DONE = "{0}: lds r18, 0x7A\nsbrc r18, 6\nrjmp {0}\n"


def converted(volts, mux=AVCC):
    """Registers ADCL and ADCH after one conversion of channel 0 of `mux`, with what `volts` puts on channels."""
    chip = Chip(assemble(START.format(mux=mux, control=ADEN | ADSC | 1) + DONE.format("a") + READ + "break"))
    for channel, value in volts.items():
        chip.drive_analog(channel, value)
    assert chip.run_to(10_000) is StopCause.BREAK
    assert chip.unmodelled() == ()
    return chip.registers[20] | chip.registers[21] << 8


@pytest.mark.parametrize(
    ("volts", "result"), [(0, 0), (0.004_882, 0), (0.004_883, 1), (2.5, 512), (4.9, 1003), (5, 1023)]
)
def test_a_result_is_the_voltage_in_1024ths_of_the_reference(volts, result):
    assert converted({0: volts}) == result


def test_channels_and_references():
    assert [converted({3: 1.25}, AVCC | channel) for channel in (2, 3, 4)] == [0, 256, 0]
    assert converted({7: 0.55}, BANDGAP_REFERENCE | 7) == 512
    assert converted({1: 1.2}, BANDGAP_REFERENCE | 1) == 1023
    assert converted({0: 1.65, 8: 3.3}, 0) == 512, "against AREF"
    assert converted({0: 0}, 0) == 1023, "AREF is open"
    assert converted({}, AVCC | 14) == 225, "1.1 V"
    assert converted({}, AVCC | 15) == 0
    assert converted({0: 2.5}, AVCC | LEFT) == 512 << 6


def test_without_a_voltage_the_digital_level_is_converted():
    chip = Chip(assemble(START.format(mux=AVCC | 2, control=ADEN | ADSC | 1) + DONE.format("a") + READ + "break"))
    chip.drive_pin(10, 1)
    chip.run_to(10_000)
    assert (chip.registers[20], chip.registers[21]) == (0xFF, 3)


@pytest.mark.parametrize("setting", range(8))
def test_the_first_conversion_takes_25_clocks_and_the_next_13(setting):
    # ADCSRA is written at 6: the conversion starts at the next edge, one ADC clock later, and its interrupt (vector
    # 21) finds a sleeping CPU, which takes 8 cycles more to wake. Then ADSC is written again at a known phase.
    clock = 1 << max(setting, 1)
    control = ADEN | ADSC | ADIE | setting
    source = "jmp main\n.org 42\nbreak\nsts 0x7A, r16\nreti\n.org 60\nmain: ldi r17, 1\nout 0x33, r17\n"
    chip = Chip(assemble(source + START.format(mux=AVCC, control=control) + "sei\nloop: sleep\nrjmp loop"))
    written = 3 + 2 + 6
    assert chip.run_to(10_000) is StopCause.BREAK
    done = written + clock + 25 * clock
    assert chip.cycle == done + 8 + 1
    again = chip.cycle + 2
    start = written + ((again - written) // clock + 1) * clock
    assert chip.run_to(20_000) is StopCause.BREAK
    assert chip.cycle == start + 13 * clock + 8 + 1


def test_the_voltage_counts_at_the_sample():
    # 13.5 ADC clocks after the start of the first conversion (24.4); clock = 128, started at 6 + 128.
    sample = 6 + 128 + 27 * 64
    for change, result in ((sample - 10, 1023), (sample + 10, 0)):
        chip = Chip(assemble(START.format(mux=AVCC, control=ADEN | ADSC | 7) + DONE.format("a") + READ + "break"))
        chip.drive_analog(0, 0)
        chip.run_to(change)
        chip.drive_analog(0, 5)
        chip.run_to(10_000)
        assert chip.registers[20] | chip.registers[21] << 8 == result


def test_free_running_goes_on_by_itself_and_interrupts_each_time():
    source = "jmp main\n.org 42\ninc r2\nreti\n.org 60\nmain: "
    chip = Chip(assemble(source + START.format(mux=AVCC, control=ADEN | ADSC | ADATE | ADIE | 5) + "sei\nl: rjmp l"))
    chip.run_to(3 + 6 + 32 + 25 * 32 + 9 * 13 * 32 + 40)
    assert chip.registers[2] == 10
    chip.run_to(chip.cycle + 13 * 32)
    assert chip.registers[2] == 11


def test_the_flag_is_cleared_by_writing_one_and_switching_off_ends_a_conversion():
    source = START.format(mux=AVCC, control=ADEN | ADSC | 1) + DONE.format("a") + "lds r19, 0x7A\n"
    source += f"ldi r16, {ADEN | ADIF | 1}\nsts 0x7A, r16\nlds r20, 0x7A\n"
    source += f"ldi r16, {ADEN | ADSC | 1}\nsts 0x7A, r16\nldi r16, 1\nsts 0x7A, r16\nlds r21, 0x7A\n"
    chip = Chip(assemble(source + "nop\n" * 100 + "lds r22, 0x7A\nbreak"))
    assert chip.run_to(10_000) is StopCause.BREAK
    assert chip.registers[19:23].tolist() == [ADEN | ADIF | 1, ADEN | 1, 1, 1]


def test_reading_adcl_holds_the_result_until_adch_is_read():
    wait = "nop\n" * 60
    source = START.format(mux=AVCC, control=ADEN | ADSC | ADATE | 1) + wait + "lds r20, 0x78\nbreak\n" + wait
    source += "lds r21, 0x79\n" + wait + READ.replace("r20", "r22").replace("r21", "r23") + "break"
    chip = Chip(assemble(source))
    chip.drive_analog(0, 1.25)
    chip.run_to(1_000)
    chip.drive_analog(0, 5)
    chip.run_to(10_000)
    assert chip.registers[20:24].tolist() == [0, 1, 0xFF, 3]


def test_a_reset_keeps_what_is_connected_and_a_snapshot_too():
    chip = Chip(b"")
    chip.drive_analog(4, 1.5)
    snapshot = chip.snapshot()
    chip.reset(ResetCause.EXTERNAL)
    assert chip.analog_volts(4) == 1.5
    chip.drive_analog(4, None)
    assert chip.analog_volts(4) is None
    chip.restore(snapshot)
    assert chip.analog_volts(4) == 1.5


def test_other_triggers_are_told_of():
    chip = Chip(assemble("ldi r16, 3\nsts 0x7B, r16\nbreak"))
    chip.run_to(100)
    assert [touch.register for touch in chip.unmodelled()] == ["ADCSRB"]


def test_limits():
    with pytest.raises(PinError, match=r"5\.1 V"):
        Chip(b"").drive_analog(0, 5.1)
    with pytest.raises(PinError, match="channel 9"):
        Chip(b"").drive_analog(9, 1)
