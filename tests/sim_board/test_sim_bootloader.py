"""A Uno with its boot loader: resets, uploads, and the sketch afterwards."""

import contextlib
import re
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
from planarm_sim.errors import ImageError, StoppedError, UsageError
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


@contextlib.contextmanager
def board_behind_a_terminal(uno):
    """Run a board in real time; gives its terminal's path, an event that D9 has risen, and the results' list."""
    uno.run(cycles=1)
    stop, runs, results = Stop(), threading.Event(), []

    class WatchedLine(PtyLine):
        """Looks, whenever the board waits, whether the sketch has begun."""

        def wait(self, timeout_s, *, for_bytes):
            if uno.pin("D9").level:
                runs.set()
            return super().wait(timeout_s, for_bytes=for_bytes)

    with WatchedLine(baud=9_600) as line:
        run = lambda: results.append(run_board(uno, line, WallClock(), stop, follow_baud=True, say=[].append))  # noqa: E731
        board = threading.Thread(target=run)
        board.start()
        try:
            yield line.path, runs, results
        finally:
            stop()
            board.join(LONG_S)


def avrdude(path, *operation):
    if shutil.which("avrdude") is None:
        pytest.skip("avrdude is not installed; it does the upload")
    to = ["-c", "arduino", "-p", "m328p", "-b", "115200", "-P", path]
    return subprocess.run(["avrdude", *to, *operation], capture_output=True, text=True, timeout=LONG_S, check=False)


@pytest.mark.parametrize("kind", ["rebuilt", "Debian's, moved"])
def test_avrdude_uploads_a_sketch_which_then_runs(optiboot, moved, kind):
    sketch = DATA / "pulses.hex"
    uno = Uno.from_bootloader(optiboot if kind == "rebuilt" else moved, usb="16u2")
    with board_behind_a_terminal(uno) as (path, runs, results):
        upload = avrdude(path, "-U", f"flash:w:{sketch}")
        assert upload.returncode == 0, upload.stderr
        assert "38 bytes of flash verified" in upload.stderr
        assert runs.wait(LONG_S)
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


# --- The image in Debian's package ---
#
# Debian builds optiboot_atmega328.hex with a newer compiler than Arduino did: 532 bytes from 0x7E00 on, 20 more than
# the Uno's boot section (hfuse 0xDE) has, and than the flash has from that address on. Its last function, which starts
# the sketch, lies at 0x8004, and the version number at 0x7FFE lies on an instruction. No fuse makes room behind the end
# of the flash. The code itself is sound and does not mind where it stands: moved down by 512 bytes, into the boot
# section of 1 KiB (hfuse 0xDC), it runs.

PACKED = SOURCES / "optiboot_atmega328.hex"


@pytest.fixture(scope="session")
def packed():
    if not PACKED.exists():
        pytest.skip(f"{PACKED} is missing (Debian: arduino-core-avr)")
    if ":10800000" not in PACKED.read_text():
        pytest.skip(f"{PACKED} ends within the flash: another compiler made it")
    return PACKED


@pytest.fixture(scope="session")
def moved(packed, tmp_path_factory):
    """The same code 512 bytes lower, as docs/emulator.md has it; .sec1 is the code, .sec2 the version number."""
    if shutil.which("avr-objcopy") is None:
        pytest.skip("avr-objcopy is not installed (Debian: binutils-avr)")
    image = tmp_path_factory.mktemp("moved") / "optiboot_1k.hex"
    move = ["-I", "ihex", "-O", "ihex", "--change-section-address", ".sec1-0x200"]
    subprocess.run(["avr-objcopy", *move, packed, image], check=True, timeout=60)
    return image


def bytes_of(path):
    """Addresses and bytes of an Intel HEX file in the order of its data records, whatever they are."""
    lines = [bytes.fromhex(line[1:]) for line in path.read_text().split()]
    return [
        (int.from_bytes(line[1:3], "big") + n, byte)
        for line in lines
        if line[3] == 0
        for n, byte in enumerate(line[4:-1])
    ]


def test_debians_image_runs_past_the_flash_and_over_itself(packed):
    given = bytes_of(packed)
    assert min(address for address, _ in given) == 0x7E00
    assert max(address for address, _ in given) == 0x7E00 + 532 - 1 > FLASH
    twice = {address for n, (address, _) in enumerate(given) if address in dict(given[:n])}
    assert twice == {0x7FFE, 0x7FFF}, "the version number lies on an instruction"
    with pytest.raises(ImageError, match=r"line \d+: bytes 0x8000 to 0x800F do not fit the flash"):
        Uno.from_bootloader(packed)


def test_avrdude_does_not_write_it_either(optiboot, packed):
    with board_behind_a_terminal(Uno.from_bootloader(optiboot)) as (path, _, _):
        refused = avrdude(path, "-U", f"flash:w:{packed}")
    assert refused.returncode != 0
    assert re.search(r"address 0x8010 out of range", refused.stderr), refused.stderr


def test_a_chip_that_took_what_fits_of_it_never_starts_a_sketch(packed):
    # A programmer that drops the addresses' top bit would put the tail where the sketch's vectors belong; one that
    # drops the tail leaves a boot loader whose last jump leads round to word 2, into the sketch's vector table.
    flash = bytearray([0xFF]) * FLASH
    for address, byte in bytes_of(packed):
        if address < FLASH:
            flash[address] = byte
    sketch = load_hex(DATA / "pulses.hex")
    uno = Uno(sketch, bootloader=Image(bytes(flash), 512, "cut.hex"))
    uno.reset()
    with contextlib.suppress(StoppedError):
        uno.run(seconds=2.5)
    assert len(uno.edges("D9")) == 0
    assert int(uno.edges("D13")["level"].sum()) == 3, "it flashes and listens; a whole one starts the sketch in 1.5 s"


def test_moved_into_the_next_boot_section_it_runs(moved):
    uno = Uno.from_hex(DATA / "pulses.hex", bootloader=moved)
    uno.reset()
    uno.run(seconds=1.6)
    assert int(uno.edges("D13")["level"].sum()) == 3
    assert 1.3 < uno.edges("D9")[0]["cycle"] / 16e6 < 1.5
