"""The four queues behind the state array: frames sent, edges, frames to receive, outside drives.

Kernels take entries out of the last two and append to the first two. When one of these is nearly full the CPU
loop ends, Python moves everything into a larger array and goes on, so that no event is ever lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import layout as at
from planarm_sim.cpu.layout import State

FIRST_ENTRIES = 4096
LOG_MARGIN = 256
"""Entries that one instruction, and the events before the loop looks again, may still append."""


@dataclass(frozen=True, slots=True)
class Queue:
    """Where the state says where a queue is; a log has no head."""

    base: int
    width: int
    head: int | None
    tail: int
    limit: int | None

    def span(self, st: State) -> tuple[int, int]:
        """First and last word (exclusive) of the entries in use."""
        base = int(st[self.base])
        first = 0 if self.head is None else int(st[self.head])
        return base + first * self.width, base + int(st[self.tail]) * self.width


TX = Queue(at.TX_BASE, at.TX_WIDTH, None, at.TX_COUNT, at.TX_LIMIT)
EDGES = Queue(at.EDGE_BASE, 1, None, at.EDGE_COUNT, at.EDGE_LIMIT)
RX = Queue(at.RX_BASE, at.RX_WIDTH, at.RX_HEAD, at.RX_TAIL, None)
DRIVES = Queue(at.IN_BASE, 1, at.IN_HEAD, at.IN_TAIL, None)
ALL = (TX, EDGES, RX, DRIVES)


def contents(st: State) -> tuple[NDArray[np.int64], ...]:
    """Copy the entries in use of every queue."""
    return tuple(st[slice(*queue.span(st))].copy() for queue in ALL)


def allocate(state: State, entries: tuple[NDArray[np.int64], ...]) -> State:
    """Build an array of `state`'s words up to the queues, and queues with room around `entries`."""
    sizes = [_room(len(content) // queue.width) * queue.width for queue, content in zip(ALL, entries, strict=True)]
    st = np.zeros(at.QUEUES + sum(sizes), dtype=np.int64)
    st[: at.QUEUES] = state[: at.QUEUES]
    st[at.CONSTANTS : at.QUEUES] = np.arange(256)
    base = at.QUEUES
    for queue, content, size in zip(ALL, entries, sizes, strict=True):
        st[queue.base] = base
        st[base : base + len(content)] = content
        if queue.head is not None:
            st[queue.head] = 0
        st[queue.tail] = len(content) // queue.width
        if queue.limit is not None:
            st[queue.limit] = size // queue.width - LOG_MARGIN
        base += size
    return st


def _room(entries: int) -> int:
    """Entries to make room for: a power of two, and at least twice what is there."""
    return FIRST_ENTRIES << max(0, (2 * entries // FIRST_ENTRIES).bit_length())


def append(st: State, queue: Queue, entry: tuple[int, ...]) -> State:
    """Append an entry; returns the array to use from now on, a larger one where there was no room."""
    end_of_room = int(st[at.IN_BASE]) if queue is RX else len(st)
    if queue.span(st)[1] == end_of_room:
        st = allocate(st, contents(st))
    end = queue.span(st)[1]
    st[end : end + queue.width] = entry
    st[queue.tail] += 1
    return st
