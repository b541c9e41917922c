"""The frames of a serial line as a table that spreadsheets and scripts read."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from planarm_sim.errors import TraceError

__all__ = ["write_serial_log"]

CLOCK_MHZ = 16
HEADER = ("start_cycle", "end_cycle", "start_us", "direction", "byte", "character")
DIRECTIONS = ("to board", "from board")


def write_serial_log(path: str | Path, log: NDArray[Any]) -> None:
    """Write the frames of `SerialPort.log`, one a line: cycles of start bit and end, direction, byte, character.

    Raises:
        TraceError: the file cannot be written.
    """
    rows = [
        (start, end, f"{start / CLOCK_MHZ:.4f}", DIRECTIONS[direction], f"0x{byte:02X}", _printed(byte))
        for start, end, direction, byte in log.tolist()
    ]
    try:
        with Path(path).open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([HEADER, *rows])
    except OSError as error:
        raise TraceError(f"{path}: cannot be written: {error.strerror}") from error


def _printed(byte: int) -> str:
    return chr(byte) if 0x21 <= byte < 0x7F else ""
