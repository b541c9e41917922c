"""The open list of the best-first search: a queue ordered by f that costs little at the far end.

Entries wait unsorted in buckets of equal width in f and enter a binary heap only when the search reaches their
bucket. They leave exactly as from one heap over all of them (lowest f first, among equal f the newest), but entries
that are never reached, or that a better one replaced meanwhile, are never sorted. The buckets form a ring: with a
consistent heuristic no entry lies further than two of the longest moves above the one being expanded.

The kernel gets the arrays one by one and is one flat function, and entries are pushed where they are made: Numba
counts references to every array at every call, and with small functions that took most of the search's time.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NONE = -1
"""Stands for "no entry" and "no node"."""

MADE, IN_HEAP, WAITING, BUCKET = range(4)
"""Places in `counts`: entries made so far, in the heap, waiting in buckets; number of the current bucket."""


class OpenList(NamedTuple):
    """Entries are numbered in the order of insertion."""

    f_cm: Floats
    """Each entry's f."""
    node: Ints
    """Each entry's node."""
    below: Ints
    """The entry next in the same bucket, or NONE."""
    heap: Ints
    """Entries of the current bucket in heap order."""
    ring: Ints
    """Each bucket's first entry, or NONE; as many buckets as a power of two."""
    counts: Ints


def make_open_list(buckets: float, capacity: int) -> OpenList:
    """Return an empty list with room for `capacity` entries and at least so many buckets."""
    return OpenList(
        f_cm=np.empty(capacity),
        node=np.empty(capacity, np.int64),
        below=np.empty(capacity, np.int64),
        heap=np.empty(capacity, np.int64),
        ring=np.full(1 << int(buckets + 2.0).bit_length(), NONE, np.int64),
        counts=np.zeros(4, np.int64),
    )


def with_more_room(queue: OpenList) -> OpenList:
    """Return a copy of `queue` with twice the capacity; bucket ring and counts are shared."""
    larger = make_open_list(0.0, 2 * queue.node.size)
    for new, old in zip(larger[:4], queue[:4], strict=True):
        new[: old.size] = old
    return larger._replace(ring=queue.ring, counts=queue.counts)


@kernel
def pop(f_cm: Floats, node: Ints, below: Ints, heap: Ints, ring: Ints, counts: Ints, live: Ints) -> int:
    """Remove the best entry that is the live one of its node; return the node, or NONE when there is no such entry.

    `live` has for each node the entry that counts: the newest, none of them once the node is closed.
    """
    size, waiting, bucket = counts[IN_HEAP], counts[WAITING], counts[BUCKET]
    mask = ring.size - 1
    best = NONE
    while best == NONE and size + waiting > 0:
        entry = ring[bucket & mask]
        ring[bucket & mask] = NONE
        while entry != NONE:  # move the current bucket's entries into the heap
            waiting -= 1
            if live[node[entry]] == entry:
                place = size
                size += 1
                while place > 0:
                    above = heap[(place - 1) >> 1]
                    if f_cm[above] < f_cm[entry] or (f_cm[above] == f_cm[entry] and above > entry):
                        break
                    heap[place] = above
                    place = (place - 1) >> 1
                heap[place] = entry
            entry = below[entry]
        if size == 0:
            bucket += 1
            continue
        top = heap[0]
        best = node[top]
        size -= 1
        last = heap[size]
        place, child = 0, 1
        while child < size:  # let the heap's last entry sink from the top
            if child + 1 < size:
                left, right = heap[child], heap[child + 1]
                if f_cm[right] < f_cm[left] or (f_cm[right] == f_cm[left] and right > left):
                    child += 1
            lower = heap[child]
            if f_cm[last] < f_cm[lower] or (f_cm[last] == f_cm[lower] and last > lower):
                break
            heap[place] = lower
            place, child = child, 2 * child + 1
        heap[place] = last
        if live[best] != top:
            best = NONE
    counts[IN_HEAP], counts[WAITING], counts[BUCKET] = size, waiting, bucket
    return best
