"""The open list of the best-first search: a queue ordered by f that costs little at the far end.

Entries wait unsorted in buckets of equal width in f and enter a binary heap only when the search reaches their
bucket. They leave exactly as from one heap over all of them (lowest f first, among equal f the newest), but entries
that are never reached, or whose node was closed meanwhile, are never sorted. The buckets form a ring: with a
consistent heuristic no entry lies further than two of the longest moves above the one being expanded.

Kernels get the arrays one by one, and each kernel is one flat function: Numba counts references to every array at
every call, and with small helpers or a tuple of arrays that took most of the search's time.
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
    size = 1 << int(buckets + 2.0).bit_length()
    f_cm, node, below, heap = np.empty(capacity), *(np.empty(capacity, np.int64) for _ in range(3))
    return OpenList(f_cm, node, below, heap, np.full(size, NONE, np.int64), np.zeros(4, np.int64))


def with_more_room(queue: OpenList) -> OpenList:
    """Return a copy of `queue` with twice the capacity; bucket ring and counts are shared."""
    larger = (np.concatenate((values, np.empty_like(values))) for values in queue[:4])
    return OpenList(*larger, queue.ring, queue.counts)


@kernel
def push(f_cm: Floats, node: Ints, below: Ints, ring: Ints, counts: Ints, bucket: int, f: float, new: int) -> None:
    """Add an entry for the node `new` to a bucket not below the current one; there must be room for it."""
    entry = counts[MADE]
    place = max(bucket, counts[BUCKET]) & (ring.size - 1)  # below the current one only by rounding
    f_cm[entry], node[entry], below[entry] = f, new, ring[place]
    ring[place] = entry
    counts[MADE] += 1
    counts[WAITING] += 1


@kernel
def pop(f_cm: Floats, node: Ints, below: Ints, heap: Ints, ring: Ints, counts: Ints, closed: NDArray[np.uint8]) -> int:
    """Remove the best entry whose node is not marked in `closed`; return its node, or NONE when there is none."""
    size, waiting, bucket = counts[IN_HEAP], counts[WAITING], counts[BUCKET]
    mask = ring.size - 1
    best = NONE
    while best == NONE and size + waiting > 0:
        entry = ring[bucket & mask]
        ring[bucket & mask] = NONE
        while entry != NONE:  # move the current bucket's entries into the heap
            waiting -= 1
            if not closed[node[entry]]:
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
        best = node[heap[0]]
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
        if closed[best]:
            best = NONE
    counts[IN_HEAP], counts[WAITING], counts[BUCKET] = size, waiting, bucket
    return best
