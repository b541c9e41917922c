"""Memory that searches use one after the other: fresh pages cost more than the search itself on fine maps.

Each thread has its own. What is in it is undefined: a search writes a place before it reads it. More than KEPT_BYTES
are given back after use, so a rare large search does not hold memory for good.
"""

import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

KEPT_BYTES = 1 << 29
FIRST_ENTRIES = 4096
BYTES_PER_NODE = 9
BYTES_PER_ENTRY = 8


class Scratch(NamedTuple):
    """Arrays of at least the sizes asked for."""

    state: NDArray[np.uint8]
    g: NDArray[np.int64]
    entry_node: NDArray[np.int32]
    entry_below: NDArray[np.int32]


class _Kept(threading.local):
    scratch: Scratch | None = None


_kept = _Kept()


def borrow(nodes: int) -> Scratch:
    """Return scratch for a search over so many nodes; until `give_back` nobody else in this thread gets it."""
    kept, _kept.scratch = _kept.scratch, None
    if kept is None or kept.g.size < nodes:
        node, below = (kept.entry_node, kept.entry_below) if kept else np.empty((2, FIRST_ENTRIES), np.int32)
        kept = Scratch(np.empty(nodes, np.uint8), np.empty(nodes, np.int64), node, below)
    return kept


def with_more_entries(scratch: Scratch) -> Scratch:
    """Return the scratch with twice the room for entries; those there are copied."""
    node, below = (np.empty(2 * old.size, np.int32) for old in scratch[2:])
    node[: scratch.entry_node.size], below[: scratch.entry_node.size] = scratch[2:]
    return scratch._replace(entry_node=node, entry_below=below)


def give_back(scratch: Scratch) -> None:
    """Keep the scratch for the next search."""
    used = BYTES_PER_NODE * scratch.g.size + BYTES_PER_ENTRY * scratch.entry_node.size
    if used <= KEPT_BYTES:
        _kept.scratch = scratch
