"""Recordings of digital lines, whatever made them, as chunks of edges in order of time.

A capture is read in chunks of a few megabytes, so a hundred million edges need no more memory than ten thousand.
Times are whole picoseconds: a clock cycle of the Uno is 62,500 of them, and 2^63 are 106 days.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from planarm.errors import CaptureError

Times = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]
Levels = npt.NDArray[np.int16]

PS_PER_S = 10**12
PS_PER_TICK = 62_500
BLOCK_BYTES = 1 << 22

UNKNOWN = -1
"""Level of a line that is not known, or floats."""


@dataclass(frozen=True, slots=True, eq=False)
class Chunk:
    """Edges that follow each other.

    Attributes:
        times_ps: moment of each edge, ascending, int64[n].
        channels: which channel changed, as its place in the list that was asked for, uint8[n].
        levels: its value from then on, int16[n]; a line of several bits has a number, UNKNOWN is x or z.
    """

    times_ps: Times
    channels: Bytes
    levels: Levels


class Capture(Protocol):
    """An opened recording; `chunks` may be called again and reads the file anew."""

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of what was recorded."""

    @property
    def resolution_ps(self) -> int:
        """The file's unit of time."""

    def chunks(self, wanted: Sequence[str]) -> Iterator[Chunk]:
        """Yield the edges of the wanted channels; each one's level at the start comes first, where the file tells it.

        Raises:
            CaptureError: the file is damaged; the message names the place.
        """


def open_capture(path: Path) -> Capture:
    """Open a VCD or CSV recording; its content, not its name, tells which it is.

    Raises:
        CaptureError: it cannot be read, or is neither.
    """
    # Imported here: both readers import this file's values.
    from planarm.analysis.csv_capture import CsvCapture, is_csv  # noqa: PLC0415
    from planarm.analysis.vcd_capture import VcdCapture, is_vcd  # noqa: PLC0415

    try:
        with path.open("rb") as file:
            head = file.read(1 << 16)
    except OSError as error:
        raise CaptureError(f"{path}: cannot be read: {error.strerror}") from error
    if is_vcd(head):
        return VcdCapture.open(path)
    if is_csv(head):
        return CsvCapture.open(path, head)
    raise CaptureError(
        f"{path}: is neither a value change dump (VCD) nor a CSV export of Saleae Logic 2 or sigrok; "
        "export the capture as one of them"
    )


def channel_indices(path: Path, channels: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Return where the wanted channels are among those recorded.

    Raises:
        CaptureError: one is not there.
    """
    for name in wanted:
        if name not in channels:
            raise CaptureError(f"{path}: has no channel {name!r}; it has {', '.join(channels)}")
    return [list(channels).index(name) for name in wanted]
