"""How long an echo takes through the emulated Uno's terminal: `./dev bench pty [--echoes N]`.

Three processes answer in turn, each behind a pseudo-terminal of its own, to 32 bytes at 250,000 baud:

- control: reads them, sleeps for as long as they would be on the wire, and writes them. No emulator at all: what it
  takes beyond the wire is what system and machine take to pass a terminal twice, wake two processes and end a sleep.
- direct, 16u2: `python -m planarm_sim` in real time with a program that sends each byte back, without and with the USB
  bridge. Its log of the line says at which cycles the first byte's start bit and the last echo's stop bit lay; with the
  bridge's rule (a tick of 4.096 ms, a packet of 53 us) that is what a perfect board takes.

"over" is what an echo took beyond that, by this process' clock; "waiting" how much of it the two processes stood ready
without being given a processor (/proc/PID/schedstat): load of the machine, not work of the emulator.
"""

import argparse
import csv
import os
import random
import select
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import serial
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

from planarm_sim.board.usb_bridge import FLUSH_CYCLES, PACKET_CYCLES
from planarm_sim.bridge.punctual import punctual

PROGRAM = Path(__file__).parents[1] / "tests" / "sim_board" / "data" / "echo.hex"
BAUD, BYTES, CLOCK_HZ = 250_000, 32, 16_000_000
WIRE_S = (BYTES + 1) * 10 / BAUD  # in and out; the last echo begins when the last byte has come
BOOT_S, PAUSE_S = 0.3, 0.02
GREETING_BYTES = 2
SEED = 1
LIMIT_MS = 1.0


@dataclass
class Line:
    """One process behind a terminal, and what its echoes took.

    Attributes:
        process: who answers.
        port: the host's end.
        log: file with the board's log of the line; None for the control.
        took_ms: each echo, by the clock.
        waiting_ms: for how much of it this process or `process` waited for a processor.
    """

    process: subprocess.Popen[str]
    port: serial.Serial
    log: Path | None
    took_ms: list[float] = field(default_factory=list)
    waiting_ms: list[float] = field(default_factory=list)


def main() -> None:
    """Measure the three and print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--echoes", type=int, default=2000, help="echoes of each kind (default: %(default)s)")
    parser.add_argument("--control", type=int, metavar="FD", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.control is not None:
        answer_as_control(options.control)
        return
    title = f"{options.echoes} echoes of {BYTES} bytes at {BAUD} baud, by the clock; ms"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    names = ("", "took, p50", "over, p50", "p99", "most", f"beyond {LIMIT_MS:g} ms", "without waiting, p99", "most")
    for name in names:
        table.add_column(name, justify="right" if name else "left")
    for name, (took_ms, over_ms, waiting_ms) in measure(options.echoes).items():
        own_ms = over_ms - waiting_ms
        figures = [np.median(took_ms), *np.percentile(over_ms, [50, 99, 100])]
        late = int(np.count_nonzero(over_ms > LIMIT_MS))
        table.add_row(name, *(f"{ms:.2f}" for ms in figures), str(late), *_two(np.percentile(own_ms, [99, 100])))
    Console().print(table)


def _two(values: NDArray[np.float64]) -> list[str]:
    return [f"{value:.2f}" for value in values]


def measure(count: int) -> dict[str, tuple[NDArray[np.float64], ...]]:
    """Echo `count` times on each line, in turn; returns by name what the echoes took, were over, and waited, ms."""
    chance = random.Random(SEED)
    with tempfile.TemporaryDirectory() as folder:
        with ExitStack() as stack:
            lines = {"control": stack.enter_context(control())}
            for usb in ("direct", "16u2"):
                lines[usb] = stack.enter_context(board(usb, Path(folder) / f"{usb}.csv"))
            time.sleep(BOOT_S)
            for line in lines.values():
                line.port.reset_input_buffer()
            with punctual():
                for _ in range(count):
                    for line in lines.values():
                        echo(line, chance)
        results = {}
        for name, line in lines.items():
            ideal_ms = 1e3 * np.full(count, WIRE_S) if line.log is None else perfect_ms(line.log, name, count)
            took_ms = np.array(line.took_ms)
            results[name] = took_ms, took_ms - ideal_ms, np.array(line.waiting_ms)
    return results


@contextmanager
def board(usb: str, log: Path) -> Iterator[Line]:
    """An emulated Uno with the program that echoes."""
    command = [sys.executable, "-m", "planarm_sim", str(PROGRAM), "--usb", usb, "--serial-log", str(log)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            with serial.Serial(process.stdout.readline().strip(), BAUD, timeout=5) as port:
                yield Line(process, port, log)
        finally:
            process.terminate()
            process.communicate()


@contextmanager
def control() -> Iterator[Line]:
    """A process that does what a board without any work would do."""
    master, slave = os.openpty()
    tty.setraw(slave)
    command = [sys.executable, __file__, "--control", str(master)]
    with subprocess.Popen(command, pass_fds=[master], text=True) as process:
        os.close(master)
        try:
            with serial.Serial(os.ttyname(slave), BAUD, timeout=5) as port:
                os.close(slave)
                yield Line(process, port, None)
        finally:
            process.terminate()


def answer_as_control(fd: int) -> None:
    """Wait for an echo's bytes, sleep for their time on the wire, send each plus one, for ever."""
    with punctual():
        while True:
            select.select([fd], [], [])
            answers_s = time.perf_counter() + WIRE_S
            data = os.read(fd, BYTES)
            select.select([], [], [], max(0.0, answers_s - time.perf_counter()))
            os.write(fd, bytes(byte + 1 for byte in data))


def echo(line: Line, chance: random.Random) -> None:
    """Send 32 bytes at some moment, wait for them, and note what it took."""
    text = bytes(chance.randrange(10, 250) for _ in range(BYTES))  # echo.S ends at 0 to 2, and adds one to the others
    time.sleep(PAUSE_S * chance.random())
    waited_ms = waited_for_processor_ms(line)
    start_s = time.perf_counter()
    line.port.write(text)
    answer = line.port.read(BYTES)
    line.took_ms.append((time.perf_counter() - start_s) * 1e3)
    line.waiting_ms.append(waited_for_processor_ms(line) - waited_ms)
    assert answer == bytes(byte + 1 for byte in text), "each byte came back"


def waited_for_processor_ms(line: Line) -> float:
    """Return for how long both ends of the line have stood ready to run, but did not; 0 where the system is silent."""
    waited_ns = 0
    for process in (str(line.process.pid), "self"):
        try:
            waited_ns += int(Path("/proc", process, "schedstat").read_text(encoding="ascii").split()[1])
        except FileNotFoundError:
            return 0.0
    return waited_ns / 1e6


def perfect_ms(log: Path, usb: str, count: int) -> NDArray[np.float64]:
    """Return from the board's log of the line how long after its first start bit each echo was due, ms."""
    with log.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    starts = [int(row["start_cycle"]) for row in rows if row["direction"] == "to board"]
    ends = [int(row["end_cycle"]) for row in rows if row["direction"] == "from board"]
    starts, ends = starts[-count * BYTES :: BYTES], ends[BYTES - 1 - count * BYTES :: BYTES]
    due = np.array(ends)
    if usb == "16u2":
        due = -(-due // FLUSH_CYCLES) * FLUSH_CYCLES + PACKET_CYCLES
    return np.asarray((due - np.array(starts)) / CLOCK_HZ * 1e3)


if __name__ == "__main__":
    main()
