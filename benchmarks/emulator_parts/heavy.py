"""The interrupt-heavy image (interrupt_heavy.c), on planarm_sim and on simavr, with the same bytes on the line."""

import shutil
import subprocess
from pathlib import Path
from time import process_time

from planarm_sim import Uno

HERE = Path(__file__).parent
BAUD, CLOCK_HZ = 115_200, 16_000_000
BYTE_CYCLES = 10 * CLOCK_HZ / BAUD
AVR_GCC = ("avr-gcc", "-mmcu=atmega328p", "-DF_CPU=16000000UL", "-O2", "-std=c99")


class MissingToolError(Exception):
    """A tool that this part of the benchmark needs is not there."""


def build_image(folder: Path, *, busy: bool) -> Path:
    """Compile interrupt_heavy.c; returns the ELF's path, with a .bin and a .hex beside it."""
    if shutil.which("avr-gcc") is None:
        raise MissingToolError("avr-gcc is not installed")
    elf = folder / f"heavy{int(busy)}.elf"
    source = HERE / "interrupt_heavy.c"
    subprocess.run([*AVR_GCC, f"-DBUSY={int(busy)}", "-o", str(elf), str(source)], check=True)
    for form, suffix in (("binary", ".bin"), ("ihex", ".hex")):
        subprocess.run(["avr-objcopy", "-O", form, str(elf), str(elf.with_suffix(suffix))], check=True)
    return elf


def build_driver(folder: Path) -> Path:
    """Compile simavr_driver.c against the machine's libsimavr."""
    driver = folder / "simavr_driver"
    command = [
        "gcc",
        "-O2",
        "-I/usr/include/simavr",
        str(HERE / "simavr_driver.c"),
        "-o",
        str(driver),
        "-lsimavr",
        "-lelf",
    ]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    if built.returncode:
        raise MissingToolError("libsimavr-dev is not installed")
    return driver


def fed_board(image: Path, seconds: float) -> Uno:
    """Return a board whose serial line is busy for so many seconds."""
    uno = Uno.from_hex(image.with_suffix(".hex"), baud=BAUD)
    uno.serial.write(bytes(n & 0xFF for n in range(int(seconds * BAUD / 10))))
    return uno


def ours_cpu_s(image: Path, seconds: float) -> tuple[float, int, int]:
    """Run for so many emulated seconds; return CPU seconds, bytes sent, and edges of PB0 (D8)."""
    uno = fed_board(image, seconds)
    began_s = process_time()
    uno.run(seconds=seconds)
    took_s = process_time() - began_s
    return took_s, len(uno.serial.read()), len(uno.edges("D8"))


def simavr_cpu_s(driver: Path, image: Path, seconds: float) -> tuple[float, int, int]:
    """The same on simavr."""
    words = [image.with_suffix(".bin"), int(seconds * CLOCK_HZ), BYTE_CYCLES, int(seconds * BAUD / 10)]
    ran = subprocess.run([driver, *map(str, words)], capture_output=True, text=True, check=True)
    took_s, sent, edges = ran.stdout.split()
    return float(took_s), int(sent), int(edges)
