"""The open list of the best-first search: a ring of buckets of equal width in f, unsorted inside.

With a consistent heuristic f never falls along a path, so no entry ever has to go to a bucket that the search has left,
nor further ahead than two of the longest moves. Inside a bucket entries leave newest first, not by f: the search puts
up with that by expanding a node again when a better way to it turns up, and by finishing the goal's bucket before it
answers. Entries that a better one replaced are left where they are and passed over later.

The arrays are handed to the kernel one by one and entries are pushed and popped where they are made: Numba counts
references to every array at every call, which would take most of the search's time.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import kernel

Ints = NDArray[np.int64]
Indices = NDArray[np.int32]

NONE = -1
"""Stands for "no entry" and "no node"."""

MADE, WAITING, BUCKET, EXPANDED, BEST = range(5)
"""Places in `counts`: entries made, entries in buckets, number of the current bucket, expansions, and what the best way
to the goal costs, plus 1; 0 while none is known."""


class OpenList(NamedTuple):
    """Entries are numbered in the order of insertion."""

    node: Indices
    """Each entry's node."""
    below: Indices
    """The entry next in the same bucket, or NONE."""
    ring: Indices
    """Each bucket's newest entry, or NONE; as many buckets as a power of two."""
    counts: Ints


def make_open_list(buckets: int, node: Indices, below: Indices) -> OpenList:
    """Return an empty list with at least so many buckets, its entries in the given arrays of equal size."""
    return OpenList(node, below, np.full(buckets_for(buckets), NONE, np.int32), np.zeros(5, np.int64))


@kernel
def buckets_for(least: int) -> int:
    """Return the size of a ring with at least so many buckets: a power of two."""
    size = 2
    while size <= least + 1:
        size *= 2
    return size


@kernel
def twice_as_long(entries: Indices) -> Indices:
    """Return entries with room for as many more; those there are copied."""
    longer = np.empty(2 * entries.size, np.int32)
    for i in range(entries.size):
        longer[i] = entries[i]
    return longer
