"""How fast the emulated Uno runs the released image: `./dev bench emulator [--cold]`.

Times real time are emulated seconds for each second of CPU time in this one process, since the machine may be busy.
"streaming" plays the bytes that a host sent for a whole plan, at the cycle at which it sent them, so that the host's
own work is not counted; "with the host" is the same plan streamed by the host in this process. The interrupt-heavy
image is compiled from emulator_parts/interrupt_heavy.c; simavr runs it in the same run, fed the same bytes. Its main
program waits between bytes, which planarm_sim passes over; the image that "never waits" computes there instead.
Where a figure goes by the clock, CPU time stands beside it.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

from emulator_parts.fault_runs import cores, rates
from emulator_parts.heavy import MissingToolError, build_driver, build_image, ours_cpu_s, simavr_cpu_s
from rich import box
from rich.console import Console
from rich.table import Table

from planarm.experiments.scenes import table1_scene
from planarm.link.exchange import stream_plan
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm.notice import silent
from planarm.pipeline import plan_scene
from planarm_sim import Uno

REST_S = 2.0
"""Emulated seconds at rest for one measurement."""
RUNS = 5
SNAPSHOTS = 300
HEAVY_S = 2.0
FAULT_RUNS = 400
START = "from planarm_sim import Uno; import sys; Uno.from_hex(sys.argv[1]).run(seconds=0.01)"
"""What a program does first."""
FLOOR = """
import numba, sys
@numba.njit("int64(int64)", cache=True)
def same(x):
    return x
same(1)
"""
"""What any program does that calls one function from Numba's cache."""

Cells = tuple[str, str, str]


def main() -> None:
    """Measure and print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--cold", action="store_true", help="also time a start that compiles every kernel (a minute)")
    options = parser.parse_args()
    rows = [at_rest(), *streaming()]
    with tempfile.TemporaryDirectory() as folder:
        try:
            rows += [*interrupt_heavy(Path(folder)), *fault_runs(Path(folder))]
        except MissingToolError as missing:
            rows.append(("interrupt-heavy image", "-", str(missing)))
    rows += snapshots()
    with tempfile.TemporaryDirectory() as folder:
        rows += starts(Path(folder), cold=options.cold)
    table = Table(title="The released image on the emulated Uno", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("what", no_wrap=True)
    table.add_column("figure", justify="right")
    table.add_column("how")
    for cells in rows:
        table.add_row(*cells)
    Console().print(table)


def at_rest() -> Cells:
    """Run the image without a host."""
    uno = Uno.from_hex(released_image())
    uno.run(seconds=0.1)
    speeds = [times_real_time(uno, lambda: uno.run(seconds=REST_S)) for _ in range(RUNS)]
    return "at rest", f"{median(speeds):.1f} x real time", f"median of {RUNS} x {REST_S:g} s"


def streaming() -> list[Cells]:
    """Stream the plan of case 1 once with the host, then play its bytes again without it."""
    plan = plan_scene(table1_scene(1), silent)
    segments = plan.segments.segments
    line = RecordedLine(released_image())
    stream_plan(line, segments)  # not counted
    line = RecordedLine(released_image())
    with_host = times_real_time(line.uno, lambda: stream_plan(line, segments))
    speeds = [replayed_speed(line) for _ in range(RUNS)]
    return [
        (
            "streaming",
            f"{median(speeds):.1f} x real time",
            f"median of {RUNS} x {line.uno.time_s:.2f} s",
        ),
        ("streaming, with the host", f"{with_host:.1f} x real time", f"{len(segments)} segments, one run"),
    ]


def interrupt_heavy(folder: Path) -> list[Cells]:
    """Run the interrupt-heavy image on planarm_sim and on simavr, turn by turn."""
    driver = build_driver(folder)
    rows: list[Cells] = []
    for what, busy in (("interrupt-heavy image", False), ("the same, never waits", True)):
        image = build_image(folder, busy=busy)
        ours_cpu_s(image, 0.1)
        pairs = [(ours_cpu_s(image, HEAVY_S), simavr_cpu_s(driver, image, HEAVY_S)) for _ in range(RUNS)]
        assert all(abs(ours[2] - theirs[2]) <= 2 for ours, theirs in pairs), "the same edges of PB0"
        ours_s, theirs_s = median(ours[0] for ours, _ in pairs), median(theirs[0] for _, theirs in pairs)
        ratio = median(theirs[0] / ours[0] for ours, theirs in pairs)
        rows.append((what, f"{HEAVY_S / ours_s:.1f} x real time", f"median of {RUNS} x {HEAVY_S:g} s"))
        rows.append(("  beside simavr", f"{ratio:.1f} x simavr", f"simavr: {HEAVY_S / theirs_s:.1f} x real time"))
    return rows


def fault_runs(folder: Path) -> list[Cells]:
    """Runs of one second with a flipped bit each, on one core and on two, and what two give to a loop that counts."""
    measured = rates(build_image(folder, busy=False), FAULT_RUNS, sorted({1, min(2, cores())}))
    (one, plain_one), *more = measured.values()
    ends = ", ".join(f"{count} {end}" for end, count in sorted(one.ends.items()))
    rows = [
        ("one-second fault runs, 1 core", f"{one.per_minute:.0f} a minute", f"{1e3 * one.cpu_s:.1f} ms of CPU; {ends}")
    ]
    for two, plain in more:
        speed, plain_speed = two.per_minute / one.per_minute, plain.per_minute / plain_one.per_minute
        by_cpu = 2 * one.cpu_s / two.cpu_s
        how = (
            f"{speed:.2f} x one core by the clock, where counting gives {plain_speed:.2f} x; {by_cpu:.2f} x by CPU time"
        )
        rows.append(("  2 cores", f"{two.per_minute:.0f} a minute", how))
    return rows


class RecordedLine(SimTransport):
    """The emulated line, with what the host wrote and when."""

    def __init__(self, image: Path) -> None:
        super().__init__(image)
        self.written: list[tuple[int, bytes]] = []

    def write(self, data: bytes) -> None:
        """Note the cycle and pass the bytes on."""
        self.written.append((self.uno.cycle, data))
        super().write(data)


def replayed_speed(line: RecordedLine) -> float:
    """Play the line's bytes to a new board; see that it does the same, edge for edge."""
    uno = Uno.from_hex(released_image())

    def play() -> None:
        for cycle, data in line.written:
            uno.run(cycles=max(0, cycle - uno.cycle))
            uno.serial.write(data)
        uno.run(cycles=max(0, line.uno.cycle - uno.cycle))

    speed = times_real_time(uno, play)
    for pin in ("D9", "D10"):
        assert uno.edges(pin).tolist() == line.uno.edges(pin).tolist(), f"{pin} has the same edges again"
    return speed


def snapshots() -> list[Cells]:
    """Time a snapshot and going back to it, on a board that has run a while."""
    uno = Uno.from_hex(released_image())
    uno.run(seconds=0.1)
    kept = uno.snapshot()
    taking = median(elapsed_s(uno.snapshot) for _ in range(SNAPSHOTS))
    going_back = median(elapsed_s(lambda: uno.restore(kept)) for _ in range(SNAPSHOTS))
    return [
        ("snapshot", f"{1e6 * taking:.1f} us", f"median of {SNAPSHOTS}"),
        ("restore", f"{1e6 * going_back:.1f} us", f"median of {SNAPSHOTS}"),
    ]


def starts(folder: Path, *, cold: bool) -> list[Cells]:
    """Time a program's first steps in processes of their own, and what Numba itself takes, turn by turn.

    Modules are loaded as from an install, from their byte code, which here lies in `folder`.
    """
    (folder / "floor.py").write_text(FLOOR)
    (folder / "start.py").write_text(START)
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment = {**kept, "PYTHONPYCACHEPREFIX": str(folder / "bytecode")}

    def took_s(program: str, **more: str) -> tuple[float, float]:
        """Wall and CPU time."""
        command = [sys.executable, str(folder / program), str(released_image())]
        before = os.times()
        wall_s = elapsed_s(lambda: subprocess.run(command, env={**environment, **more}, check=True))
        after = os.times()
        spent = (after.children_user - before.children_user, after.children_system - before.children_system)
        return wall_s, sum(spent)

    for program in ("start.py", "floor.py"):  # fills the caches
        took_s(program)
    pairs = [(took_s("start.py"), took_s("floor.py")) for _ in range(2 * RUNS)]
    rows = []
    for n, (what, how) in enumerate(
        (("warm start", "import, load, 10 ms"), ("  beside Numba alone", "import, one cached call"))
    ):
        wall_s, cpu_s = (median(pair[n][clock] for pair in pairs) for clock in (0, 1))
        rows.append((what, f"{wall_s:.2f} s", f"{cpu_s:.2f} s of CPU; {how}; medians of {2 * RUNS}"))
    if cold:
        wall_s, cpu_s = took_s("start.py", PLANARM_CACHE_DIR=str(folder / "empty"))
        rows.append(("cold start, compiling", f"{wall_s:.2f} s", f"{cpu_s:.2f} s of CPU; import, load, 10 ms"))
    return rows


def times_real_time(uno: Uno, work: Callable[[], object]) -> float:
    """Return emulated seconds for each second of CPU time that `work` takes."""
    before_s, began_s = uno.time_s, process_time()
    work()
    return (uno.time_s - before_s) / (process_time() - began_s)


def elapsed_s(work: Callable[[], object]) -> float:
    """Return the wall time of one run."""
    began_s = perf_counter()
    work()
    return perf_counter() - began_s


if __name__ == "__main__":
    main()
