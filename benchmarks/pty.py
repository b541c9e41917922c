"""How long an echo takes through the emulated Uno's terminal: `./dev bench pty [--echoes N]`.

A program that sends back each byte runs in a process of its own, in real time at 250,000 baud; this process writes 32
bytes to its terminal and waits for them to come back. On the wire they take 33 byte times: the last echo begins when
the last byte has come. "over" is what an echo took beyond that and, with the USB bridge, beyond the longest that the
bridge holds bytes: a tick of 4.096 ms and a packet of 53 us.
"""

import argparse
import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import serial
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

PROGRAM = Path(__file__).parents[1] / "tests" / "sim_board" / "data" / "echo.hex"
BAUD, BYTES = 250_000, 32
WIRE_MS = (BYTES + 1) * 10 / BAUD * 1e3
BRIDGE_MS = {"direct": 0.0, "16u2": 4.096 + 1 / 19}
BOOT_S, PAUSE_S = 0.3, 0.02
SEED = 1


def main() -> None:
    """Measure both kinds of line and print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--echoes", type=int, default=300, help="echoes of each kind (default: %(default)s)")
    count = parser.parse_args().echoes
    title = f"{count} echoes of {BYTES} bytes at {BAUD} baud, by the clock; ms"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for name in ("line", "on the wire", "held at most", "p50", "p99", "most", "over, p50", "over, p99"):
        table.add_column(name, justify="left" if name == "line" else "right")
    for usb, held_ms in BRIDGE_MS.items():
        took_ms = echoes(usb, count)
        p50, p99, most = np.percentile(took_ms, [50, 99, 100])
        over = np.percentile(took_ms - WIRE_MS - held_ms, [50, 99])
        table.add_row(usb, *(f"{value:.2f}" for value in (WIRE_MS, held_ms, p50, p99, most, *over)))
    Console().print(table)


def echoes(usb: str, count: int) -> NDArray[np.float64]:
    """Echo `count` times; returns what each took, ms."""
    command = [sys.executable, "-m", "planarm_sim", str(PROGRAM), "--usb", usb]
    chance = random.Random(SEED)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as board:
        assert board.stdout is not None
        try:
            with serial.Serial(board.stdout.readline().strip(), BAUD, timeout=5) as port:
                time.sleep(BOOT_S)
                port.reset_input_buffer()
                return np.array([echo(port, chance) for _ in range(count)])
        finally:
            board.terminate()
            board.communicate()


def echo(port: serial.Serial, chance: random.Random) -> float:
    """Send 32 bytes at some moment and wait for them; returns ms."""
    text = bytes(chance.randrange(10, 250) for _ in range(BYTES))  # echo.S ends at 0 to 2, and adds one to the others
    time.sleep(PAUSE_S * chance.random())
    start = time.perf_counter()
    port.write(text)
    answer = port.read(BYTES)
    took_ms = (time.perf_counter() - start) * 1e3
    assert answer == bytes(byte + 1 for byte in text), "each byte came back"
    return took_ms


if __name__ == "__main__":
    main()
