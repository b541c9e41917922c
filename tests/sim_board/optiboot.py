"""Optiboot, the Uno's boot loader, built from the sources in Debian's package arduino-core-avr.

The image in that package does not fit: its compiler made 532 bytes of it, and the Uno's boot section has 512. The
options below bring the same source down to what fits; test_sim_bootloader.py tells what can be done with the image.
"""

import shutil
import subprocess
from pathlib import Path

import pytest

SOURCES = Path("/usr/share/arduino/hardware/arduino/avr/bootloaders/optiboot")
START, VERSION = 0x7E00, 0x7FFE
OPTIONS = (
    *("-Os", "-mmcu=atmega328p", "-mshort-calls", "-DF_CPU=16000000L", "-DLED_START_FLASHES=3", "-DBAUD_RATE=115200"),
    *("-fno-inline-small-functions", "-fno-split-wide-types", "-fno-move-loop-invariants", "-fno-tree-scev-cprop"),
    *("-fno-ivopts", "-fwhole-program", "-nostartfiles", "-w", "-Wl,--relax"),
)


def build_optiboot(folder: Path) -> Path:
    """Build it in `folder` and return the Intel HEX file; skips where compiler or sources are missing."""
    if shutil.which("avr-gcc") is None:
        pytest.skip("avr-gcc is not installed; it builds the boot loader (Debian: gcc-avr, avr-libc)")
    if not (SOURCES / "optiboot.c").exists():
        pytest.skip(f"{SOURCES} is missing; it has the boot loader's sources (Debian: arduino-core-avr)")
    elf, image = folder / "optiboot.elf", folder / "optiboot.hex"
    places = [f"-Wl,--section-start=.text={START:#x}", f"-Wl,--section-start=.version={VERSION:#x}"]
    subprocess.run(["avr-gcc", *OPTIONS, *places, "-o", elf, SOURCES / "optiboot.c"], check=True, timeout=60)
    sections = ["-j", ".text", "-j", ".data", "-j", ".version", "--set-section-flags", ".version=alloc,load"]
    subprocess.run(["avr-objcopy", *sections, "-O", "ihex", elf, image], check=True, timeout=60)
    return image
