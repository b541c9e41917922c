"""Work beside a stream: something is computed while a loop goes on that must not wait for it."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol, TypeVar

from planarm.errors import PlanarmError

T = TypeVar("T")

ALLOWED = 2.0
"""How many times as long as before work beside a stream may take."""


class Beside(Protocol):
    """Does one piece of work after the other; times are those of the stream's clock."""

    def allow_s(self, known_s: float) -> float:
        """Return how long to allow for work like one that took `known_s`."""
        ...

    def begin(self, work: Callable[[], T], now_s: float) -> Future[T]:
        """Begin; the work before has ended."""
        ...

    def has_ended(self, work: Future[T], now_s: float) -> bool:
        """Tell whether its result can be asked for by now."""
        ...

    def close(self) -> None:
        """Wait for what is under way."""
        ...


class _Garbage:
    """Leaves what is alive out of the search for garbage until the last one that asked for it asks no more."""

    def __init__(self) -> None:
        self._lock, self._asking = threading.Lock(), 0

    def leave_out(self) -> None:
        """Leave out all that is alive now."""
        with self._lock:
            self._asking += 1
            gc.freeze()

    def look_again(self) -> None:
        """Ask no more; once for each time that it was asked for."""
        with self._lock:
            self._asking -= 1
            if self._asking == 0:
                gc.unfreeze()


_garbage = _Garbage()
"""The process's: Python knows one search, and one set of what is left out of it."""


class InThread:
    """In a thread of its own: for boards, whose time goes on meanwhile.

    What is alive when it is made is left out of the search for garbage until it is closed: a search through all of a
    roadmap and its plans holds every thread, the stream's too, for 0.1 to 0.2 s.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1)
        self._closed = False
        _garbage.leave_out()

    def allow_s(self, known_s: float) -> float:
        """Return so many times as long: the stream goes on meanwhile."""
        return ALLOWED * known_s

    def begin(self, work: Callable[[], T], now_s: float) -> Future[T]:
        """Begin."""
        return self._pool.submit(work)

    def has_ended(self, work: Future[T], now_s: float) -> bool:
        """Tell whether it is done."""
        return work.done()

    def close(self) -> None:
        """Wait for what is under way; a second time there is nothing to do."""
        self._pool.shutdown()
        if not self._closed:
            self._closed = True
            _garbage.look_again()


class AsLong:
    """At once, in a clock's time that stands still meanwhile; the result is held back as long as it would have taken.

    So an emulated arm goes on moving while its next motion is planned, as a real one does.

    Args:
        host_s: a clock of the host's, by which the work is timed.
        takes_s: what all work is said to take, where runs have to be the same each time.
    """

    def __init__(self, host_s: Callable[[], float], takes_s: float | None = None) -> None:
        self._host_s, self._takes_s = host_s, takes_s
        self._ends_s = 0.0

    def allow_s(self, known_s: float) -> float:
        """Return what it is said to take, or so many times as long."""
        return ALLOWED * known_s if self._takes_s is None else self._takes_s

    def begin(self, work: Callable[[], T], now_s: float) -> Future[T]:
        """Do it."""
        began_s, future = self._host_s(), Future[T]()
        try:
            future.set_result(work())
        except PlanarmError as error:
            future.set_exception(error)  # raised where the result is asked for
        self._ends_s = now_s + (self._host_s() - began_s if self._takes_s is None else self._takes_s)
        return future

    def has_ended(self, work: Future[T], now_s: float) -> bool:
        """Tell whether the time has come."""
        return now_s >= self._ends_s

    def close(self) -> None:
        """Nothing is under way."""
