"""The four queues behind the state array: frames sent, edges, frames to receive, outside drives.

Kernels take entries out of the last two and append to the first two, the logs. When one of these is nearly full the
CPU loop ends, and what they hold is set aside (see `logs`). The others grow as they are filled, from outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import layout as at
from planarm_sim.cpu.layout import State
from planarm_sim.cpu.tables import CONSTANT_WORDS

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


_EMPTY = np.empty(0, dtype=np.int64)


def contents(st: State) -> tuple[NDArray[np.int64], ...]:
    """Copy the entries in use of every queue."""
    spans = [queue.span(st) for queue in ALL]
    return tuple(st[begin:end].copy() if end > begin else _EMPTY for begin, end in spans)


def allocate(state: State, entries: tuple[NDArray[np.int64], ...]) -> State:
    """Build an array of `state`'s words up to the queues, and queues with room around `entries`."""
    sizes = [_room(len(content) // queue.width) * queue.width for queue, content in zip(ALL, entries, strict=True)]
    st = np.zeros(at.QUEUES + sum(sizes), dtype=np.int64)
    st[: at.QUEUES] = state[: at.QUEUES]
    st[at.CONSTANTS : at.CONSTANTS + len(CONSTANT_WORDS)] = CONSTANT_WORDS
    base = at.QUEUES
    for queue, content, size in zip(ALL, entries, sizes, strict=True):
        st[queue.base] = base
        if queue.limit is not None:
            st[queue.limit] = size // queue.width - LOG_MARGIN
        _fill(st, queue, content)
        base += size
    return st


def in_use(st: State) -> bool:
    """Tell whether any queue has entries."""
    tx, edges, rx_head, rx_tail, in_head, in_tail = st[at.TX_COUNT : at.IN_TAIL + 1].tolist()
    return bool(tx or edges or rx_tail > rx_head or in_tail > in_head)


def refill(st: State, state: State, entries: tuple[NDArray[np.int64], ...]) -> State:
    """Put `state`'s words and the queues' entries into `st`; returns the array to use, a larger one if need be.

    Without `entries`, the queues are empty.
    """
    if not entries:
        st[: len(state)] = state
        st[at.TX_COUNT : at.IN_TAIL + 1] = 0
        return st
    ends = [int(st[queue.base]) for queue in ALL[1:]] + [len(st)]
    spans = [int(st[queue.base]) + len(content) for queue, content in zip(ALL, entries, strict=True)]
    if any(span > end for span, end in zip(spans, ends, strict=True)):
        return allocate(np.concatenate((state, st[len(state) : at.QUEUES])), entries)
    st[: len(state)] = state
    for queue, content in zip(ALL, entries, strict=True):
        _fill(st, queue, content)
    return st


def _fill(st: State, queue: Queue, content: NDArray[np.int64]) -> None:
    base = int(st[queue.base])
    st[base : base + len(content)] = content
    if queue.head is not None:
        st[queue.head] = 0
    st[queue.tail] = len(content) // queue.width


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
