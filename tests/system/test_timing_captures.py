"""One program in two simulators: their recordings are read and judged alike."""

import shutil
import subprocess
from pathlib import Path

import pytest

from planarm.analysis.capture import open_capture
from planarm.analysis.channels import map_channels
from planarm.analysis.timing import PulseLimits, TimingRules, analyse, recorded_schedules
from planarm_sim import Uno
from planarm_sim.errors import StoppedError
from planarm_wire.messages import BOARDS

PINS = BOARDS["uno"].joint_pins

HEADER = Path("/usr/include/simavr/avr/avr_mcu_section.h")
MISSING = [name for name in ("avr-gcc", "simavr") if shutil.which(name) is None]
PROGRAM = r"""
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <util/delay.h>
#include "avr_mcu_section.h"
AVR_MCU(F_CPU, "atmega328p");
AVR_MCU_VCD_FILE("simavr.vcd", 1000);
const struct avr_mmcu_vcd_trace_t traces[] _MMCU_ = {
    {AVR_MCU_VCD_SYMBOL("D9"), .mask = 1 << 1, .what = (void *)&PORTB},
    {AVR_MCU_VCD_SYMBOL("D10"), .mask = 1 << 2, .what = (void *)&PORTB},
    {AVR_MCU_VCD_SYMBOL("D4"), .mask = 1 << 4, .what = (void *)&PORTD},
    {AVR_MCU_VCD_SYMBOL("D5"), .mask = 1 << 5, .what = (void *)&PORTD},
};
static void step(unsigned char pin) {
    PORTB |= pin;
    _delay_us(2);
    PORTB &= ~pin;
    _delay_us(100);
}
int main(void) {
    DDRB = 0x06;
    DDRD = 0x30;
    for (int i = 0; i < 200; i++) {
        step(2);
        if (i % 3 == 0) step(4);
        if (i == 100) {
            PORTD |= 0x10;   /* too late for the next step of joint 1 */
            _delay_us(0.3);
        }
    }
    cli();
    sleep_enable();
    sleep_cpu();
}
"""


@pytest.mark.skipif(bool(MISSING) or not HEADER.exists(), reason=f"needs {MISSING or HEADER}: avr-gcc and simavr")
def test_simavrs_recording_is_judged_as_ours(tmp_path):
    (tmp_path / "steps.c").write_text(PROGRAM)
    section = "-Wl,--undefined=_mmcu,--section-start=.mmcu=0x910000"
    compiler = ["avr-gcc", "-mmcu=atmega328p", "-DF_CPU=16000000UL", "-O2", f"-I{HEADER.parent}", section]
    subprocess.run([*compiler, "steps.c", "-o", "steps.elf"], cwd=tmp_path, check=True)
    simavr = ["simavr", "-m", "atmega328p", "-f", "16000000", "steps.elf"]
    subprocess.run(simavr, cwd=tmp_path, check=True, timeout=60, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    uno = Uno.from_elf(tmp_path / "steps.elf")
    with pytest.raises(StoppedError, match="asleep"):  # the program's own end
        uno.run(seconds=0.1)
    uno.write_vcd(tmp_path / "ours.vcd", ["D9", "D10", "D4", "D5"])

    rules = TimingRules((PulseLimits(1e-6, 1e-6, 5e-6, 0.65e-6),) * 2)
    reports = {}
    ours = open_capture(tmp_path / "ours.vcd")
    schedules = recorded_schedules(ours, map_channels(ours.path, ours.channels, [], PINS))
    for name in ("ours.vcd", "simavr.vcd"):
        capture = open_capture(tmp_path / name)
        reports[name] = analyse(capture, map_channels(capture.path, capture.channels, [], PINS), schedules, rules)
        assert [(f.kind, f.joint) for f in reports[name].findings] == [("dir_setup", 1)], name
        assert [joint.steps for joint in reports[name].joints] == [200, 67], name
    mine, theirs = reports["ours.vcd"].joints[0], reports["simavr.vcd"].joints[0]
    assert theirs.timing_error.max_us <= 0.02, "simavr 1.6 writes whole units of 10 ns"
    assert mine.dir_setup_min_us == pytest.approx(theirs.dir_setup_min_us, abs=0.02)
    assert mine.high_min_us == pytest.approx(theirs.high_min_us, abs=0.02)


DELAYED = r"""
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/delay.h>
ISR(TIMER1_COMPA_vect) { PORTB |= 2; _delay_us(2); PORTB &= ~2; }
ISR(TIMER2_COMPA_vect) { TIMSK2 = 0; _delay_us(30); }
int main(void) {
    DDRB = 0x02;
    DDRD = 0x10;
    OCR1A = 1599; TIMSK1 = 2; TCCR1B = 9;  /* a step every 100 us */
#ifdef LATE
    OCR2A = 198; TIMSK2 = 2; TCCR2B = 6;   /* once, 199 x 256 cycles later: 16 us before the 32nd step */
#endif
    sei();
    for (;;) {}
}
"""


@pytest.mark.skipif(shutil.which("avr-gcc") is None, reason="needs avr-gcc")
def test_the_interrupt_that_held_an_edge_up_is_named_on_the_emulators_own_recording(tmp_path):
    (tmp_path / "steps.c").write_text(DELAYED)
    captures = {}
    for name, flags in {"as_planned": [], "late": ["-DLATE"]}.items():
        command = ["avr-gcc", "-mmcu=atmega328p", "-DF_CPU=16000000UL", "-O2", *flags, "steps.c", "-o", f"{name}.elf"]
        subprocess.run(command, cwd=tmp_path, check=True)
        uno = Uno.from_elf(tmp_path / f"{name}.elf")
        uno.observe()
        uno.run(seconds=0.00605)
        uno.write_vcd(tmp_path / f"{name}.vcd", ["D9", "D4"])
        captures[name] = open_capture(tmp_path / f"{name}.vcd")
    channels = {name: map_channels(one.path, one.channels, [], PINS) for name, one in captures.items()}
    schedules = recorded_schedules(captures["as_planned"], channels["as_planned"])
    report = analyse(captures["late"], channels["late"], schedules, TimingRules((PulseLimits(),), 5.0))
    [finding] = report.findings
    assert (finding.kind, finding.cause) == ("late", "interrupt TIMER2_COMPA")
    assert finding.time_s == pytest.approx(32 * 100e-6, abs=50e-6)
    assert 10.0 < finding.value_us < 20.0, "30 us of the other interrupt, begun 16 us before the step was due"
