"""What an endless emulation records, carried away piece by piece so that memory does not grow."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from planarm_sim.board import PINS, Uno, pin_name
from planarm_sim.errors import TraceError
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
        gdb_port: port at which avr-gdb may attach; 0 takes a free one.
    """

    vcd: str | Path | None = None
    serial_log: str | Path | None = None
    profile: str | Path | None = None
    symbols: str | Path | None = None
    gdb_port: int | None = None


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
        self._serial: SerialCsvWriter | None = None
        if watch.vcd is not None:
            levels = [uno.pin(name).level for name in TRACED_PINS]
            self._vcd = self._stack.enter_context(VcdWriter(watch.vcd, TRACED_PINS, levels, uno.cycle))
        if watch.serial_log is not None:
            self._serial = self._stack.enter_context(SerialCsvWriter(watch.serial_log))

    def take(self) -> None:
        """Carry away what was recorded since the last call."""
        if self._serial is not None:
            self._serial.write(self._uno.serial.take_log())
        else:
            self._uno.serial.clear_log()
        edges = self._uno.take_edges()
        if len(edges) == 0:
            return
        self._rising += np.bincount(edges["pin"][edges["level"] == 1], minlength=256)
        if self._vcd is not None:
            self._vcd.write(edges, _SIGNAL_OF)

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
