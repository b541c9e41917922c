"""Clocks: where the link gets its time from.

Everything in the link that waits asks a `Clock`, so a run on the emulator takes virtual time and a test takes none.
Times are seconds on the clock's own scale; only differences mean something.
"""

import threading
import time
from typing import Protocol


class Clock(Protocol):
    """A time scale that can be read and waited on."""

    def now_s(self) -> float:
        """Time in seconds; never goes back."""
        ...

    def wait_until(self, t_s: float) -> None:
        """Return once `now_s()` is at least `t_s`; at once when it already is."""
        ...


class RealClock:
    """The computer's monotonic clock."""

    def now_s(self) -> float:
        """Seconds on the monotonic clock."""
        return time.monotonic()

    def wait_until(self, t_s: float) -> None:
        """Sleep until `t_s`."""
        while (remaining_s := t_s - time.monotonic()) > 0.0:
            time.sleep(remaining_s)


class VirtualClock:
    """A clock that stands still while anyone works and jumps when all its parties wait.

    `parties` is the number of threads that use the clock. When the last of them waits, the time jumps to the earliest
    of the moments waited for; so a program with one party never waits at all.
    """

    def __init__(self, parties: int = 1, start_s: float = 0.0) -> None:
        if parties < 1:
            raise ValueError(f"a virtual clock needs at least one party, not {parties}")
        self._parties = parties
        self._now_s = start_s
        self._wake_s: list[float] = []
        self._changed = threading.Condition()

    def now_s(self) -> float:
        """Virtual seconds."""
        with self._changed:
            return self._now_s

    def wait_until(self, t_s: float) -> None:
        """Wait for `t_s`; the last party to wait makes the time jump."""
        with self._changed:
            if t_s <= self._now_s:
                return
            self._wake_s.append(t_s)
            self._jump_when_all_wait()
            self._changed.wait_for(lambda: self._now_s >= t_s)

    def leave(self) -> None:
        """Take one party off, for a thread that ends while others still wait."""
        with self._changed:
            self._parties -= 1
            self._jump_when_all_wait()

    def _jump_when_all_wait(self) -> None:
        if self._wake_s and len(self._wake_s) >= self._parties:
            self._now_s = min(self._wake_s)
            self._wake_s = [wake_s for wake_s in self._wake_s if wake_s > self._now_s]
            self._changed.notify_all()
