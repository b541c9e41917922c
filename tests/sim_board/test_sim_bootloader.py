"""A Uno with its boot loader: resets, uploads, and the sketch afterwards."""

import shutil
import subprocess
import threading
from pathlib import Path

import pytest

from planarm_sim import Uno
from planarm_sim.__main__ import main
from planarm_sim.bridge import WallClock
from planarm_sim.bridge.pty_line import PtyLine
from planarm_sim.emulate import Stop, run_board
from planarm_sim.errors import ImageError, UsageError
from planarm_sim.loader import Image, join_bootloader, load_hex
from sim_board.optiboot import SOURCES, build_optiboot
from sim_chip.avr_assembler import assemble

DATA = Path(__file__).parent / "data"
FLASH = 32 * 1024
LONG_S = 60.0  # a bound for what takes a second or two
PAGE = 128
IN_SYNC, OK, END = 0x14, 0x10, 0x20  # the answers and the end of commands of STK500's protocol


def image(start=0, data=b"", source="a.hex"):
    return Image(bytes([0xFF]) * start + data + bytes([0xFF]) * (FLASH - start - len(data)), len(data), source)


@pytest.fixture(scope="session")
def optiboot(tmp_path_factory):
    return build_optiboot(tmp_path_factory.mktemp("optiboot"))


# --- One flash from two images ---


@pytest.mark.parametrize(
    ("start", "section"), [(0x7FFE, 512), (0x7E00, 512), (0x7DFF, 1024), (0x7C00, 1024), (0x7800, 2048), (0x7000, 4096)]
)
def test_the_boot_section_is_the_smallest_that_holds_the_boot_loader(start, section):
    boot = join_bootloader(image(0, b"\1\2"), image(start, b"\3\4", "b.hex"))
    assert boot.section_bytes == section
    assert boot.image.flash == b"\1\2" + bytes([0xFF]) * (start - 2) + b"\3\4" + bytes([0xFF]) * (FLASH - start - 2)
    assert boot.image.used_bytes == 4


def test_what_is_no_boot_loader_and_what_lies_on_it_is_refused():
    with pytest.raises(ImageError, match=r"b\.hex: starts at 0x6FFF"):
        join_bootloader(None, image(0x6FFF, b"\1", "b.hex"))
    with pytest.raises(ImageError, match=r"a\.hex: ends at 0x7E00, in the boot section, which b\.hex"):
        join_bootloader(image(0x7E00, b"\1"), image(0x7E10, b"\1", "b.hex"))
    with pytest.raises(UsageError, match="neither program nor boot loader"):
        Uno(None)


def test_resets_lead_to_the_boot_loader():
    # The boot loader raises D13 and jumps to the sketch, which raises D12.
    boot = assemble(".org 0x3F00\nsbi 4, 5\nsbi 5, 5\njmp 0")
    sketch = assemble("sbi 4, 4\nsbi 5, 4\nloop: rjmp loop")
    uno = Uno(image(0, sketch), bootloader=image(0x7E00, boot[0x7E00:]))
    for _ in range(2):
        uno.run(cycles=20)
        assert (uno.pin("D13").level, uno.pin("D12").level) == (1, 1)
        uno.reset()
        assert (uno.pin("D13").level, uno.pin("D12").level) == (0, 0)
    assert Uno(image(0, sketch)).flash[0x7E00:] == bytes([0xFF]) * 512


# --- Optiboot, in emulated time ---


def test_power_up_starts_the_sketch_and_a_reset_the_boot_loader(optiboot):
    # Optiboot goes on at once unless the reset was external. Else it flashes the LED three times, listens, and is
    # ended by the watchdog's 1 s.
    uno = Uno.from_hex(DATA / "pulses.hex", bootloader=optiboot)
    uno.run(seconds=0.01)
    assert uno.edges("D9")[0]["cycle"] < 1000
    assert len(uno.edges("D13")) == 0
    uno.reset()
    uno.clear_edges()
    reset_cycle = uno.cycle
    uno.run(seconds=1.6)
    assert int(uno.edges("D13")["level"].sum()) == 3
    assert 1.3 < (uno.edges("D9")[0]["cycle"] - reset_cycle) / 16e6 < 1.5


def test_the_sketch_finds_no_reset_cause(optiboot):
    # DDRB = 0x3F; PORTB = MCUSR with bits 0 to 3 turned over: D8 to D11 tell which bits of MCUSR are clear.
    sketch = "ldi r16, 0x3F\nout 4, r16\nin r16, 0x34\nldi r17, 15\neor r16, r17\nout 5, r16\nloop: rjmp loop"
    uno = Uno(image(0, assemble(sketch)), bootloader=load_hex(optiboot))
    for seconds in (0.01, 1.6):
        uno.run(seconds=seconds)
        assert [uno.pin(f"D{number}").level for number in (8, 9, 10, 11)] == [1, 1, 1, 1]
        uno.reset()
    bare = Uno(image(0, assemble(sketch)))
    bare.run(seconds=0.01)
    assert bare.pin("D8").level == 0, "without a boot loader PORF is there"


def command(uno, data, answer_bytes=0):
    """Send a command of STK500's protocol and return the answer between its two marks."""
    uno.serial.write(bytes([*data, END]))
    uno.run_until(lambda uno: len(uno.serial.peek()) >= answer_bytes + 2, limit_s=0.5)
    answer = uno.serial.read()
    assert (answer[0], answer[-1], len(answer)) == (IN_SYNC, OK, answer_bytes + 2)
    return answer[1:-1]


def test_an_upload_into_an_empty_chip(optiboot):
    sketch = load_hex(DATA / "echo.hex").flash[: 2 * PAGE]
    uno = Uno.from_bootloader(optiboot, baud=115_200)
    uno.run(seconds=0.05)  # the empty chip goes round
    uno.reset()
    uno.run(seconds=0.4)
    command(uno, b"0")
    assert command(uno, b"u", 3) == bytes([0x1E, 0x95, 0x0F]), "an ATmega328P"
    before = uno.snapshot()
    for page in range(2):
        command(uno, [ord("U"), page * PAGE // 2, 0])
        command(uno, [ord("d"), 0, PAGE, ord("F"), *sketch[page * PAGE : (page + 1) * PAGE]])
        command(uno, [ord("U"), page * PAGE // 2, 0])
        assert command(uno, [ord("t"), 0, PAGE, ord("F")], PAGE) == sketch[page * PAGE : (page + 1) * PAGE]
    assert uno.flash[: 2 * PAGE] == sketch
    assert uno.flash[0x7E00:] == load_hex(optiboot).flash[0x7E00:]
    assert uno.warnings == ()
    command(uno, b"Q")  # leave
    uno.run(seconds=0.1)
    assert uno.serial.read() != b"", "the sketch has greeted, at its own rate"
    uno.restore(before)
    assert uno.flash[: 2 * PAGE] == bytes([0xFF]) * 2 * PAGE


# --- Optiboot and avrdude, by the clock ---


def test_avrdude_uploads_a_sketch_which_then_runs(optiboot):
    if shutil.which("avrdude") is None:
        pytest.skip("avrdude is not installed; it does the upload")
    sketch = DATA / "pulses.hex"
    uno = Uno.from_bootloader(optiboot, baud=115_200)
    uno.run(cycles=1)
    clock, stop, runs = WallClock(), Stop(), threading.Event()
    results = []

    class WatchedUno(PtyLine):
        """Looks, whenever the board waits, whether the sketch has begun."""

        def wait(self, timeout_s, *, for_bytes):
            if uno.pin("D9").level:
                runs.set()
            super().wait(timeout_s, for_bytes=for_bytes)

    with WatchedUno() as line:
        board = threading.Thread(target=lambda: results.append(run_board(uno, line, clock, stop, say=[].append)))
        board.start()
        try:
            to = ["-c", "arduino", "-p", "m328p", "-b", "115200", "-P", line.path]
            upload = subprocess.run(
                ["avrdude", *to, "-U", f"flash:w:{sketch}"], capture_output=True, text=True, timeout=LONG_S, check=False
            )
            assert upload.returncode == 0, upload.stderr
            assert "38 bytes of flash verified" in upload.stderr
            assert runs.wait(LONG_S)
        finally:
            stop()
            board.join(LONG_S)
    assert uno.flash[:38] == load_hex(sketch).flash[:38]
    assert not results[0].program_failed
    assert results[0].rising_edges["D9"] > 0


def test_front_end_takes_a_boot_loader_with_and_without_a_program(optiboot, capsys):
    run = ["--bootloader", str(optiboot), "--seconds", "0.01", "--speed", "max"]
    assert main([str(DATA / "pulses.hex"), *run]) == 0
    assert "D9 1" in capsys.readouterr().out
    assert main(run) == 0
    assert "rising edges: none" in capsys.readouterr().out


def test_front_end_wants_something_to_run(capsys):
    assert main(["--seconds", "0.01"]) == 2
    assert "neither program nor boot loader" in capsys.readouterr().err


def test_debians_image_does_not_fit_the_flash():
    packed = SOURCES / "optiboot_atmega328.hex"
    if not packed.exists():
        pytest.skip(f"{packed} is missing (Debian: arduino-core-avr)")
    if ":10800000" not in packed.read_text():
        pytest.skip(f"{packed} ends within the flash")
    with pytest.raises(ImageError, match="0x8000 to 0x800F do not fit"):
        Uno.from_bootloader(packed)
