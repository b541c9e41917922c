"""Random programs, instruction by instruction, against the core of simavr.

simavr is an oracle for the instruction set only. Where the datasheet overrules simavr 1.6 stands in
simavr_differences.toml, and the random programs leave it out: no interrupt is raised, GPIOR0 to GPIOR2 and SREG are the
only I/O registers used, every word is a defined instruction with a defined result, no skip over certain ADIW and SBIW,
no jump over the end of the flash; nor SLEEP, BREAK, WDR and SPM, which act on the chip around the core.

A million instructions and more with `--full`, a slice of that otherwise.
"""

import ctypes
import shutil
import struct
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest

from planarm_sim.cpu.chip import Chip, Snapshot, StopCause
from sim_chip.avr_assembler import assemble, encode

WORDS, SRAM_BYTES, ROW = 16384, 2048, 36
SMALL, FULL = 2, 24
"""Random programs of a run; each yields 50,000 instructions or so."""
RUNS_PER_PROGRAM, STEPS = 1200, 64
LOWEST_TARGET = 0x100
GPIORS = (0x1E, 0x2A, 0x2B)


@pytest.fixture(scope="module")
def simavr(tmp_path_factory):
    """The shim as a library, built with the machine's compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: simavr's core cannot be built in")
    library = tmp_path_factory.mktemp("simavr") / "shim.so"
    source = Path(__file__).with_name("simavr_shim.c")
    command = [
        compiler,
        "-O2",
        "-shared",
        "-fPIC",
        "-I/usr/include/simavr",
        str(source),
        "-o",
        str(library),
        "-lsimavr",
    ]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    if built.returncode:
        pytest.skip(f"libsimavr with headers is not installed: {built.stderr.strip().splitlines()[0]}")
    shim = ctypes.CDLL(str(library))
    assert shim.shim_open() == 0
    return shim


DIFFERENCES = tomllib.loads(Path(__file__).with_name("simavr_differences.toml").read_text(encoding="utf-8"))[
    "difference"
]
SHOWN = [difference for difference in DIFFERENCES if "program" in difference]


@pytest.mark.parametrize("difference", SHOWN, ids=[difference["what"] for difference in SHOWN])
def test_differences_are_as_listed(simavr, difference):
    image = assemble("\n".join(difference["program"]))
    chip = Chip(image)
    assert chip.run_to(1000) is StopCause.BREAK
    assert chip.registers[difference["shows"]] == difference["ours"]
    flash = image + bytes([0xFF] * (2 * WORDS - len(image)))
    starts = np.zeros(WORDS, dtype=np.uint8)
    starts[: len(image) // 2 - 1] = 1  # all but the break
    trace = np.zeros((STEPS, ROW), dtype=np.int32)
    arrays = (starts, np.zeros(32, dtype=np.uint8), np.zeros(SRAM_BYTES, dtype=np.uint8), trace)
    pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in arrays]
    done = simavr.shim_run(flash, *pointers[:3], 0, 0, 0x8FF, STEPS, pointers[3])
    assert trace[done - 1, 4 + difference["shows"]] == difference["simavr"]


def test_the_list_is_in_the_documentation():
    text = Path(__file__).parents[2].joinpath("docs", "emulator.md").read_text(encoding="utf-8")
    for difference in DIFFERENCES:
        assert "| {what} | {datasheet} | {theirs} |".format_map(difference) in text


def random_instruction(rng: np.random.Generator, place: int) -> list[int]:
    """One defined instruction that leaves the pointers r26 to r31 alone (auto-increments aside)."""
    d, r, high = (int(rng.integers(*span)) for span in ((0, 26), (0, 32), (16, 26)))
    bit, constant = int(rng.integers(8)), int(rng.integers(256))
    pointer = rng.choice(["X", "X+", "-X", "Y+", "-Y", "Z+", "-Z", "Y", "Z"])
    offset = f"{pointer}{int(rng.integers(64))}" if pointer in ("Y", "Z") else pointer
    address, target = int(rng.integers(0x100, 0x900)), int(rng.integers(LOWEST_TARGET, WORDS))
    near, far = (min(max(place + 1 + int(rng.integers(-span, span)), 0), WORDS - 1) for span in (64, 2048))
    pairs = ["add", "adc", "sub", "sbc", "and", "or", "eor", "mov", "cp", "cpc", "cpse", "mul"]
    choices = [
        *[(m, [f"r{d}", f"r{r}"]) for m in pairs],
        *[(m, [f"r{d}"]) for m in ("com", "neg", "inc", "dec", "lsr", "ror", "asr", "swap", "pop")],
        *[(m, [f"r{high}", f"{constant}"]) for m in ("subi", "sbci", "andi", "ori", "ldi", "cpi")],
        *[(m, [f"r{d}", f"{bit}"]) for m in ("bld", "bst", "sbrc", "sbrs")],
        *[(m, ["r24", f"{constant & 63}"]) for m in ("adiw", "sbiw")],
        ("muls", [f"r{high}", f"r{16 + r % 16}"]),
        *[(m, [f"r{16 + d % 8}", f"r{16 + r % 8}"]) for m in ("mulsu", "fmul", "fmuls", "fmulsu")],
        ("movw", [f"r{d // 2 * 2}", f"r{r // 2 * 2}"]),
        ("push", [f"r{r}"]),
        *[("ldd", [f"r{d}", offset])] * 3,
        *[("std", [offset, f"r{d}"])] * 3,
        ("lds", [f"r{d}", f"{address}"]),
        ("sts", [f"{address}", f"r{r}"]),
        *[("lpm", [f"r{d}", z]) for z in ("Z", "Z+")],
        ("lpm", []),
        *[(m, [f"r{d}", f"{io}"]) for m, io in (("in", GPIORS[bit % 3]), ("in", 0x3F))],
        *[("out", [f"{io}", f"r{r}"]) for io in (GPIORS[bit % 3], 0x3F)],
        *[(m, ["0x1E", f"{bit}"]) for m in ("sbi", "cbi", "sbic", "sbis")],
        *[(m, [f"{bit}"]) for m in ("bset", "bclr")],
        *[(m, [f"{near}"]) for m in ("brcs", "breq", "brmi", "brlt", "brcc", "brne", "brpl", "brge")],
        *[(m, [f"{far}"]) for m in ("rjmp", "rcall")],
        *[(m, [f"{target}"]) for m in ("jmp", "call")],
        *[(m, []) for m in ("ijmp", "icall", "ret", "reti", "nop")],
    ]
    mnemonic, operands = choices[int(rng.integers(len(choices)))]
    return encode(mnemonic, operands, place, {})


def random_program(rng: np.random.Generator) -> tuple[bytes, np.ndarray]:
    """A flash full of random instructions, and the words at which they begin."""
    words: list[int] = []
    starts = np.zeros(WORDS, dtype=np.uint8)
    skips = False
    while len(words) < WORDS - 2:
        instruction = random_instruction(rng, len(words))
        if skips and instruction[0] & 0xFE0C == 0x960C:
            continue
        skips = instruction[0] >> 10 == 0x04 or instruction[0] >> 10 == 0x3F or instruction[0] & 0xFD00 == 0x9900
        starts[len(words)] = 1
        words += instruction
    words += [0] * (WORDS - len(words))
    return struct.pack(f"<{WORDS}H", *words), starts


def random_state(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, int, int, int]:
    """Registers with pointers into the middle of the SRAM, SRAM that holds flash addresses, PC, SREG, SP."""
    registers = rng.integers(0, 256, 32).astype(np.uint8)
    registers[[27, 29, 31]] = rng.integers(3, 7, 3)
    sram = rng.integers(1, WORDS // 256, SRAM_BYTES).astype(np.uint8)
    return (
        registers,
        sram,
        int(rng.integers(LOWEST_TARGET, WORDS)),
        int(rng.integers(256)),
        int(rng.integers(0x300, 0x700)),
    )


def begin(chip: Chip, power_up: Snapshot, registers: np.ndarray, sram: np.ndarray, at: tuple[int, int, int]) -> None:
    """Bring the chip to a state; `at` is PC, SREG, SP."""
    chip.restore(power_up)
    chip.registers[:] = registers
    chip.sram[:] = sram
    chip.pc, chip.sreg, chip.sp = at


def test_random_programs_step_by_step(simavr, sized):
    programs = sized(SMALL, FULL)
    rng = np.random.default_rng(328)
    trace = np.zeros((STEPS, ROW), dtype=np.int32)
    mine = np.zeros_like(trace)
    total = 0
    for _ in range(programs):
        image, starts = random_program(rng)
        chip = Chip(image)
        power_up = chip.snapshot()
        for _ in range(RUNS_PER_PROGRAM):
            registers, sram, pc, sreg, sp = random_state(rng)
            after = sram.copy()
            pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (starts, registers, after, trace)]
            done = simavr.shim_run(image, pointers[0], pointers[1], pointers[2], pc, sreg, sp, STEPS, pointers[3])
            begin(chip, power_up, registers, sram, (pc, sreg, sp))
            for step in range(done):
                assert chip.run_to(chip.cycle + 1) is StopCause.REACHED
                mine[step, :4] = chip.pc, chip.cycle, chip.sreg, chip.sp
                mine[step, 4:] = chip.registers
            different = np.nonzero((mine[:done] != trace[:done]).any(axis=1))[0]
            assert not different.size, explain(int(different[0]), pc, image, mine, trace)
            np.testing.assert_array_equal(chip.sram, after)
            if done:  # once more without a stop, where pairs run in one go (`cpu/fusion.py`)
                begin(chip, power_up, registers, sram, (pc, sreg, sp))
                chip.run_to(int(trace[done - 1, 1]))
                assert [chip.pc, chip.cycle, chip.sreg, chip.sp, *chip.registers] == trace[done - 1].tolist()
                np.testing.assert_array_equal(chip.sram, after)
            total += done
    assert total > 45_000 * programs


def explain(step: int, pc: int, image: bytes, mine: np.ndarray, trace: np.ndarray) -> str:
    place = pc if step == 0 else int(trace[step - 1, 0])
    word = struct.unpack_from("<H", image, 2 * place)[0]
    where = f"after word {word:04X} at {place:04X} (step {step})"
    return f"{where}\nchip   {mine[step].tolist()}\nsimavr {trace[step].tolist()}"
