"""A binary heap of nodes with two-part keys, in which a node's key can be changed and a node be taken out.

The smallest key comes first, by the first part, then by the second.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import bare_kernel as kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Heap(NamedTuple):
    """Room for n nodes."""

    nodes: Ints
    """The nodes in heap order; shape (n,)."""
    place: Ints
    """Where each node stands in the heap, -1 for nowhere; shape (n,)."""
    keys: Floats
    """Each node's key, valid while it is in the heap; shape (n, 2)."""
    size: Ints
    """Shape (1,)."""


def new_heap(nodes: int) -> Heap:
    """Return an empty heap with room for so many nodes."""
    return Heap(np.empty(nodes, np.int64), np.full(nodes, -1, np.int64), np.empty((nodes, 2)), np.zeros(1, np.int64))


@kernel
def put(heap: Heap, node: int, first: float, second: float) -> None:
    """Insert a node, or change its key."""
    at = heap.place[node]
    if at < 0:
        at = heap.size[0]
        heap.size[0] += 1
    heap.keys[node, 0], heap.keys[node, 1] = first, second
    _settle(heap, node, at)


@kernel
def take_out(heap: Heap, node: int) -> None:
    """Take a node out, if it is in."""
    at = heap.place[node]
    if at < 0:
        return
    heap.place[node] = -1
    heap.size[0] -= 1
    if at < heap.size[0]:
        _settle(heap, heap.nodes[heap.size[0]], at)


@kernel
def _settle(heap: Heap, node: int, at: int) -> None:
    """Put a node at a place whose own node has left it, and move it up or down to where it belongs."""
    nodes, place, keys, size = heap.nodes, heap.place, heap.keys, heap.size[0]
    first, second = keys[node, 0], keys[node, 1]
    while at > 0:
        parent = (at - 1) // 2
        above = nodes[parent]
        if keys[above, 0] < first or (keys[above, 0] == first and keys[above, 1] <= second):
            break
        nodes[at], place[above] = above, at
        at = parent
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        below = nodes[child]
        if child + 1 < size:
            other = nodes[child + 1]
            if keys[other, 0] < keys[below, 0] or (
                keys[other, 0] == keys[below, 0] and keys[other, 1] < keys[below, 1]
            ):
                child, below = child + 1, other
        if keys[below, 0] > first or (keys[below, 0] == first and keys[below, 1] >= second):
            break
        nodes[at], place[below] = below, at
        at = child
    nodes[at], place[node] = node, at
