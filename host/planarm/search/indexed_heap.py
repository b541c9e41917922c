"""A binary heap of nodes with two-part keys, in which a node's key can be changed and a node be taken out.

The smallest key comes first, by the first part, then by the second.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import bare_kernel as kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Links = NDArray[np.int32]


class Heap(NamedTuple):
    """Room for n nodes."""

    nodes: Links
    """The nodes in heap order; shape (n,)."""
    place: Links
    """Where each node stands in the heap, -1 for nowhere; shape (n,)."""
    keys: Floats
    """The keys in heap order, beside the nodes; shape (n, 2)."""
    size: Ints
    """Shape (1,)."""


def new_heap(nodes: int) -> Heap:
    """Return an empty heap with room for so many nodes."""
    return Heap(np.zeros(nodes, np.int32), np.full(nodes, -1, np.int32), np.zeros((nodes, 2)), np.zeros(1, np.int64))


@kernel
def put(heap: Heap, node: int, first: float, second: float) -> None:
    """Insert a node, or change its key."""
    at = heap.place[node]
    if at < 0:
        at = heap.size[0]
        heap.size[0] += 1
    _settle(heap, node, first, second, at)


@kernel
def take_out(heap: Heap, node: int) -> None:
    """Take a node out, if it is in."""
    at = heap.place[node]
    if at < 0:
        return
    heap.place[node] = -1
    heap.size[0] -= 1
    last = heap.size[0]
    if at < last:
        _settle(heap, heap.nodes[last], heap.keys[last, 0], heap.keys[last, 1], at)


@kernel
def _settle(heap: Heap, node: int, first: float, second: float, at: int) -> None:
    """Put a node at a place whose own node has left it, and move it up or down to where it belongs."""
    nodes, place, keys, size = heap.nodes, heap.place, heap.keys, heap.size[0]
    while at > 0:
        parent = (at - 1) // 2
        if keys[parent, 0] < first or (keys[parent, 0] == first and keys[parent, 1] <= second):
            break
        above = nodes[parent]
        nodes[at], keys[at, 0], keys[at, 1], place[above] = above, keys[parent, 0], keys[parent, 1], at
        at = parent
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        other = child + 1
        if other < size and (
            keys[other, 0] < keys[child, 0] or (keys[other, 0] == keys[child, 0] and keys[other, 1] < keys[child, 1])
        ):
            child = other
        if keys[child, 0] > first or (keys[child, 0] == first and keys[child, 1] >= second):
            break
        below = nodes[child]
        nodes[at], keys[at, 0], keys[at, 1], place[below] = below, keys[child, 0], keys[child, 1], at
        at = child
    nodes[at], keys[at, 0], keys[at, 1], place[node] = node, first, second, at
