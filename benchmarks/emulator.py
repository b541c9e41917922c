"""How fast the emulated Uno runs the released image: `./dev bench emulator [--cold]`.

Times real time are emulated seconds for each second of CPU time in this one process, since the machine may be busy.
"streaming" plays the bytes that a host sent for a whole plan, at the cycle at which it sent them, so that the host's
own work is not counted; "with the host" is the same plan streamed by the host in this process.
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

from rich import box
from rich.console import Console
from rich.table import Table

from planarm.experiments.scenes import table1_scene
from planarm.link.exchange import stream_plan
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm.pipeline import plan_scene
from planarm_sim import Uno

REST_S = 2.0
"""Emulated seconds at rest for one measurement."""
RUNS = 5
SNAPSHOTS = 300
START = "from planarm_sim import Uno; import sys; Uno.from_hex(sys.argv[1]).run(seconds=0.01)"
"""What a program does first."""

Cells = tuple[str, str, str]


def main() -> None:
    """Measure and print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--cold", action="store_true", help="also time a start that compiles every kernel (a minute)")
    options = parser.parse_args()
    rows = [at_rest(), *streaming(), *snapshots(), start("warm start", None)]
    if options.cold:
        with tempfile.TemporaryDirectory() as empty:
            rows.append(start("cold start, compiling", empty))
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
    plan = plan_scene(table1_scene(1), lambda _stage, _share: None)
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


def start(what: str, cache: str | None) -> Cells:
    """Time a program's first steps in a process of its own; `cache` holds compiled kernels, None is the usual one."""
    environment = {**os.environ, **({"PLANARM_CACHE_DIR": cache} if cache else {})}
    command = [sys.executable, "-c", START, str(released_image())]
    took_s = elapsed_s(lambda: subprocess.run(command, env=environment, check=True))
    return what, f"{took_s:.2f} s", "import, load, 10 ms; wall"


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
