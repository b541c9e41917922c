"""Fault campaigns: from one snapshot, runs of one emulated second, each with one bit of the SRAM flipped on the way."""

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from planarm_sim.cpu.chip import Chip, Snapshot, StopCause

SECOND = 16_000_000
WARM_UP_CYCLES = 1_600_000
BIT_CYCLES = 16_000_000 / 115_200
CHUNK = 10
"""Runs that a process takes at a time: some runs take several times as long as others."""
LOOP_TURNS = 300_000


@dataclass(frozen=True, slots=True)
class Rate:
    """What a number of processes did.

    Attributes:
        per_minute: runs a minute of wall time, all processes together.
        cpu_s: CPU time of one run, mean.
        ends: how many runs ended how.
    """

    per_minute: float
    cpu_s: float
    ends: Counter[str]


@dataclass(frozen=True, slots=True)
class Bench:
    """What a process makes once: the chip, where its runs begin, and what they must send and do."""

    chip: Chip
    start: Snapshot
    right: tuple[bytes, bytes]


_BENCH: list[Bench] = []


def prepare(image: str) -> None:
    """Make this process' bench."""
    chip = Chip(Path(image).read_bytes())
    for n in range(int(1.1 * 11_520)):
        chip.push_rx(round((1 + 10 * n) * BIT_CYCLES), BIT_CYCLES, n & 0xFF)
    chip.run_to(WARM_UP_CYCLES)
    chip.drain_edges()
    chip.drain_tx()
    start = chip.snapshot()
    chip.run_to(WARM_UP_CYCLES + SECOND)
    _BENCH[:] = [Bench(chip, start, (chip.drain_edges().tobytes(), chip.drain_tx().tobytes()))]


def one_run(number: int) -> tuple[str, float]:
    """Do the run of that number; returns how it ended, and its CPU time."""
    began_s = process_time()
    chip, rng = _BENCH[0].chip, np.random.default_rng(number)
    chip.restore(_BENCH[0].start)
    chip.run_to(WARM_UP_CYCLES + int(rng.integers(SECOND)))
    chip.sram[rng.integers(len(chip.sram))] ^= 1 << int(rng.integers(8))
    cause = chip.run_to(WARM_UP_CYCLES + SECOND)
    seen = chip.drain_edges().tobytes(), chip.drain_tx().tobytes()
    end = "stopped" if cause is not StopCause.REACHED else "no effect" if seen == _BENCH[0].right else "other output"
    return end, process_time() - began_s


def loop(_number: int) -> tuple[str, float]:
    """What any program does: count. Says what the machine's cores give when several of them work."""
    began_s, total = process_time(), 0
    for n in range(LOOP_TURNS):
        total += n
    return str(total), process_time() - began_s


def rates(image: Path, runs: int, counts: Iterable[int]) -> dict[int, tuple[Rate, Rate]]:
    """Do the same `runs` by so many processes at a time; returns for each what they did, and what counting gave."""
    measured: dict[int, tuple[Rate, Rate]] = {}
    for processes in counts:
        with get_context("spawn").Pool(processes, prepare, (str(image.with_suffix(".bin")),)) as pool:
            pool.map(one_run, range(processes * CHUNK), CHUNK)  # not counted: imports, warm-up
            rate, plain = (_rate(pool.imap_unordered(work, range(runs), CHUNK)) for work in (one_run, loop))
            measured[processes] = rate, plain
    assert len({tuple(sorted(rate.ends.items())) for rate, _ in measured.values()}) == 1, "the same runs end the same"
    return measured


def _rate(results: Iterable[tuple[str, float]]) -> Rate:
    began_s = perf_counter()
    done = list(results)
    took_s = perf_counter() - began_s
    return Rate(60 * len(done) / took_s, sum(cpu_s for _, cpu_s in done) / len(done), Counter(end for end, _ in done))


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
