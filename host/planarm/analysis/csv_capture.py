"""CSV exports of logic analysers: Saleae Logic 2 (a row a change, with its time) and sigrok (a row a sample)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planarm.analysis.capture import BLOCK_BYTES, PS_PER_S, Chunk, channel_indices
from planarm.analysis.csv_kernel import ERROR_AT, FIRST_LEVEL, parse_rows
from planarm.errors import CaptureError

MOST_CHANNELS = 64

_TIME_COLUMN = re.compile(r"time\s*(?:[\[(](s|ms|us|µs|ns|ps)[\])])?$", re.I)
_CHANNELS = re.compile(r"^;\s*Channels \(\d+/\d+\):\s*(.*)$", re.M)
_RATE = re.compile(r"^(?:;|META)\s*samplerate:\s*([\d.]+)\s*([kMG]?)(?:Hz)?\s*$", re.M | re.I)
_UNIT_PS = {"s": 10**12, "ms": 10**9, "us": 10**6, "µs": 10**6, "ns": 10**3, "ps": 1}
_FACTORS = {"": 1, "k": 10**3, "K": 10**3, "M": 10**6, "m": 10**6, "G": 10**9, "g": 10**9}


def is_csv(head: bytes) -> bool:
    """Tell whether a file that begins like this is a CSV export with a header."""
    lines = head.decode("utf-8", "replace").splitlines()
    return bool(lines) and (lines[0].startswith(";") or bool(_TIME_COLUMN.match(lines[0].split(",")[0].strip())))


@dataclass(frozen=True, slots=True)
class CsvCapture:
    """A CSV export.

    Attributes:
        path: the file.
        channels: the columns' names.
        resolution_ps: time between two samples, or 1 where a time column tells the moments.
        time_unit_ps: unit of the time column; 0 where rows are samples.
        rate_hz: samples a second; 0 where a time column tells the moments.
        data_offset: where the rows begin.
        first_line: the number of their first line.
    """

    path: Path
    channels: tuple[str, ...]
    resolution_ps: int
    time_unit_ps: int
    rate_hz: int
    data_offset: int
    first_line: int

    @classmethod
    def open(cls, path: Path, head: bytes) -> CsvCapture:
        """Read the header, which is all that stands before the first row of figures.

        Raises:
            CaptureError: it does not tell the times or the channels.
        """
        lines = head.decode("utf-8", "replace").splitlines(keepends=True)
        rows = [n for n, line in enumerate(lines) if re.match(r"\s*[-+.\d]", line)]
        if not rows:
            raise CaptureError(f"{path}: holds no row of figures")
        header = "".join(lines[: rows[0]])
        columns = [cell.strip().strip('"') for cell in lines[rows[0] - 1].split(",")] if rows[0] else []
        time = _TIME_COLUMN.match(columns[0]) if columns else None
        named = _CHANNELS.search(header)
        names = columns[1:] if time else columns
        if named and (not names or set(names) == {"logic"}):
            names = [name.strip() for name in named[1].split(",")]
        width = len(lines[rows[0]].split(",")) - (1 if time else 0)
        if len(names) != width or not 1 <= width <= MOST_CHANNELS:
            raise CaptureError(
                f"{path}: its header names {len(names)} channels, its rows have {width} (1 to {MOST_CHANNELS} are read)"
            )
        if time and not time[1]:
            raise CaptureError(
                f"{path}: its column {columns[0]!r} tells no unit (sigrok writes such a column, often all 0); "
                "export without the time column, the sample rate in the header is enough"
            )
        rate_hz = 0 if time else _rate_hz(path, header)
        offset = len("".join(lines[: rows[0]]).encode("utf-8", "replace"))
        unit_ps = _UNIT_PS[time[1].lower()] if time else 0
        return cls(path, tuple(names), 1 if unit_ps else PS_PER_S // rate_hz, unit_ps, rate_hz, offset, rows[0] + 1)

    def chunks(self, wanted: Sequence[str]) -> Iterator[Chunk]:
        """See `planarm.analysis.capture.Capture`."""
        indices = channel_indices(self.path, self.channels, wanted)
        slot = np.full(len(self.channels), -1, np.int16)
        slot[indices] = np.arange(len(indices))
        state = np.zeros(FIRST_LEVEL + len(self.channels), np.int64)
        state[FIRST_LEVEL:] = -1
        with self.path.open("rb") as file:
            file.seek(self.data_offset)
            rest = b""
            while block := file.read(BLOCK_BYTES) or (b"\n" if rest else b""):
                text = rest + block
                chunk, used = self._parse(text, slot, state)
                if len(chunk.times_ps):
                    yield chunk
                rest = text[used:]
                if block == b"\n":
                    return

    def _parse(self, text: bytes, slot: np.ndarray, state: np.ndarray) -> tuple[Chunk, int]:
        room = len(text) + len(slot)
        times, channels, levels = np.empty(room, np.int64), np.empty(room, np.uint8), np.empty(room, np.int16)
        count, used = parse_rows(
            np.frombuffer(text, np.uint8), slot, self.time_unit_ps, self.rate_hz, state, times, channels, levels
        )
        if state[ERROR_AT] > 0:
            line = self.first_line + int(state[ERROR_AT]) - 1
            raise CaptureError(f"{self.path}: line {line} is no row of {len(slot)} levels in order of time")
        return Chunk(times[:count], channels[:count], levels[:count]), used


def _rate_hz(path: Path, header: str) -> int:
    found = _RATE.search(header)
    rate_hz = round(float(found[1]) * _FACTORS[found[2]]) if found else 0
    if rate_hz < 1:
        raise CaptureError(f"{path}: has no time column, and its header names no sample rate")
    return rate_hz
