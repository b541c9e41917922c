"""How long a recording of many edges takes to judge, and how much memory: `./dev bench captures [--edges N]`.

Two joints with a plan; the VCD is written first, in planarm's own form. Peak memory is the process's own, the plan's
steps (9 bytes each) and their making included, so each size runs in a process of its own. "Warm": the file is in
the system's cache and the kernels are compiled.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import tempfile
import time
from pathlib import Path
from typing import IO

import numpy as np
from rich.console import Console

from planarm.analysis.capture import open_capture
from planarm.analysis.channels import map_channels
from planarm.analysis.step_match import Schedule
from planarm.analysis.timing import PulseLimits, TimingRules, analyse
from planarm_wire.messages import BOARDS

PINS = BOARDS["uno"].joint_pins

CODES = ("!", '"')


def main() -> None:
    """Write, judge, print."""
    parser = argparse.ArgumentParser(prog="./dev bench captures", description=__doc__)
    parser.add_argument("--edges", type=float, nargs="+", default=[1e6, 1e7], help="sizes to run (1e6 1e7)")
    context = multiprocessing.get_context("spawn")
    Console(width=100).print(
        f"{'edges':>12} {'file MB':>9} {'judged s':>9} {'M edges/s':>10} {'peak MB':>8} {'steps':>12}  verdict"
    )
    for edges in parser.parse_args().edges:
        with tempfile.TemporaryDirectory() as folder:
            process = context.Process(target=run, args=(int(edges), Path(folder) / "wave.vcd"))
            process.start()
            process.join()


def run(edges: int, path: Path) -> None:
    """Judge one file and print its row."""
    steps = edges // 4
    schedules = write(path, steps)
    rules = TimingRules((PulseLimits(1.9e-6, 1.9e-6, 650e-9, 650e-9),) * 2)
    small = path.with_name("small.vcd")
    warm_up = write(small, 1000)
    capture = open_capture(path)
    channels = map_channels(path, capture.channels, [], PINS)
    analyse(open_capture(small), channels, warm_up, rules)  # the kernels
    began = time.perf_counter()
    report = analyse(capture, channels, schedules, rules)
    took = time.perf_counter() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    size = path.stat().st_size / 1e6
    counted = sum(joint.steps for joint in report.joints)
    Console(width=100).print(
        f"{edges:12,} {size:9.1f} {took:9.2f} {edges / took / 1e6:10.2f} {peak:8.0f} {counted:12,}  ok={report.ok}"
    )


def write(path: Path, steps: int) -> list[Schedule]:
    """Write two joints' pulses in pieces, 20 to 25 us apart; return their schedules."""
    rng = np.random.default_rng(1)
    schedules = []
    for joint in range(2):
        gaps = rng.integers(320, 400, steps) + joint
        schedules.append(Schedule(62_500 * np.cumsum(gaps), np.full(steps, -1, np.int8)))
    with path.open("w", encoding="ascii") as file:
        file.write("$timescale 100 ps $end\n")
        for code, name in zip(("!", '"', "#", "$"), ("D9", "D10", "D4", "D5"), strict=True):
            file.write(f"$var wire 1 {code} {name} $end\n")
        file.write('$enddefinitions $end\n#0\n$dumpvars\n0!\n0"\n0#\n0$\n$end\n')
        window = 20_000_000_000  # of time units: 2 s
        for begin in range(0, max(int(s.times_ps[-1]) for s in schedules) // 100 + 1_000_000, window):
            _write_window(file, schedules, begin, begin + window)
    return schedules


def _write_window(file: IO[str], schedules: list[Schedule], begin: int, end: int) -> None:
    """Write the edges of both joints that fall into a stretch of time, in order."""
    times, words = [], []
    for code, schedule in zip(CODES, schedules, strict=True):
        rises = schedule.times_ps // 100
        for level, moments in (("1", rises), ("0", rises + 31_250)):
            inside = moments[np.searchsorted(moments, begin) : np.searchsorted(moments, end)]
            times.append(inside)
            words += [level + code] * len(inside)
    moments = np.concatenate(times)
    file.write("".join(f"#{moments[i]}\n{words[i]}\n" for i in np.argsort(moments, kind="stable").tolist()))


if __name__ == "__main__":
    main()
