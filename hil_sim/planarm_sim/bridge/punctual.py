"""Asks the system to wake this thread in time, as a board behind a terminal must be.

Three things make a thread late, and each can be asked away without any right:

- Linux may put off a sleeper's end by its timer slack, 50 us unless told otherwise (prctl(2), PR_SET_TIMERSLACK).
- A thread that wakes while another computes waits until that one has used up its slice of some milliseconds. One that
  asks for short slices comes first (sched_setattr(2), `sched_runtime` of a thread under SCHED_OTHER; Linux 6.12 and
  later, older ones ignore it). Its share of the processor stays the same.
- Python's garbage collector goes through every object that was ever made: milliseconds, once compilers are loaded.
  Objects that are frozen are passed over.

Where one of them cannot be had, the others still help.
"""

from __future__ import annotations

import ctypes
import gc
import platform
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

__all__ = ["punctual"]

SLICE_NS: Final = 100_000
"""The shortest that the kernel grants; a step of the bridge takes less."""

PR_SET_TIMERSLACK, PR_GET_TIMERSLACK, LEAST_SLACK_NS = 29, 30, 1
SCHED_OTHER: Final = 0
SCHED_ATTR: Final = struct.Struct("IIQiIQQQ")
"""struct sched_attr, first version: size, policy, flags, nice, priority, runtime, deadline, period."""
_NUMBERS: Final = {"x86_64": (314, 315), "aarch64": (274, 275), "riscv64": (274, 275)}
"""Of the calls sched_setattr and sched_getattr, which the C library does not wrap."""


@contextmanager
def punctual() -> Iterator[None]:
    """Have the calling thread woken in time until the context ends."""
    gc.collect()
    gc.freeze()
    slack_ns, slice_ns = _set_slack(LEAST_SLACK_NS), _set_slice(SLICE_NS)
    try:
        yield
    finally:
        gc.unfreeze()
        if slack_ns is not None:
            _set_slack(slack_ns)
        if slice_ns is not None:
            _set_slice(slice_ns)


def _set_slack(slack_ns: int) -> int | None:
    """Set the thread's timer slack; returns what it was, None where there is no such thing."""
    if sys.platform != "linux":
        return None
    libc = ctypes.CDLL(None)
    before = int(libc.prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0))
    return before if before >= 0 and libc.prctl(PR_SET_TIMERSLACK, ctypes.c_ulong(slack_ns), 0, 0, 0) == 0 else None


def _set_slice(slice_ns: int) -> int | None:
    """Ask for slices of that length, 0 for the usual ones; returns what was asked for before, None if nobody hears."""
    numbers = _NUMBERS.get(platform.machine()) if sys.platform == "linux" else None
    if numbers is None:
        return None
    libc = ctypes.CDLL(None)
    attributes = ctypes.create_string_buffer(SCHED_ATTR.size)
    if libc.syscall(numbers[1], 0, attributes, SCHED_ATTR.size, 0) != 0:
        return None
    size, policy, flags, nice, priority, before, *rest = SCHED_ATTR.unpack(attributes.raw)
    if policy != SCHED_OTHER:  # whoever chose another knows why
        return None
    asked = SCHED_ATTR.pack(size, policy, flags, nice, priority, slice_ns, *rest)
    return int(before) if libc.syscall(numbers[0], 0, asked, 0) == 0 else None
