"""The emulated Uno behind a pseudo-terminal: what `planarm emulate` and `python -m planarm_sim` run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import numpy as np

from planarm_sim.board import PINS, Uno, pin_name
from planarm_sim.bridge import BOOT_S, Bridge, BridgeCounts, Clock, Line, Speed, WallClock
from planarm_sim.errors import BridgeError, StoppedError
from planarm_sim.loader import Image, load_image
from planarm_sim.trace import VcdWriter
from planarm_wire import messages

__all__ = ["TRACED_PINS", "Emulation", "Stop", "emulate", "run_board"]

TRACED_PINS = tuple(pin.name for pin in PINS if pin.name not in ("D0", "D1"))
"""Pins in the waveform file and in the counts: all but the serial line's."""


@dataclass(frozen=True, slots=True)
class Emulation:
    """What an emulation did.

    Attributes:
        cycles: emulated clock cycles.
        clock_s: seconds that they took on the clock.
        rising_edges: rising edges of each pin that had any, by board name.
        counts: what passed the serial line.
        ended: why it ended: "stopped", "time is up", or what the program ran into.
        program_failed: whether the program ended by itself (undefined opcode, BREAK, asleep for ever).
        warnings: registers of parts that are not modelled which the program touched.
    """

    cycles: int
    clock_s: float
    rising_edges: dict[str, int]
    counts: BridgeCounts
    ended: str
    program_failed: bool
    warnings: tuple[str, ...]

    @property
    def ratio(self) -> float:
        """Emulated time over the clock's: 1 is real time."""
        return self.cycles / (16e6 * self.clock_s) if self.clock_s > 0 else 0.0


def emulate(
    image_path: str | Path | None,
    *,
    bootloader: str | Path | None = None,
    link: str | Path | None = None,
    vcd: str | Path | None = None,
    speed: Speed = "real",
    baud: int = messages.BAUD,
    seconds: float | None = None,
    reset_on_open: bool = True,
    announce: Callable[[str], None],
    say: Callable[[str], None],
) -> Emulation:
    """Emulate an Uno behind a pseudo-terminal until SIGINT or SIGTERM, or for a time.

    Args:
        image_path: program, Intel HEX or ELF; None with a boot loader alone.
        bootloader: boot loader, Intel HEX or ELF, that runs after every reset; programs can be uploaded to it.
        link: path at which the terminal can be opened, too.
        vcd: waveform file to write, all pins but the serial line's.
        speed: "real" or "max"; see `planarm_sim.bridge.bridge`.
        baud: rate of the serial line; a pseudo-terminal does not tell what its host sets.
        seconds: emulated time to run; None runs on.
        reset_on_open: reset the board whenever a host opens the terminal, as a Uno does.
        announce: takes the terminal's path as soon as it can be opened, before anything else.
        say: takes notices, one line each.

    Raises:
        ImageError: the program cannot be loaded.
        UsageError: neither program nor boot loader.
        BridgeError: no terminal, or no link to it, can be had.
        TraceError: the waveform file cannot be written.
    """
    try:
        from planarm_sim.bridge.pty_line import PtyLine  # noqa: PLC0415 - needs POSIX
    except ImportError as error:
        raise BridgeError(
            "this system has no pseudo-terminals; use planarm --port sim://, which needs none, or Linux or macOS"
        ) from error
    uno = Uno(_load(image_path), baud=baud, bootloader=_load(bootloader))
    uno.run(cycles=1)  # compiles the chip, or loads it from the cache: a host that opens the terminal need not wait
    with _stopped_by_signals() as stop, PtyLine(link) as line:
        announce(line.path)
        return run_board(
            uno,
            line,
            WallClock(),
            stop,
            vcd=vcd,
            speed=speed,
            seconds=seconds,
            reset_on_open=reset_on_open,
            say=say,
        )


def _load(path: str | Path | None) -> Image | None:
    return None if path is None else load_image(path)


def run_board(
    uno: Uno,
    line: Line,
    clock: Clock,
    stop: Stop,
    *,
    vcd: str | Path | None = None,
    speed: Speed = "real",
    seconds: float | None = None,
    reset_on_open: bool = True,
    say: Callable[[str], None],
) -> Emulation:
    """As `emulate`, with a board, a line, a clock and a way to stop it of the caller's."""
    uno.run(cycles=1)  # compiles the chip, if nobody has: seconds that are nobody's lag
    start_cycle, start_s = uno.cycle, clock.now_s()
    with ExitStack() as stack:
        edges = _EdgeSink(uno, stack.enter_context(_open_vcd(uno, vcd)) if vcd is not None else None)
        bridge = Bridge(
            uno, line, clock, speed=speed, boot_s=BOOT_S if reset_on_open else None, say=say, after_run=edges.take
        )
        ended, failed = "stopped", False
        try:
            bridge.run(seconds, until=lambda: stop.requested)
        except StoppedError as error:
            ended, failed = str(error), True
        else:
            if seconds is not None and uno.cycle >= start_cycle + round(seconds * 16e6):
                ended = "time is up"
        edges.finish()
    return Emulation(
        cycles=uno.cycle - start_cycle,
        clock_s=clock.now_s() - start_s,
        rising_edges=edges.rising_edges(),
        counts=bridge.counts,
        ended=ended,
        program_failed=failed,
        warnings=uno.warnings,
    )


class _EdgeSink:
    """Carries edges from the board to the counts and to the waveform file, so that memory does not grow."""

    def __init__(self, uno: Uno, vcd: VcdWriter | None) -> None:
        self._uno = uno
        self._vcd = vcd
        self._rising = np.zeros(256, dtype=np.int64)

    def take(self) -> None:
        edges = self._uno.take_edges()
        if len(edges) == 0:
            return
        self._rising += np.bincount(edges["pin"][edges["level"] == 1], minlength=256)
        if self._vcd is not None:
            self._vcd.write(edges, _SIGNAL_OF)

    def finish(self) -> None:
        self.take()
        if self._vcd is not None:
            self._vcd.close(self._uno.cycle)

    def rising_edges(self) -> dict[str, int]:
        counts = {pin_name(index): count for index, count in enumerate(self._rising.tolist()) if count}
        return {name: counts[name] for name in TRACED_PINS if name in counts}


_SIGNAL_OF = {pin.index: TRACED_PINS.index(pin.name) for pin in PINS if pin.name in TRACED_PINS}


def _open_vcd(uno: Uno, path: str | Path) -> VcdWriter:
    return VcdWriter(path, TRACED_PINS, [uno.pin(name).level for name in TRACED_PINS], uno.cycle)


class Stop:
    """Whether the end was asked for."""

    def __init__(self) -> None:
        self.requested = False

    def __call__(self, _number: int = 0, _frame: FrameType | None = None) -> None:
        """Ask for the end; as a signal's handler, too. Who asks twice is not made to wait."""
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True


@contextmanager
def _stopped_by_signals() -> Iterator[Stop]:
    """Let SIGINT and SIGTERM ask for the end; only a program's main thread can."""
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
