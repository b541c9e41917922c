"""Fault campaigns: from one snapshot, runs of one emulated second, each with one bit of the SRAM flipped on the way."""

import os
from collections import Counter
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter

import numpy as np

from planarm_sim.cpu.chip import Chip, StopCause

SECOND = 16_000_000
WARM_UP_CYCLES = 1_600_000
BIT_CYCLES = 16_000_000 / 115_200


def campaign(image: str, seed: int, runs: int) -> Counter[str]:
    """Do so many runs; returns how many ended how."""
    chip = Chip(Path(image).read_bytes())
    for n in range(int(1.1 * 11_520)):
        chip.push_rx(round((1 + 10 * n) * BIT_CYCLES), BIT_CYCLES, n & 0xFF)
    chip.run_to(WARM_UP_CYCLES)
    chip.drain_edges()
    chip.drain_tx()
    start = chip.snapshot()
    chip.run_to(WARM_UP_CYCLES + SECOND)
    right = chip.drain_edges().tobytes(), chip.drain_tx().tobytes()
    rng = np.random.default_rng(seed)
    ends: Counter[str] = Counter()
    for _ in range(runs):
        chip.restore(start)
        chip.run_to(WARM_UP_CYCLES + int(rng.integers(SECOND)))
        chip.sram[rng.integers(len(chip.sram))] ^= 1 << int(rng.integers(8))
        cause = chip.run_to(WARM_UP_CYCLES + SECOND)
        seen = chip.drain_edges().tobytes(), chip.drain_tx().tobytes()
        ends["stopped" if cause is not StopCause.REACHED else "no effect" if seen == right else "other output"] += 1
    return ends


def runs_per_minute(image: Path, runs: int, processes: int) -> tuple[float, Counter[str]]:
    """Share `runs` among processes; returns runs a minute of wall time, and how they ended."""
    shares = [(str(image.with_suffix(".bin")), seed, runs // processes) for seed in range(processes)]
    with get_context("spawn").Pool(processes) as pool:
        pool.starmap(campaign, [(image_, seed, 1) for image_, seed, _ in shares])  # not counted: imports, first run
        began_s = perf_counter()
        ends = pool.starmap(campaign, shares, chunksize=1)
        took_s = perf_counter() - began_s
    return 60 * sum(count for _, _, count in shares) / took_s, sum(ends, Counter())


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
