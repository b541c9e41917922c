"""Bytes and time of compressing step trains, beside the coding of a 3D printer's firmware: `./dev bench segments`.

The neighbour is a clean-room model of the format that Klipper's documents describe (docs/MCU_Commands.md,
queue_step): an interval in whole ticks, a count of 16 bits and an add of 16 bits that is added to the interval at each
step. The model cuts greedily and finds, for each cut, the longest run that any interval and add can make: no encoder of
that format that cuts greedily does better. Steps may come early by the tolerance, as there ("one side"), or miss both
ways, as ours. Its bytes are 6.6 for each run, measured on that firmware's wire (message, object, three numbers).

Ours are the bytes on the line, all joints' together, headers, heads and checks of the frames included, with the cap of
15.6 ms where a motor is fast, and without. "2 %" is what plans use: 1 us, or 2 % of the interval if that is more. The
hard motion is `tests/data/reference_motion.toml`.
"""

import sys
from math import pi
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Final

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

from planarm.experiments.scenes import example_file, table1_scene
from planarm.notice import silent
from planarm.pipeline import plan_scene
from planarm.scene import JointSpec, load_scene
from planarm.stepping.segments import Coding, compress
from planarm.stepping.table import segment_bytes, table_of
from planarm.stepping.train import JointSteps, StepTrain
from planarm.stepping.windows import tolerance_ticks
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import CRC_BYTES, HEADER_BYTES, MAX_PAYLOAD_BYTES, TICKS_HZ

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from reference_motion import reference_train

Ticks = NDArray[np.int64]

QUEUE_STEP_BYTES: Final = 6.6
LARGEST_COUNT: Final = 0xFFFF
LEAST_ADD, LARGEST_ADD = -0x8000, 0x7FFF
US: Final = TICKS_HZ // 1_000_000
RUNS: Final = 9
HEAD_BYTES: Final = 3
FRAME_BYTES: Final = HEADER_BYTES + HEAD_BYTES + 2 * CRC_BYTES + 1


def main() -> None:
    """Compress each train by every coding and print one table."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("train", no_wrap=True)
    table.add_column("tolerance", no_wrap=True)
    for name in ("one side", "both", "ours", "/ ours", "theirs/step", "ours/step", "uncapped", "segm.", "ms"):
        table.add_column(name, justify="right", no_wrap=True)
    for name, train, axes in trains():
        for label, tolerance_us, share in (("1 us", 1, 0.0), ("1 us or 2 %", 1, 0.02), ("25 us", 25, 0.0)):
            table.add_row(name, label, *row(train, axes, tolerance_us, share))
    console = Console(width=120)
    console.print("Bytes for whole motions, both joints: the other coding, ours, ours without the cap of 15.6 ms.")
    console.print("Ratios are of the other coding's own rule (one side) to ours; ms is the median of", RUNS, "runs.")
    console.print(table)


def row(train: StepTrain, axes: tuple[JointSpec, ...], tolerance_us: int, share: float) -> list[str]:
    """Return the cells of one train and tolerance."""
    start_stop = Coding.of(axes).start_stop_ticks
    coding = Coding(tolerance_us * US, share, 1.0 if share == 0.0 else 0.04, start_stop_ticks=start_stop)
    uncapped = Coding(coding.ticks, coding.share, coding.most_share)
    windows = [(steps.ticks, tolerance_ticks(steps, coding)) for steps in train.steps]
    early, theirs = (
        QUEUE_STEP_BYTES * sum(queue_steps(ticks, early, late * early) for ticks, early in windows) for late in (0, 1)
    )
    table = table_of(compress(train, coding))
    ours = line_bytes(segment_bytes(table))
    free = line_bytes(segment_bytes(table_of(compress(train, uncapped))))
    steps = sum(len(one.ticks) for one in train.steps)
    times_ms = []
    for _ in range(RUNS):
        began_s = perf_counter()
        compress(train, coding)
        times_ms.append(1e3 * (perf_counter() - began_s))
    cells = [f"{early:.0f}", f"{theirs:.0f}", f"{ours}", f"{early / ours:.2f}"]
    cells += [f"{early / steps:.3f}", f"{ours / steps:.3f}", f"{free}"]
    return [*cells, f"{len(table.durations)}", f"{median(times_ms):.1f}"]


def line_bytes(sizes: Ticks) -> int:
    """Return the bytes of segments in frames of one or two, as the stream packs them."""
    frames = at = 0
    while at < len(sizes):
        at += 2 if HEAD_BYTES + sizes[at : at + 2].sum() <= MAX_PAYLOAD_BYTES else 1
        frames += 1
    return int(sizes.sum()) + FRAME_BYTES * frames


def trains() -> list[tuple[str, StepTrain, tuple[JointSpec, ...]]]:
    """Return two planned motions, a hard one, and smooth ones of 2 s with top rates of 20 k and 45 k steps/s."""
    scenes = (("plan, 50 k on both", load_scene(example_file("fast_arm.toml"))), ("Table I, case 1", table1_scene(1)))
    planned = []
    for name, scene in scenes:
        plan = plan_scene(scene, silent)
        planned.append((name, plan.train, plan.scene.joints))
    return [*planned, ("hard, 20 k steps/s", *reference_train())] + [
        (f"smooth, {rate_hz // 1000} k steps/s", *smooth(rate_hz)) for rate_hz in (20_000, 45_000)
    ]


def smooth(rate_hz: float, duration_s: float = 2.0) -> tuple[StepTrain, tuple[JointSpec, ...]]:
    """Return rest to rest along a quintic, joint 2 the golden section of joint 1."""
    steps, axes = [], []
    for top_hz in (rate_hz, 0.618 * rate_hz):
        usteps = top_hz * duration_s / 1.875  # a quintic's top speed is 1.875 times its mean
        u = np.linspace(0.0, 1.0, 200_001)
        x = usteps * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        count = int(usteps)
        t_s = duration_s * np.interp(np.arange(count) + 0.5, x, u)
        steps.append(JointSteps(np.floor(t_s * TICKS_HZ + 0.5).astype(np.int64), np.ones(count, np.int8)))
        acceleration = 5.774 * usteps / duration_s**2  # of a quintic, at most
        axes.append(JointSpec(200, 16, 5.0, "a4988", 100.0, acceleration / (16_000 / (2.0 * pi))))
    return StepTrain((0, 0), tuple(steps), int(duration_s * TICKS_HZ) + 1000), tuple(axes)


@kernel
def queue_steps(ticks: Ticks, early: Ticks, late: Ticks) -> int:
    """Return how many runs (interval, count, add) make the steps, early or late by so much at most, cut greedily."""
    runs, done, clock = 0, 0, 0
    while done < ticks.shape[0]:
        fits, size = 0, 1
        fails = min(ticks.shape[0] - done, LARGEST_COUNT) + 1
        interval, add = 0, 0
        while size > fits:
            found, i, a = best_run(
                ticks[done : done + size], clock, early[done : done + size], late[done : done + size]
            )
            if found:
                fits, interval, add = size, i, a
                size = min(2 * size, (fits + fails) // 2)
            else:
                fails = size
                size = (fits + fails) // 2
        if fits == 0:
            raise ValueError("a step is nearer to the one before it than a tick: no run makes it")
        clock += interval * fits + add * fits * (fits - 1) // 2
        done += fits
        runs += 1
    return runs


@kernel
def best_run(ticks: Ticks, clock: int, early: Ticks, late: Ticks) -> tuple[bool, int, int]:
    """Return (found, interval, add) of a run that makes these steps, counted from the clock.

    How far the best interval for a given add misses is convex in the add: its least is found by golden section in whole
    numbers, and then the adds around it are tried, since the interval is whole, too.
    """
    low, high = LEAST_ADD, LARGEST_ADD
    while high - low > 8:
        third = (high - low) // 3
        a, b = low + third, high - third
        if spare(ticks, clock, early, late, a)[0] >= spare(ticks, clock, early, late, b)[0]:
            high = b
        else:
            low = a
    for add in range(low - 8, high + 9):
        if LEAST_ADD <= add <= LARGEST_ADD:
            _, least, most = spare(ticks, clock, early, late, add)
            whole = max(1, int(np.ceil(least - 1e-9)))
            if whole <= most + 1e-9 and whole + add * (ticks.shape[0] - 1) > 0:
                return True, whole, add
    return False, 0, 0


@kernel
def spare(ticks: Ticks, clock: int, early: Ticks, late: Ticks, add: int) -> tuple[float, float, float]:
    """Return (most - least, least, most): the intervals that keep every step in its window for this add."""
    least, most = -1e18, 1e18
    for k in range(ticks.shape[0]):
        n = k + 1
        rest = ticks[k] - clock - add * (n * (n - 1) // 2)
        least = max(least, (rest - early[k]) / n)
        most = min(most, (rest + late[k]) / n)
    return most - least, least, most


if __name__ == "__main__":
    main()
