"""Arduino sketches on Debian's core, unmodified: they do what Arduino's reference says, where known to the cycle."""

from pathlib import Path

import numpy as np
import pytest

from planarm_sim import Uno
from planarm_sim.board.pins import pin_place
from sim_board.arduino import LIBRARIES, build_sketch

SKETCHES = Path(__file__).parent / "sketches"
MS = 16_000  # cycles


@pytest.fixture(scope="session")
def core_cache(request, tmp_path_factory):
    """Where the built core is kept: over the runs, unless pytest was told to keep nothing."""
    cache = getattr(request.config, "cache", None)
    return cache.mkdir("arduino") if cache is not None else tmp_path_factory.mktemp("arduino")


@pytest.fixture
def sketch(core_cache, tmp_path):
    """Build a sketch, power up a board with it, and let it set up."""

    def start(source, *libraries, baud=250_000, usb="direct", setup_s=0.01):
        path = SKETCHES / f"{source}.ino" if isinstance(source, str) else source
        uno = Uno.from_elf(build_sketch(path, tmp_path, core_cache, libraries), baud=baud, usb=usb)
        uno.run(seconds=setup_s)
        return uno

    return start


def ask(uno, question=b"?", limit_s=0.1):
    uno.serial.read()
    uno.serial.write(question)
    uno.run_until(b"\n", limit_s=limit_s)
    return uno.serial.read().decode().strip()


def test_serial_echoes_every_byte_at_115200(sketch):
    uno = sketch("echo", baud=115_200, usb="16u2")
    text = bytes(range(256))
    uno.serial.write(text)
    uno.run(seconds=0.05)
    assert uno.serial.read() == text
    log = uno.serial.log
    # HardwareSerial sets U2X and UBRR = (F_CPU / 4 / baud - 1) / 2 = 16: 17 x 8 cycles a bit, as the USB bridge does.
    assert set((log["end"] - log["start"]).tolist()) == {10 * 136}
    back = log[log["direction"] == 1]["end"] - log[log["direction"] == 0]["end"]
    assert back.min() >= 1360 - 136, "a byte is read at its stop bit and takes as long back"
    assert back.max() < 1360 + 800, "interrupt, loop(), interrupt: no byte waits for another"


def test_millis_and_micros_are_the_boards_time(sketch):
    uno = sketch("clocks")
    answers = []
    for wait in (0.0, 0.0123, 0.4, 1.1):
        uno.run(seconds=wait)
        us, ms = map(int, ask(uno).split())
        answers.append((uno.edges("D8")[-2]["cycle"], us, ms))
    at, us, ms = (np.array(column) for column in zip(*answers, strict=True))
    # Timer 0 counts at clk/64: micros() has a resolution of 4 us, and counts from wiring.c's init().
    assert np.all(us % 4 == 0)
    assert np.ptp(at / 16 - us) <= 4 + 8, "resolution, and the interrupts in between"
    # millis() counts an overflow every 1.024 ms as 1, and makes up for the fraction in steps of one.
    assert np.all(np.abs(us / 1000 - ms) <= 2.1)


def test_tone_pwm_and_delays(sketch):
    uno = sketch("outputs", setup_s=0.7)
    tone = uno.edges("D8")
    # Tone.cpp: timer 2 in CTC mode at clk/32 with OCR2A = 249, 8000 cycles a half period; toggles in its interrupt, for
    # 2 x 1000 Hz x 0.5 s of them. Another interrupt (timer 0) may hold one up.
    assert len(tone) == 1000
    halves = np.diff(tone["cycle"])
    assert np.mean(halves) == pytest.approx(8000, abs=1)
    assert halves.min() > 8000 - 200
    assert halves.max() < 8000 + 200
    assert tone[-1]["level"] == 0
    # analogWrite on D9: timer 1, phase correct, eight bits, clk/64: 510 x 64 cycles; 64 counts up and 64 down are high.
    pwm = uno.edges("D9")[4:404]
    assert set(np.diff(pwm["cycle"][pwm["level"] == 1]).tolist()) == {510 * 64}
    assert set((pwm["cycle"][1::2] - pwm["cycle"][::2]).tolist()) == {128 * 64} if pwm[0]["level"] else {382 * 64}
    # D5: timer 0, fast, clk/64: 256 x 64 cycles, of which 201 counts are high.
    fast = uno.edges("D5")[4:404]
    rises, falls = fast["cycle"][fast["level"] == 1], fast["cycle"][fast["level"] == 0]
    assert set(np.diff(rises).tolist()) == {256 * 64}
    assert {int(falls[falls > rise][0] - rise) for rise in rises[:-1]} == {201 * 64}
    # delay(100) goes by micros(); delayMicroseconds(50) is a counted loop, and digitalWrite takes some 3 us.
    first, second, third = uno.edges("D13")["cycle"][:3]
    assert (second - first) / 16e6 == pytest.approx(0.1, abs=20e-6)
    assert 50 * 16 <= third - second < 60 * 16


def test_interrupts_answer_every_edge(sketch):
    uno = sketch("interrupts")
    latencies = []
    for n in range(20):
        uno.pin("D2").drive(1)
        at = uno.cycle
        uno.run(cycles=5_000 + 7 * n)
        latencies.append(int(uno.edges("D13")[-1]["cycle"]) - at)
        uno.pin("D2").drive(0)
        uno.run(cycles=3_000)
    assert len(uno.edges("D13")) == 20
    assert ask(uno) == "20"
    # Synchroniser, four cycles of entry, the prologue of the core's handler, digitalRead and digitalWrite: 10 to 15 us.
    assert min(latencies) > 100
    assert max(latencies) < 400
    # Between two calls only the interrupted instruction differs, or the interrupt of timer 0 comes first.
    assert sorted(latencies)[14] - min(latencies) <= 3


def test_analog_read_is_the_voltage(sketch):
    uno = sketch("voltages")
    for a0, a5 in ((0.0, 5.0), (2.5, 1.0), (4.99, 0.004)):
        uno.analog("A0").volts, uno.analog("A5").volts = a0, a5
        # ADC = V x 1024 / Vref (datasheet, 24.7), at most 1023; the reference is the supply's 5 V.
        assert ask(uno) == " ".join(str(min(1023, int(volts * 1024 / 5))) for volts in (a0, a5))


def test_eeprom_example_writes_what_it_reads(sketch):
    uno = sketch(LIBRARIES / "EEPROM/examples/eeprom_write/eeprom_write.ino", "EEPROM", setup_s=0.0)
    written = []
    for volts in (1.0, 2.0, 3.0, 4.0):
        uno.analog("A0").volts = volts
        uno.run(
            seconds=0.1002 if written else 0.05
        )  # it reads every 100.1 ms: analogRead, the write's start, delay(100)
        written.append(int(volts * 1024 / 5) // 4)
    assert uno._chip.eeprom[:5].tolist() == [*written, 0xFF]
    uno.reset()
    assert uno._chip.eeprom[:4].tolist() == written, "it stays over a reset"


def test_software_serial_example_talks_on_its_pins(sketch):
    example = LIBRARIES / "SoftwareSerial/examples/SoftwareSerialExample/SoftwareSerialExample.ino"
    uno = sketch(example, "SoftwareSerial", baud=57_600, usb="16u2", setup_s=0.0)
    uno.pin("D10").drive(1)  # the other end's line is idle
    uno.run(seconds=0.1)
    assert uno.serial.read() == b"Goodnight moon!\r\n"
    bit = 16e6 / 4800
    assert decoded(uno.edges("D11"), bit) == b"Hello, world?\r\n"
    start = uno.cycle
    for n, byte in enumerate(b"ok?"):
        for place, level in enumerate([0, *((byte >> bit_number) & 1 for bit_number in range(8)), 1]):
            uno._chip.drive_pin(pin_place("D10").index, level, start + round((10 * n + place + 1) * bit))
    uno.run(seconds=0.02)
    assert uno.serial.read() == b"ok?"
    uno.clear_edges()
    uno.serial.write(b"!")
    uno.run(seconds=0.01)
    assert decoded(uno.edges("D11"), bit) == b"!"


def decoded(edges, bit):
    """Take the frames of a serial line apart, by its level in the middle of each bit."""
    cycles, levels = edges["cycle"], edges["level"]
    falls = [int(cycle) for cycle, level in edges if level == 0]
    result, free_from = bytearray(), 0
    for start in falls:
        if start < free_from:
            continue
        samples = [int(levels[np.searchsorted(cycles, start + (n + 0.5) * bit, side="right") - 1]) for n in range(10)]
        assert (samples[0], samples[9]) == (0, 1)
        result.append(sum(level << n for n, level in enumerate(samples[1:9])))
        free_from = start + 9.5 * bit
    return bytes(result)


@pytest.mark.parametrize(("source", "libraries"), [("servo_by_timer", ()), ("servo", ("Servo",))])
def test_servos_get_their_pulses(sketch, source, libraries):
    """By Arduino's library where it is installed, and by a sketch of our own that drives timer 1 as that does."""
    uno = sketch(source, *libraries, setup_s=0.5)
    # Servo.h: write(90) is the middle of 544 to 2400 us, frames of 20 ms; its timer counts half microseconds.
    for pin, width_us in (("D9", (544 + 2400) / 2), ("D10", 1000)):
        edges = uno.edges(pin)[2:]
        rises, falls = edges["cycle"][edges["level"] == 1], edges["cycle"][edges["level"] == 0]
        widths = np.array([falls[falls > rise][0] - rise for rise in rises[:-1]]) / 16
        assert np.all(np.abs(widths - width_us) < 10)
        assert np.mean(np.diff(rises)) / MS == pytest.approx(20, abs=0.1)
    uno.clear_edges()
    uno.serial.write(bytes([0]))
    uno.run(seconds=0.1)
    edges = uno.edges("D9")[2:]
    assert edges[1]["cycle"] - edges[0]["cycle"] == pytest.approx(544 * 16, abs=160)
