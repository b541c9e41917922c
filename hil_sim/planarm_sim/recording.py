"""What an endless emulation records, carried away piece by piece so that memory does not grow."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from planarm_sim.board import PINS, Uno, pin_name
from planarm_sim.errors import TraceError, UsageError
from planarm_sim.insight import Insight
from planarm_sim.trace import SerialCsvWriter, VcdWriter

__all__ = ["NO_WATCH", "TRACED_PINS", "Sink", "Watch", "write_profile"]

TRACED_PINS = tuple(pin.name for pin in PINS if pin.name not in ("D0", "D1"))
"""Pins in the waveform file and in the counts: all but the serial line's."""

_SIGNAL_OF = {pin.index: TRACED_PINS.index(pin.name) for pin in PINS if pin.name in TRACED_PINS}


@dataclass(frozen=True, slots=True)
class Watch:
    """What to record of an emulation; None records nothing of the kind.

    Attributes:
        vcd: waveform file, all pins but the serial line's.
        serial_log: table of every byte on the serial line, CSV.
        profile: JSON file with the figures of `Insight`, written at the end.
        symbols: ELF file with the program's functions, for a program that came as Intel HEX.
        interrupts: let the waveforms tell which interrupt runs (`isr`); the board runs at about a third of the speed.
        gdb_port: port at which avr-gdb may attach; 0 takes a free one.
    """

    vcd: str | Path | None = None
    serial_log: str | Path | None = None
    profile: str | Path | None = None
    symbols: str | Path | None = None
    interrupts: bool = False
    gdb_port: int | None = None

    def __post_init__(self) -> None:
        """Refuse what asks for something that has no place.

        Raises:
            UsageError: interrupts without waveforms.
        """
        if self.interrupts and self.vcd is None:
            raise UsageError("which interrupt runs (--isr) is told in the waveforms: give --vcd FILE as well")


NO_WATCH = Watch()


class Sink:
    """Carries edges and bytes from the board to the counts and the files. A context manager.

    Raises:
        TraceError: a file cannot be written.
    """

    def __init__(self, uno: Uno, watch: Watch) -> None:
        self._uno = uno
        self._rising = np.zeros(256, dtype=np.int64)
        self._stack = ExitStack()
        self._vcd: VcdWriter | None = None
        self._interrupts = watch.interrupts
        self._held: list[NDArray[Any]] = []  # edges of which it is not yet settled which interrupt ran
        self._serial: SerialCsvWriter | None = None
        if watch.vcd is not None:
            numbers = ("isr",) if watch.interrupts else ()
            levels = [uno.pin(name).level for name in TRACED_PINS]
            self._vcd = self._stack.enter_context(VcdWriter(watch.vcd, TRACED_PINS, levels, uno.cycle, numbers))
        if watch.serial_log is not None:
            self._serial = self._stack.enter_context(SerialCsvWriter(watch.serial_log))

    def take(self) -> None:
        """Carry away what was recorded since the last call."""
        if self._serial is not None:
            self._serial.write(self._uno.serial.take_log())
        else:
            self._uno.serial.clear_log()
        edges = self._uno.take_edges()
        if len(edges):
            self._rising += np.bincount(edges["pin"][edges["level"] == 1], minlength=256)
        if self._vcd is not None and self._interrupts:
            self._write_with_interrupts(self._vcd, edges)
        elif self._vcd is not None and len(edges):
            self._vcd.write(edges, _SIGNAL_OF)

    def _write_with_interrupts(self, vcd: VcdWriter, edges: NDArray[Any]) -> None:
        """Write what is settled; the rest waits for the interrupt under way to return."""
        changes, settled = self._uno.take_running_interrupts()
        joined = np.concatenate([*self._held, edges])
        until = int(np.searchsorted(joined["cycle"], settled))
        vcd.write(joined[:until], _SIGNAL_OF, changes)
        self._held = [joined[until:]]

    def rising_edges(self) -> dict[str, int]:
        """Rising edges of each pin that had any, by board name."""
        counts = {pin_name(index): count for index, count in enumerate(self._rising.tolist()) if count}
        return {name: counts[name] for name in TRACED_PINS if name in counts}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.take()
        if self._vcd is not None:
            for edges in self._held:
                self._vcd.write(edges, _SIGNAL_OF)
            self._vcd.close(self._uno.cycle)
        self._stack.close()


def write_profile(path: str | Path, insight: Insight) -> None:
    """Write an insight as JSON.

    Raises:
        TraceError: the file cannot be written.
    """
    try:
        Path(path).write_text(json.dumps(insight.as_dict(), indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise TraceError(f"{path}: cannot be written: {error.strerror}") from error
