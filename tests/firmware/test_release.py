"""The released flash image is what the sources give, by avr-gcc and by PlatformIO, anywhere and at any time."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from firmware_board import LEAD_TICKS, Board, EmulatedFirmware, end_motion, run_of, segment_of
from firmware_stack import deepest_stack_bytes
from planarm_wire.messages import SPEC_HASH, Override, Segments, Start

FIRMWARE = Path(__file__).parents[2] / "firmware"
IMAGE = FIRMWARE / "release" / "uno.hex"
TOLD = json.loads((FIRMWARE / "release" / "uno.json").read_text(encoding="utf-8"))

needs_avr_gcc = pytest.mark.skipif(
    shutil.which("avr-gcc") is None, reason="avr-gcc is not installed (Debian: gcc-avr, avr-libc): no image is built"
)
needs_released_compiler = pytest.mark.skipif(
    shutil.which("avr-gcc") is not None
    and TOLD["compiler"]
    not in subprocess.run(["avr-gcc", "--version"], capture_output=True, text=True, check=True).stdout,
    reason=f"the image was released with {TOLD['compiler']}; another compiler gives other bytes",
)
needs_pio = pytest.mark.skipif(
    importlib.util.find_spec("platformio") is None or importlib.util.find_spec("SCons") is None,
    reason="platformio and scons are not installed: PlatformIO's build is not tried",
)
needs_gxx = pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed: no core for this computer")


def build(command: str, out: Path, firmware: Path = FIRMWARE) -> str:
    done = subprocess.run(
        [sys.executable, str(firmware / "build.py"), command, "--out", str(out)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def bytes_of(hex_file: Path) -> bytes:
    """The image of an Intel hex file without gaps, every record's sum checked."""
    image = bytearray()
    for line in hex_file.read_text(encoding="ascii").splitlines():
        record = bytes.fromhex(line.removeprefix(":"))
        assert sum(record) % 256 == 0
        if record[3] == 0:
            assert int.from_bytes(record[1:3], "big") == len(image)
            image += record[4 : 4 + record[0]]
    return bytes(image)


def test_description_is_true() -> None:
    assert hashlib.sha256(IMAGE.read_bytes()).hexdigest() == TOLD["sha256"]
    image = bytes_of(IMAGE)
    assert len(image) == TOLD["flash_bytes"]
    assert int(TOLD["spec_hash"], 16) == SPEC_HASH


@pytest.mark.parametrize("board", ["uno", "uno_slow", "cnc_shield", "uno_four", "cnc_shield_four"])
def test_images_take_at_most_16_kib(board: str) -> None:
    told = json.loads((FIRMWARE / "release" / f"{board}.json").read_text(encoding="utf-8"))
    assert told["flash_bytes"] <= 16_384  # docs/decisions/0095


@needs_avr_gcc
@pytest.mark.parametrize("board", ["uno", "uno_slow", "cnc_shield", "uno_four", "cnc_shield_four"])
def test_memory_and_the_deepest_stack_leave_a_quarter_of_a_kilobyte(
    builder: ModuleType, built_image: Callable[[str], Path], board: str
) -> None:
    image = built_image(board)
    stack, path = deepest_stack_bytes(image.with_suffix(".elf"))
    assert path[0] == "main" and path[-1].startswith("__vector_")
    assert stack >= 100
    assert builder.describe(image).sram_bytes + stack <= 2048 - 256


@needs_avr_gcc
def test_the_stack_of_a_motion_is_within_the_deepest_path(builder: ModuleType, uno_image: Path) -> None:
    # What the emulator saw of it, in a motion with a hold: the call tree tells no less.
    firmware = EmulatedFirmware(uno_image)
    firmware.uno.observe(keep_intervals=False)
    board = Board(firmware)
    board.get_ready()
    for segment in end_motion([segment_of(300_000, run_of(290, interval=1000))] * 4):
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 400_000)
    board.ask(Override(50))
    board.run(2_000_000)
    seen = firmware.uno.insight().deepest_stack_bytes
    assert 80 <= seen <= deepest_stack_bytes(uno_image.with_suffix(".elf"))[0]


@needs_avr_gcc
@needs_released_compiler
@needs_pio
def test_both_builds_give_the_released_image(tmp_path: Path) -> None:
    build("check", tmp_path)


@needs_avr_gcc
def test_the_place_of_the_build_does_not_matter(
    builder: ModuleType, built_image: Callable[[str], Path], tmp_path: Path
) -> None:
    copy = tmp_path / "elsewhere" / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", ".pio", "__pycache__"))
    build("avr", tmp_path, copy)
    for board in builder.BOARDS:
        assert (tmp_path / f"{board}.hex").read_bytes() == built_image(board).read_bytes()


@needs_avr_gcc
def test_a_program_that_uses_a_register_of_the_interrupts_is_refused(tmp_path: Path) -> None:
    # As a library function could, which the compiler's flags do not bind.
    copy = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", ".pio", "__pycache__"))
    clock = copy / "core" / "clock.cpp"
    source = clock.read_text(encoding="utf-8")
    spoilt = source.replace("at.stood_ticks = 0;", '__asm__ __volatile__("inc r7"); at.stood_ticks = 0;')
    assert spoilt != source
    clock.write_text(spoilt, encoding="utf-8")
    command = [sys.executable, str(copy / "build.py"), "avr", "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "uses a register of the interrupts" in done.stderr


@needs_avr_gcc
def test_an_interrupt_that_uses_a_register_of_the_compiler_is_refused(tmp_path: Path) -> None:
    # The fractions of the steps lie in r12 to r15 where the board's code says so; platformio.ini must say it, too.
    copy = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", ".pio", "__pycache__"))
    ini = copy / "platformio.ini"
    source = ini.read_text(encoding="utf-8")
    spoilt = source.replace("    -ffixed-r14\n", "")
    assert spoilt != source
    ini.write_text(spoilt, encoding="utf-8")
    command = [sys.executable, str(copy / "build.py"), "avr", "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "uses a register of the compiler" in done.stderr


@needs_avr_gcc
def test_the_librarys_common_prologue_is_refused(tmp_path: Path) -> None:
    # It saves the interrupts' registers: what it is jumped into from stands in image.ld and hal/uno/prologue.cpp.
    copy = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", ".pio", "__pycache__"))
    script = copy / "image.ld"
    source = script.read_text(encoding="utf-8")
    spoilt = re.sub(r"^  __(prologue_saves|epilogue_restores)__ = .*\n", "", source, flags=re.M)
    assert spoilt != source
    script.write_text(spoilt, encoding="utf-8")
    command = [sys.executable, str(copy / "build.py"), "avr", "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert re.search(r"__(prologue_saves|epilogue_restores)__ .* uses a register of the interrupts", done.stderr)


@needs_gxx
@needs_pio
def test_the_cores_own_tests(tmp_path: Path) -> None:
    said = build("test", tmp_path)
    assert "FAIL" not in said
    assert said.count("PASS ") >= 9
