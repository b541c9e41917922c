"""Every frame on the serial line with its cycles, both ways."""

from __future__ import annotations

from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["FRAME", "FROM_BOARD", "TO_BOARD", "SerialLog", "SerialLogState"]

TO_BOARD: Final = 0
FROM_BOARD: Final = 1
FRAME: Final = np.dtype([("start", np.int64), ("end", np.int64), ("direction", np.uint8), ("byte", np.uint16)])
"""One frame: when its start bit begins, when its stop bit ends, which way it goes, and what it carries."""

_NOTHING = np.empty(0, FRAME)

SerialLogState: TypeAlias = tuple[NDArray[Any], ...]


class SerialLog:
    """Frames as they come; one list for those that come one by one, arrays for those that come in bulk."""

    def __init__(self) -> None:
        self._pieces: list[NDArray[Any]] = []
        self._single: list[tuple[int, int, int, int]] = []

    def add(self, start: int, end: int, direction: int, byte: int) -> None:
        """Note one frame."""
        self._single.append((start, end, direction, byte))

    def extend(self, starts: NDArray[Any], ends: NDArray[Any], direction: int, data: NDArray[Any]) -> None:
        """Note several frames in one direction."""
        piece = np.empty(len(ends), FRAME)
        piece["start"], piece["end"], piece["direction"], piece["byte"] = starts, ends, direction, data
        self._pieces.append(piece)

    def recorded(self) -> NDArray[Any]:
        """All of them, FRAME in order of their ends."""
        joined = np.concatenate([_NOTHING, *self.snapshot()])
        return joined[np.argsort(joined["end"], kind="stable")]

    def take(self, cycle: int) -> NDArray[Any]:
        """Return those that have ended by `cycle`, and keep the others."""
        if not self._pieces and not self._single:
            return _NOTHING
        recorded = self.recorded()
        over = recorded["end"] <= cycle
        self._pieces, self._single = ([recorded[~over]] if not over.all() else []), []
        return recorded[over]

    def snapshot(self) -> SerialLogState:
        """What `restore` takes; the arrays are never changed."""
        if self._single:
            self._pieces.append(np.array(self._single, FRAME))
            self._single = []
        return tuple(self._pieces)

    def restore(self, state: SerialLogState) -> None:
        """Go back to `state`."""
        self._pieces, self._single = list(state), []
