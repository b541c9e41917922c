"""What the chip has sent and which edges it has made: from the kernels' two logs into arrays.

The logs behind the state array have room for some thousand entries. When one is nearly full the CPU loop ends, and
what is in both is set aside here; the loop goes on with empty ones. So no event is ever lost, and no array grows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import layout as at
from planarm_sim.cpu import queues
from planarm_sim.cpu.layout import State
from planarm_sim.cpu.values import EDGE_DTYPE, TX_DTYPE

__all__ = ["Logs"]

_NO_EDGES, _NO_FRAMES = np.empty(0, dtype=EDGE_DTYPE), np.empty(0, dtype=TX_DTYPE)


class Logs:
    """Entries set aside, before those that are still in the state array."""

    def __init__(self) -> None:
        self._frames: list[State] = []
        self._edges: list[State] = []

    def set_aside(self, st: State) -> None:
        """Empty both logs."""
        for queue, pieces in ((queues.TX, self._frames), (queues.EDGES, self._edges)):
            begin, end = queue.span(st)
            if end > begin:
                pieces.append(st[begin:end].copy())
            st[queue.tail] = 0

    def take_frames(self, st: State) -> NDArray[Any]:
        """Return and forget the frames sent, TX_DTYPE."""
        if not self._frames and not st[at.TX_COUNT]:
            return _NO_FRAMES
        raw = self._taken(st, queues.TX, self._frames).reshape(-1, at.TX_WIDTH)
        result = np.empty(len(raw), dtype=TX_DTYPE)
        for column, name in enumerate(("cycle", "byte", "bit_cycles")):
            result[name] = raw[:, column]
        return result

    def take_edges(self, st: State) -> NDArray[Any]:
        """Return and forget the edges, EDGE_DTYPE."""
        if not self._edges and not st[at.EDGE_COUNT]:
            return _NO_EDGES
        raw = self._taken(st, queues.EDGES, self._edges)
        result = np.empty(len(raw), dtype=EDGE_DTYPE)
        result["cycle"] = raw >> 8
        result["pin"] = (raw >> 1) & 0x7F
        result["level"] = raw & 1
        return result

    def put_back(self, st: State) -> State:
        """Return a state array that holds what was set aside as well: for who copies the whole chip."""
        if not self._frames and not self._edges:
            return st
        _, _, *others = queues.contents(st)
        frames, edges = self._taken(st, queues.TX, self._frames), self._taken(st, queues.EDGES, self._edges)
        return queues.allocate(st, (frames.copy(), edges.copy(), *others))

    def forget(self) -> None:
        """Drop what was set aside."""
        self._frames.clear()
        self._edges.clear()

    @staticmethod
    def _taken(st: State, queue: queues.Queue, pieces: list[State]) -> State:
        """Return all words of a log, which is empty then; good until the kernels run again."""
        begin, end = queue.span(st)
        words = np.concatenate([*pieces, st[begin:end]]) if pieces else st[begin:end]
        pieces.clear()
        st[queue.tail] = 0
        return words
