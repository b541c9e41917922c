"""What the bridge needs from the host's side: a line of bytes and a clock. Both are injected."""

from __future__ import annotations

import time
from typing import Protocol

__all__ = ["Clock", "Line", "WallClock"]


class Clock(Protocol):
    """Tells the time."""

    def now_s(self) -> float:
        """Seconds since some fixed moment; never runs backwards."""
        ...


class WallClock:
    """The computer's monotonic clock."""

    def now_s(self) -> float:
        """Seconds since some fixed moment."""
        return time.monotonic()


class Line(Protocol):
    """The board's end of a byte line that hosts open and close."""

    def is_open(self) -> bool:
        """Tell whether a host has the line open, or has closed it with bytes still to be read."""
        ...

    def opened(self) -> bool:
        """Tell whether a host has opened the line since the last call, also if it has closed it again."""
        ...

    def baud(self) -> int | None:
        """Rate that the host has set, bits a second; None where that cannot be told."""
        ...

    def keeps_dtr(self) -> bool:
        """Tell whether the host's system leaves DTR up when the host closes the line."""
        ...

    def read(self, most: int) -> bytes:
        """Take up to `most` bytes that the host sent; b"" when there are none now."""
        ...

    def write(self, data: bytes) -> int:
        """Hand bytes to the host; returns how many fitted into its buffer."""
        ...

    def wait(self, timeout_s: float, *, for_bytes: bool) -> bool:
        """Sleep for `timeout_s`, or, when `for_bytes`, until the host sends or closes, if that comes first.

        Returns whether something happened on the line; a line that cannot tell says True.
        """
        ...
