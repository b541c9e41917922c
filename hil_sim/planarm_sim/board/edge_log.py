"""The level changes that the program made on the board's pins, kept since a moment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planarm_sim.board.pins import PINS, pin_place
from planarm_sim.cpu.chip import EDGE_DTYPE, Chip
from planarm_sim.trace import EDGE, VcdWriter

__all__ = ["EdgeLog", "EdgeLogState"]

EdgeLogState = tuple[tuple[NDArray[Any], ...], int, tuple[int, ...]]

_NO_EDGES = np.empty(0, EDGE_DTYPE)
_PIN_INDICES = tuple(pin.index for pin in PINS)


class EdgeLog:
    """Edges of all pins, in order of time, since a cycle at which the pins had known levels.

    Attributes:
        listeners: take every further edge.
        start_cycle: since when edges are recorded.
    """

    def __init__(self, chip: Chip) -> None:
        self._chip = chip
        self._edges: list[NDArray[Any]] = []
        self.listeners: list[Callable[[NDArray[Any]], None]] = []
        self.start_cycle, self._start_levels = chip.cycle, self._levels()

    def collect(self) -> None:
        """Fetch the edges of the chip, and tell the listeners."""
        edges = self._chip.drain_edges()
        if len(edges):
            self._edges.append(edges)
            for listener in self.listeners:
                listener(edges)

    def of(self, name: str) -> NDArray[Any]:
        """Return cycle and level of the edges of one pin."""
        recorded = self._recorded()
        chosen = recorded[recorded["pin"] == pin_place(name).index]
        result = np.empty(len(chosen), EDGE)
        result["cycle"], result["level"] = chosen["cycle"], chosen["level"]
        return result

    def clear(self) -> None:
        """Forget what was recorded; the log begins now."""
        self._edges = []
        self.start_cycle, self._start_levels = self._chip.cycle, self._levels()

    def take(self) -> NDArray[Any]:
        """Return everything recorded, and forget it."""
        if not self._edges:
            return _NO_EDGES
        taken = self._recorded()
        self.clear()
        return taken

    def write_vcd(
        self, path: str | Path, names: Sequence[str], interrupts: Sequence[tuple[int, int]] | None = None
    ) -> None:
        """Write the edges of some pins as a waveform file, and which interrupt runs from which cycle on, if told."""
        signal_of = {pin_place(name).index: number for number, name in enumerate(names)}
        start = dict(zip(PINS, self._start_levels, strict=True))
        levels = [start[pin_place(name)] for name in names]
        numbers = () if interrupts is None else ("isr",)
        with VcdWriter(path, names, levels, self.start_cycle, numbers) as vcd:
            vcd.write(self._recorded(), signal_of, interrupts or ())
            vcd.close(self._chip.cycle)

    def snapshot(self) -> EdgeLogState:
        """What `restore` goes back to."""
        return tuple(self._edges), self.start_cycle, self._start_levels

    def restore(self, state: EdgeLogState) -> None:
        """Go back to a snapshot of any board's log; listeners stay."""
        self._edges = list(state[0])
        self.start_cycle, self._start_levels = state[1:]

    def _recorded(self) -> NDArray[Any]:
        """All recorded edges in one array; joined once, then kept so."""
        if len(self._edges) != 1:
            self._edges = [np.concatenate([_NO_EDGES, *self._edges])]
        return self._edges[0]

    def _levels(self) -> tuple[int, ...]:
        return tuple(self._chip.pin_level(index) for index in _PIN_INDICES)
