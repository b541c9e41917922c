"""Binary heaps for kernels: of numbered entries by a key of their own, and of pairs of a key and a node."""

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel
def rise(heap: Ints, size: int, entry: int, key_of: Floats) -> None:
    """Put an entry into a heap of `size` entries with the least key first."""
    place = size
    while place > 0 and key_of[heap[(place - 1) >> 1]] > key_of[entry]:
        heap[place] = heap[(place - 1) >> 1]
        place = (place - 1) >> 1
    heap[place] = entry


@kernel
def sink(heap: Ints, size: int, entry: int, key_of: Floats) -> None:
    """Put an entry at the top of a heap that keeps `size` entries with it: the first was taken, or is replaced."""
    place, child = 0, 1
    while child < size:
        if child + 1 < size and key_of[heap[child + 1]] < key_of[heap[child]]:
            child += 1
        if key_of[entry] <= key_of[heap[child]]:
            break
        heap[place] = heap[child]
        place, child = child, 2 * child + 1
    heap[place] = entry


@kernel
def insert(heap_f: Floats, heap_node: Ints, size: int, f: float, node: int) -> None:
    """Put a pair into a heap of `size` pairs."""
    place = size
    while place > 0 and heap_f[(place - 1) >> 1] > f:
        heap_f[place], heap_node[place] = heap_f[(place - 1) >> 1], heap_node[(place - 1) >> 1]
        place = (place - 1) >> 1
    heap_f[place], heap_node[place] = f, node


@kernel
def remove_first(heap_f: Floats, heap_node: Ints, size: int) -> int:
    """Take the first pair off a heap; return the number of pairs left."""
    size -= 1
    f, node, place, child = heap_f[size], heap_node[size], 0, 1
    while child < size:
        if child + 1 < size and heap_f[child + 1] < heap_f[child]:
            child += 1
        if heap_f[child] >= f:
            break
        heap_f[place], heap_node[place] = heap_f[child], heap_node[child]
        place, child = child, 2 * child + 1
    heap_f[place], heap_node[place] = f, node
    return size
