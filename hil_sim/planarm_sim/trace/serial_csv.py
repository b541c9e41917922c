"""The frames of a serial line as a table that spreadsheets and scripts read."""

from __future__ import annotations

import csv
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from numpy.typing import NDArray

from planarm_sim.errors import TraceError

__all__ = ["SerialCsvWriter", "write_serial_log"]

CLOCK_MHZ = 16
HEADER = ("start_cycle", "end_cycle", "start_us", "direction", "byte", "character")
DIRECTIONS = ("to board", "from board")


class SerialCsvWriter:
    """Writes frames as they come, one a line: cycles of start bit and end, direction, byte, character.

    Raises:
        TraceError: the file cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        try:
            self._file: IO[str] = Path(path).open("w", encoding="utf-8", newline="")  # noqa: SIM115 - closed in close()
        except OSError as error:
            raise TraceError(f"{path}: cannot be written: {error.strerror}") from error
        self._rows = csv.writer(self._file, lineterminator="\n")
        self._rows.writerow(HEADER)

    def write(self, log: NDArray[Any]) -> None:
        """Write frames of `SerialPort.log`."""
        for start, end, direction, byte in log.tolist():
            micros = f"{start / CLOCK_MHZ:.4f}"
            self._rows.writerow((start, end, micros, DIRECTIONS[direction], f"0x{byte:02X}", _printed(byte)))

    def close(self) -> None:
        """Write what is left."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def write_serial_log(path: str | Path, log: NDArray[Any]) -> None:
    """Write the frames of `SerialPort.log` as a file of their own.

    Raises:
        TraceError: the file cannot be written.
    """
    with SerialCsvWriter(path) as writer:
        writer.write(log)


def _printed(byte: int) -> str:
    return chr(byte) if 0x21 <= byte < 0x7F else ""
