"""Builds Arduino sketches with avr-gcc and the core in Debian's package arduino-core-avr, without Arduino's own tools.

A sketch is C++ with two lines before it and prototypes that the tests' sketches do without. Flags are those of the
core's platform.txt (recipe.cpp.o.pattern); the core is built once for each compiler and kept in a cache folder.
"""

import hashlib
import os
import shutil
import subprocess
from pathlib import Path

import pytest

HARDWARE = Path("/usr/share/arduino/hardware/arduino/avr")
CORE, VARIANT, LIBRARIES = HARDWARE / "cores/arduino", HARDWARE / "variants/standard", HARDWARE / "libraries"
USER_LIBRARIES = (Path.home() / "Arduino/libraries", Path("/usr/share/arduino/libraries"))
CORE_SOURCES = (
    *("hooks.c", "wiring.c", "wiring_analog.c", "wiring_digital.c", "WInterrupts.c", "HardwareSerial.cpp"),
    *(
        "HardwareSerial0.cpp",
        "main.cpp",
        "Print.cpp",
        "Stream.cpp",
        "Tone.cpp",
        "WMath.cpp",
        "WString.cpp",
        "new.cpp",
        "abi.cpp",
    ),
)
FLAGS = (
    *("-c", "-g", "-Os", "-w", "-ffunction-sections", "-fdata-sections", "-mmcu=atmega328p", "-DF_CPU=16000000L"),
    *("-DARDUINO=10819", "-DARDUINO_AVR_UNO", "-DARDUINO_ARCH_AVR", f"-I{CORE}", f"-I{VARIANT}"),
)
CPP = ("-std=gnu++11", "-fno-exceptions", "-fno-threadsafe-statics", "-fpermissive", "-DDECIMAL_DIG=__DECIMAL_DIG__")
"""The last for avr-gcc 5.4, whose float.h leaves it out in C++11."""


def _run(*command):
    subprocess.run([str(part) for part in command], check=True, timeout=120)


def _compile(source, target, *more):
    language = ("-x", "c++", "-include", "Arduino.h") if source.suffix == ".ino" else ()
    standard = () if source.suffix == ".c" else CPP
    _run("avr-gcc", *FLAGS, *standard, *more, *language, source, "-o", target)


def core_archive(cache: Path) -> Path:
    """The core's object files, built if `cache` does not hold them yet."""
    version = subprocess.run(["avr-gcc", "--version"], capture_output=True, check=True, timeout=60).stdout
    sources = b"".join((CORE / name).read_bytes() for name in CORE_SOURCES)
    archive = cache / f"core-{hashlib.sha256(version + sources + repr(FLAGS).encode()).hexdigest()[:16]}.a"
    if not archive.exists():
        work = cache / f"building-{os.getpid()}"
        work.mkdir(parents=True, exist_ok=True)
        objects = [work / f"{name}.o" for name in CORE_SOURCES]
        for name, target in zip(CORE_SOURCES, objects, strict=True):
            _compile(CORE / name, target)
        _run("avr-ar", "rcs", work / "core.a", *objects)
        (work / "core.a").replace(archive)  # at once, whoever else builds it
        shutil.rmtree(work)
    return archive


def find_library(name: str) -> Path:
    """Where a library's headers and sources are; skips where it is not installed."""
    for folder in (LIBRARIES, *USER_LIBRARIES):
        if (folder / name / "src").is_dir():
            return folder / name / "src"
    stand_in = " (Debian ships none); servo_by_timer.ino is tested in its place" if name == "Servo" else ""
    places = ", ".join(map(str, (LIBRARIES, *USER_LIBRARIES)))
    pytest.skip(f"the Arduino library {name} is not installed in {places}{stand_in}")


def build_sketch(sketch: Path, folder: Path, cache: Path, libraries: tuple[str, ...] = ()) -> Path:
    """Build a sketch in `folder`; returns the ELF file. Skips where compiler, core or a library is missing."""
    if shutil.which("avr-gcc") is None:
        pytest.skip("avr-gcc is not installed (Debian: gcc-avr, avr-libc)")
    if not CORE.is_dir():
        pytest.skip(f"{CORE} is missing (Debian: arduino-core-avr)")
    found = [find_library(name) for name in libraries]
    paths = [f"-I{place}" for place in found]
    sources = [sketch, *(s for place in found for s in [*place.glob("*.cpp"), *place.glob("avr/*.cpp")])]
    objects = [folder / f"{source.name}.o" for source in sources]
    for source, target in zip(sources, objects, strict=True):
        _compile(source, target, *paths)
    elf = folder / f"{sketch.stem}.elf"
    _run("avr-gcc", "-mmcu=atmega328p", "-Os", "-Wl,--gc-sections", "-o", elf, *objects, core_archive(cache), "-lm")
    return elf
