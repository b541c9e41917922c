"""Builds the firmware, directly and through PlatformIO, and keeps the released image.

    python firmware/build.py avr        hex and elf by avr-gcc, of every board of core/boards
    python firmware/build.py pio        the same through `pio run`, without PlatformIO's registry
    python firmware/build.py native     the core as a shared library for this computer, for tests [--board NAME]
    python firmware/build.py test       the core's own tests through `pio test`, sanitizers on
    python firmware/build.py fuzz       libFuzzer's target, by clang: OUT/fuzz_line [CORPUS] [-runs=N]; [--board NAME]
    python firmware/build.py release    writes release/BOARD.hex and release/BOARD.json of every board
    python firmware/build.py check      proves that both builds equal release/*.hex, byte for byte

Sources and flags are those of platformio.ini, in PlatformIO's order, so that both builds agree. Nothing in an image
depends on the time or the place of its build. Needs the standard library only; exits 1 with the reason on failure.
"""

from __future__ import annotations

import argparse
import configparser
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

FIRMWARE = Path(__file__).resolve().parent
BOARDS = tuple(sorted(path.name for path in (FIRMWARE / "core" / "boards").iterdir()))
RELEASE = FIRMWARE / "release"
BUILD = FIRMWARE / "build"

# What PlatformIO's platform adds to the flags of platformio.ini.
PLATFORM_COMPILE = ("-mmcu=atmega328p", "-DF_CPU=16000000L")
PLATFORM_LINK = ("-mmcu=atmega328p",)

PIO_TIMEOUT_S = 50  # a package that is missing is asked for over and over; the store below has them all
NATIVE_FLAGS = ("-O1", "-g", "-fPIC", "-fno-sanitize-recover=all")
FUZZ_FLAGS = ("-Wno-sign-conversion", "-O1", "-g", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all")


class BuildError(Exception):
    """A build step failed; the message says which and why."""


@dataclass(frozen=True, slots=True)
class Release:
    """What release/BOARD.json tells of release/BOARD.hex."""

    sha256: str
    flash_bytes: int
    sram_bytes: int
    compiler: str
    spec_hash: str


def run(command: list[str], timeout_s: float | None = None, **environment: str) -> str:
    """Run a command in the firmware folder and return its output. Raises BuildError with its words if it fails."""
    try:
        done = subprocess.run(
            command,
            cwd=FIRMWARE,
            env=os.environ | environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=timeout_s,
            check=False,
        )
    except FileNotFoundError as error:
        raise BuildError(f"{command[0]} is not installed or not on PATH") from error
    except subprocess.TimeoutExpired as error:
        raise BuildError(f"{' '.join(command)}: no end after {timeout_s:.0f} s") from error
    if done.returncode != 0:
        raise BuildError(f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout}")
    return done.stdout


def read_settings(environment: str) -> tuple[list[str], list[Path]]:
    """Return the build flags and the sources, in link order, of one environment of platformio.ini."""
    ini = configparser.ConfigParser(interpolation=None)
    ini.read(FIRMWARE / "platformio.ini", encoding="utf-8")

    def option(section: str, name: str) -> str:
        return re.sub(r"\$\{(\w+)\.(\w+)\}", lambda found: option(found[1], found[2]), ini[section][name])

    flags = option(f"env:{environment}", "build_flags")
    patterns = re.findall(r"\+<([^>]+)>", option(f"env:{environment}", "build_src_filter"))
    sources = sorted(path.relative_to(FIRMWARE) for pattern in patterns for path in FIRMWARE.glob(pattern))
    return " ".join(flags.splitlines()).replace("-I ", "-I").split(), sources


def code_start(elf: Path) -> str:
    """The address, as the tools take it, where the code begins: the vectors and the tables in flash lie before it."""
    found = re.search(r"^([0-9a-f]+) \w __ctors_end$", run(["avr-nm", str(elf)]), re.M)
    if found is None:
        raise BuildError(f"{elf}: no __ctors_end, where the code begins")
    return f"0x{found.group(1)}"


def require_free_registers(elf: Path, flags: list[str]) -> None:
    """Raise BuildError if any code but the interrupts uses a register that `flags` keep for them (-ffixed-rN).

    The flags bind our own compiler only; the libraries of the compiler are linked as they are. Nor may the interrupts,
    which save none of r2 to r15, use one of these that is not kept for them.
    """
    kept = {int(flag.removeprefix("-ffixed-r")) for flag in flags if flag.startswith("-ffixed-r")}
    lent = set(range(2, 16)) - kept
    listing = run(["avr-objdump", "-d", "--no-show-raw-insn", f"--start-address={code_start(elf)}", str(elf)])
    for function in listing.split("\n\n"):
        title, *lines = function.splitlines() or [""]
        name = title.partition("<")[2].rstrip(">:")
        is_interrupt = re.fullmatch(
            r"__vector_(4|6|7|8|11|12|13|16|18|19)|missed_step|_ZN3hal\d+(set_)?step_fraction\w+", name
        )
        barred, whose = (lent, "the compiler") if is_interrupt else (kept, "the interrupts")
        for line in lines:
            address, _, instruction = line.partition(":\t")
            used = {int(number) for number in re.findall(r"\br(\d+)\b", instruction.split(";", 1)[0])}
            if used & barred:
                raise BuildError(f"{elf}: {name} {address.strip()}: {instruction!r} uses a register of {whose}")


def build_avr(out: Path) -> Path:
    """Build BOARD.elf and BOARD.hex of every board in `out` by avr-gcc; return the folder."""
    for board in BOARDS:
        build_image(out, board)
    return out


def build_image(out: Path, board: str) -> Path:
    """Build BOARD.elf and BOARD.hex in `out` by avr-gcc; return the hex. Reserved registers are checked."""
    flags, sources = read_settings(board)
    compile_flags = [flag for flag in flags if not flag.startswith("-Wl,")]
    link_flags = [flag for flag in flags if flag.startswith("-Wl,")]
    objects = []
    for source in sources:
        target = out / board / source.with_suffix(".o")
        target.parent.mkdir(parents=True, exist_ok=True)
        run(["avr-g++", "-c", *PLATFORM_COMPILE, *compile_flags, "-o", str(target), str(source)])
        objects.append(str(target))
    elf, image = out / f"{board}.elf", out / f"{board}.hex"
    run(["avr-g++", *PLATFORM_LINK, *link_flags, f"-Wl,-Map={out / board}.map", "-o", str(elf), *objects])
    require_free_registers(elf, flags)
    run(["avr-objcopy", "-O", "ihex", "-R", ".eeprom", str(elf), str(image)])
    return image


def find_pio() -> str:
    """Return PlatformIO's program: beside this Python, or on PATH."""
    beside = Path(sys.executable).with_name("pio")
    found = str(beside) if beside.exists() else shutil.which("pio")
    if found is None:
        raise BuildError("pio is not installed: pip install platformio==6.2.0 scons==4.11.1")
    return found


def run_pio(out: Path, *arguments: str) -> str:
    """Run PlatformIO on this project, with the stand-in store of offline/ for its registry; it writes to `out`."""
    offline = FIRMWARE / "offline"
    return run(
        [find_pio(), *arguments, "-d", str(FIRMWARE)],
        timeout_s=PIO_TIMEOUT_S,
        PLATFORMIO_CORE_DIR=str(out / "pio-core"),
        PLATFORMIO_WORKSPACE_DIR=str(out / "pio"),
        PLATFORMIO_PLATFORMS_DIR=str(offline / "platforms"),
        PLATFORMIO_PACKAGES_DIR=str(offline / "packages"),
        PLATFORMIO_SETTING_ENABLE_TELEMETRY="No",
        PLATFORMIO_DISABLE_UPGRADE_CHECK="true",
        PYTHONDONTWRITEBYTECODE="1",
    )


def build_pio(out: Path) -> Path:
    """Build every board's image with `pio run`; return the folder that has one for each."""
    run_pio(out, "run", *(word for board in BOARDS for word in ("-e", board)))
    return out / "pio" / "build"


def test_pio(out: Path) -> str:
    """Run the core's own tests with `pio test`; return what they said."""
    return run_pio(out, "test", "-e", "native")


def read_native(board: str) -> tuple[list[str], list[Path]]:
    """Flags without optimising, debugging and sanitizers, and sources, of a board's core on this computer."""
    flags, sources = read_settings("native")
    kept = [flag for flag in flags if not flag.startswith(("-fsanitize", "-fno-sanitize", "-O", "-g"))]
    return [f"-Icore/boards/{board}" if flag == "-Icore/boards/uno" else flag for flag in kept], sources


def build_native(out: Path, board: str = "uno", sanitizers: str = "undefined") -> Path:
    """Build a board's core with its hardware layer for this computer as a shared library; return it.

    With `address` among the sanitizers a process must have loaded libasan first (LD_PRELOAD).
    """
    flags, sources = read_native(board)
    out.mkdir(parents=True, exist_ok=True)
    library = out / "libplanarm_firmware.so"
    run(["g++", "-shared", *flags, *NATIVE_FLAGS, f"-fsanitize={sanitizers}", "-o", str(library), *map(str, sources)])
    return library


def build_fuzz(out: Path, board: str = "uno") -> Path:
    """Build libFuzzer's target for the frame receiver, the dispatcher and what they lead to; return the program."""
    flags, sources = read_native(board)
    out.mkdir(parents=True, exist_ok=True)
    program = out / "fuzz_line"
    run(["clang++", *flags, *FUZZ_FLAGS, "-o", str(program), "fuzz/fuzz_line.cpp", *map(str, sources)])
    return program


def compiler_version() -> str:
    """Return avr-gcc's first line, such as `avr-gcc (GCC) 5.4.0`."""
    return run(["avr-gcc", "--version"]).splitlines()[0]


def describe(image: Path) -> Release:
    """Measure a freshly built image whose elf lies beside it."""
    sections = re.findall(r"^\.(\w+)\s+(\d+)\s", run(["avr-size", "-A", str(image.with_suffix(".elf"))]), re.M)
    size = {name: int(count) for name, count in sections}
    header = (FIRMWARE / "core" / "messages.h").read_text(encoding="utf-8")
    spec_hash = re.search(r"SPEC_HASH = 0x([0-9A-F]+)", header)
    if spec_hash is None:
        raise BuildError("core/messages.h: no SPEC_HASH; run python -m planarm_wire.generate")
    return Release(
        sha256=hashlib.sha256(image.read_bytes()).hexdigest(),
        flash_bytes=size["text"] + size["data"],
        sram_bytes=size["data"] + size["bss"] + size.get("noinit", 0),
        compiler=compiler_version(),
        spec_hash=spec_hash.group(1).lower(),
    )


def release(out: Path) -> Path:
    """Build and write the released images with their descriptions; return their folder."""
    RELEASE.mkdir(exist_ok=True)
    for board in BOARDS:
        image = build_image(out, board)
        (RELEASE / f"{board}.hex").write_bytes(image.read_bytes())
        told = json.dumps(asdict(describe(image)), indent=2) + "\n"
        (RELEASE / f"{board}.json").write_text(told, encoding="utf-8")
    return RELEASE


def require_released(image: Path, board: str, how: str) -> None:
    """Raise BuildError unless an image equals the released one."""
    released = RELEASE / f"{board}.hex"
    if image.read_bytes() == released.read_bytes():
        return
    told = json.loads(released.with_suffix(".json").read_text(encoding="utf-8"))["compiler"]
    here = compiler_version()
    reason = (
        "the sources changed after the release: run firmware/build.py release"
        if told == here
        else f"the release was built with {told}, here is {here}"
    )
    raise BuildError(f"{how}: {image} differs from {released}; {reason}")


def check(out: Path) -> str:
    """Prove that both builds give the released images, and that their descriptions are true."""
    words = []
    for board in BOARDS:
        image = build_image(out, board)
        require_released(image, board, "avr-gcc")
        told = Release(**json.loads((RELEASE / f"{board}.json").read_text(encoding="utf-8")))
        if told != describe(image):
            raise BuildError(f"release/{board}.json: {told}, measured {describe(image)}; run firmware/build.py release")
        words.append(f"release/{board}.hex is what both builds give: {told}")
    built = build_pio(out)
    for board in BOARDS:
        require_released(built / board / "program.hex", board, "pio run")
    return "\n".join(words)


COMMANDS: dict[str, Callable[[Path], Path | str]] = {
    "avr": build_avr,
    "pio": build_pio,
    "test": test_pio,
    "release": release,
    "check": check,
}
FOR_THIS_COMPUTER: dict[str, Callable[[Path, str], Path]] = {"native": build_native, "fuzz": build_fuzz}


def main() -> int:
    """Carry out one command; return the exit code."""
    parser = argparse.ArgumentParser(description="Builds planarm's firmware.")
    parser.add_argument("command", choices=(*COMMANDS, *FOR_THIS_COMPUTER))
    parser.add_argument("--out", type=Path, default=BUILD, help="folder for everything that is built")
    parser.add_argument("--board", choices=BOARDS, default="uno", help="whose core native and fuzz build")
    arguments = parser.parse_args()
    out = arguments.out.resolve()
    try:
        if arguments.command in FOR_THIS_COMPUTER:
            result: Path | str = FOR_THIS_COMPUTER[arguments.command](out, arguments.board)
        else:
            result = COMMANDS[arguments.command](out)
    except BuildError as error:
        sys.stderr.write(f"firmware/build.py {arguments.command}: {error}\n")
        return 1
    sys.stdout.write(f"{result}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
