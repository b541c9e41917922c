"""The analogue-to-digital converter (ATmega328P datasheet, 24)."""

import pytest

from planarm_sim.cpu import layout as at
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


def test_the_comparator_as_a_trigger_is_told_of():
    chip = Chip(assemble("ldi r16, 1\nsts 0x7B, r16\nbreak"))
    chip.run_to(100)
    assert [touch.register for touch in chip.unmodelled()] == ["ADCSRB"]


# Each source's ADTS, what sets its flag at FLAG_AT = 300 cycles or so, and how many cycles after the last write.
TIMER_START = "ldi r16, {value}\nsts {register}, r16\nldi r16, 1\nsts {clock}, r16\n"
TRIGGERS = {
    # OCR0A = 99 counts from the write of TCCR0B on: the flag is set on the timer clock that leaves 99, 100 cycles on.
    "timer 0 compare A": (3, TIMER_START.format(value=99, register=0x47, clock=0x45), 100),
    "timer 0 overflow": (4, TIMER_START.format(value=0, register=0x47, clock=0x45), 256),
    "timer 1 compare B": (5, TIMER_START.format(value=99, register=0x8A, clock=0x81), 100),
    # TCNT1 = 0xFF00 leaves MAX after 256 clocks.
    "timer 1 overflow": (
        6,
        "ldi r16, 0xFF\nsts 0x85, r16\nldi r16, 0\nsts 0x84, r16\nldi r16, 1\nsts 0x81, r16\n",
        256,
    ),
    # An edge of the pin acts three cycles later: latch, two synchroniser stages, edge detector (17.2).
    "timer 1 capture": (7, "ldi r16, 0x41\nsts 0x81, r16\n", 200 + 3),
    "INT0": (2, "ldi r16, 3\nsts 0x69, r16\n", 200 + 3),
}


@pytest.mark.parametrize("name", TRIGGERS)
def test_a_conversion_is_triggered_when_its_flag_rises(name):
    # The trigger resets the prescaler and is synchronised for 3 CPU cycles; the sample is taken 2 ADC clocks later and
    # the result there after 13.5 (24.4, table 24-1), here clocks of 8 cycles. The first conversion since ADEN takes 25
    # clocks and is done by hand before; the sample is told by a voltage that changes just before or after it.
    adts, start, after = TRIGGERS[name]
    control = ADEN | ADATE | 3
    source = (
        START.format(mux=AVCC, control=ADEN | ADSC | 3)
        + DONE.format("first")
        + f"ldi r16, {adts}\nsts 0x7B, r16\nldi r16, {control | ADIF}\nsts 0x7A, r16\n"
        + start
        + "wait: rjmp wait"
    )
    probe = Chip(assemble(source))
    while probe.pc != len(assemble(source)) // 2 - 1:
        probe.run_to(probe.cycle + 1)
    started = probe.cycle
    flag_at = started + after
    sample, result = flag_at + 3 + 2 * 8, flag_at + 3 + 27 * 8 // 2
    for changed_at, expected in ((sample - 2, 512), (sample + 1, 0)):
        chip = Chip(assemble(source))
        if name in ("timer 1 capture", "INT0"):
            pin = 8 * 2 + 2 if name == "INT0" else 0
            chip.drive_pin(pin, 0, 0)
            chip.drive_pin(pin, 1, started + 200)
        chip.run_to(changed_at)
        chip.drive_analog(0, 2.5)
        chip.run_to(result - 2)
        assert not chip.snapshot().state[0x7A] & ADIF
        assert chip.snapshot().state[0x7A] & ADSC
        chip.run_to(result + 2)
        assert chip.snapshot().state[0x7A] & (ADIF | ADSC) == ADIF
        assert chip.snapshot().state[at.ADC_RESULT] == expected
        assert chip.unmodelled() == ()
        before = chip.cycle
        chip.run_to(before + 5000)  # the flag still stands: no edge, no conversion (24.3)
        assert not chip.snapshot().state[0x7A] & ADSC


def test_a_flag_that_is_cleared_triggers_again_and_one_that_comes_too_early_does_not():
    # Timer 0 in CTC every 256 cycles, its compare interrupt clears the flag. With clocks of 8 cycles a conversion takes
    # 3 + 108 cycles, so each flag starts one: period 256. With clocks of 32 it takes 3 + 432: every second is ignored.
    for setting, period in ((3, 256), (5, 512)):
        control = ADEN | ADATE | ADIE | setting
        chip = Chip(
            assemble(
                "jmp main\n.org 28\nreti\n.org 42\nsbi 0x03, 0\nreti\n.org 60\nmain: sbi 0x04, 0\n"
                "ldi r16, 255\nout 0x27, r16\nldi r16, 2\nout 0x24, r16\nsts 0x6E, r16\nldi r16, 3\nsts 0x7B, r16\n"
                f"ldi r16, {control}\nsts 0x7A, r16\nldi r16, 1\nout 0x25, r16\nsei\nloop: rjmp loop"
            )
        )
        chip.run_to(20_000)
        cycles = chip.drain_edges()["cycle"]
        steps = cycles[3:] - cycles[2:-1]
        assert len(steps) > 20
        assert abs(steps - period).max() <= 2, "up to the two cycles by which an interrupt may wait for an instruction"


def test_limits():
    with pytest.raises(PinError, match=r"5\.1 V"):
        Chip(b"").drive_analog(0, 5.1)
    with pytest.raises(PinError, match="channel 9"):
        Chip(b"").drive_analog(9, 1)
