"""The emulated Uno behind a pseudo-terminal: what `planarm emulate` and `python -m planarm_sim` run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from planarm_sim.bench import Bench, BenchReport
from planarm_sim.board import CLOCK_HZ, Uno, Usb
from planarm_sim.bridge import BOOT_S, Bridge, BridgeCounts, Clock, Line, Speed, WallClock
from planarm_sim.bridge.punctual import punctual
from planarm_sim.cpu.chip import StopCause
from planarm_sim.debug import GdbServer
from planarm_sim.errors import BridgeError, StoppedError
from planarm_sim.insight import Insight
from planarm_sim.loader import Image, load_elf, load_image
from planarm_sim.recording import NO_WATCH, TRACED_PINS, Sink, Watch, write_profile
from planarm_wire import messages

__all__ = ["TRACED_PINS", "Emulation", "Stop", "Watch", "emulate", "run_board"]

COMPILING_CYCLES = 20_000
"""Enough for every part of a bench to have run."""

DEBUGGER_WAIT_S = 0.05
"""How long a board that a debugger holds may not notice that it is to stop."""


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
        insight: what watching the program told; None when nobody asked for it.
        bench: what drivers, motors and arm around the board did; None when there were none.
    """

    cycles: int
    clock_s: float
    rising_edges: dict[str, int]
    counts: BridgeCounts
    ended: str
    program_failed: bool
    warnings: tuple[str, ...]
    insight: Insight | None = None
    bench: BenchReport | None = None

    @property
    def ratio(self) -> float:
        """Emulated time over the clock's: 1 is real time."""
        return self.cycles / (16e6 * self.clock_s) if self.clock_s > 0 else 0.0


def emulate(
    image_path: str | Path | None,
    *,
    bootloader: str | Path | None = None,
    link: str | Path | None = None,
    watch: Watch = NO_WATCH,
    speed: Speed = "real",
    baud: int | None = None,
    usb: Usb = "16u2",
    seconds: float | None = None,
    reset_on_open: bool = True,
    around: Callable[[Uno], Bench] | None = None,
    announce: Callable[[str], None],
    say: Callable[[str], None],
) -> Emulation:
    """Emulate an Uno behind a pseudo-terminal until SIGINT or SIGTERM, or for a time.

    Args:
        image_path: program, Intel HEX or ELF; None with a boot loader alone.
        bootloader: boot loader, Intel HEX or ELF, that runs after every reset; programs can be uploaded to it.
        link: path at which the terminal can be opened, too.
        watch: what to record, and whether a debugger may attach.
        speed: "real" or "max"; see `planarm_sim.bridge.bridge`.
        baud: rate of the serial line; None follows the host, and is 250,000 until it sets another.
        usb: "16u2": with the delays and limits of the board's USB bridge; "direct": without.
        seconds: emulated time to run; None runs on.
        reset_on_open: reset the board whenever a host opens the terminal, as a Uno does.
        around: puts drivers, motors and an arm around the board.
        announce: takes the terminal's path as soon as it can be opened, before anything else.
        say: takes notices, one line each.

    Raises:
        ImageError: the program cannot be loaded.
        UsageError: neither program nor boot loader.
        BridgeError: no terminal, or no link to it, can be had.
        TraceError: a file cannot be written.
    """
    try:
        from planarm_sim.bridge.pty_line import PtyLine  # noqa: PLC0415 - needs POSIX
    except ImportError as error:
        raise BridgeError(
            "this system has no pseudo-terminals; use planarm --port sim://, which needs none, or Linux or macOS"
        ) from error
    uno = Uno(_load(image_path), baud=baud or messages.BAUD, usb=usb, bootloader=_load(bootloader))
    if watch.symbols is not None:
        load_elf(watch.symbols)  # what is wrong with it is told before anything is announced
    uno.run(cycles=1)  # compiles the chip, or loads it from the cache: a host that opens the terminal need not wait
    bench = None
    if around is not None:
        around(Uno(_load(image_path), bootloader=_load(bootloader))).run(cycles=COMPILING_CYCLES)
        bench = around(uno)
    with _stopped_by_signals() as stop, PtyLine(link, uno.serial.baud) as line, punctual():
        announce(line.path)
        return run_board(
            uno,
            line,
            WallClock(),
            stop,
            watch=watch,
            speed=speed,
            seconds=seconds,
            reset_on_open=reset_on_open,
            follow_baud=baud is None,
            bench=bench,
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
    watch: Watch = NO_WATCH,
    speed: Speed = "real",
    seconds: float | None = None,
    reset_on_open: bool = True,
    bench: Bench | None = None,
    follow_baud: bool = False,
    say: Callable[[str], None],
) -> Emulation:
    """As `emulate`, with a board, a line, a clock and a way to stop it of the caller's."""
    if watch.profile is not None or watch.interrupts:
        uno.observe(symbols=watch.symbols, keep_intervals=watch.interrupts)
    machine = uno if bench is None else bench
    machine.run(cycles=1)  # compiles the chip, if nobody has: seconds that are nobody's lag
    start_cycle, start_s = uno.cycle, clock.now_s()
    with ExitStack() as stack:
        sink = stack.enter_context(Sink(uno, watch))
        debugger = None
        if watch.gdb_port is not None:
            debugger = stack.enter_context(GdbServer(watch.gdb_port, uno.debug_target))
            say(f"avr-gdb attaches by: target remote localhost:{debugger.port}")
        bridge = Bridge(
            machine,
            line,
            clock,
            speed=speed,
            boot_s=BOOT_S if reset_on_open else None,
            follow_baud=follow_baud,
            say=say,
            after_run=sink.take,
        )
        ended, failed = _run_to_the_end(uno, bridge, seconds, stop, debugger)
    insight = uno.insight() if watch.profile is not None else None
    if watch.profile is not None and insight is not None:
        write_profile(watch.profile, insight)
    return Emulation(
        cycles=uno.cycle - start_cycle,
        clock_s=clock.now_s() - start_s,
        rising_edges=sink.rising_edges(),
        counts=bridge.counts,
        ended=ended,
        program_failed=failed,
        warnings=uno.warnings,
        insight=insight,
        bench=bench.report() if bench is not None else None,
    )


def _run_to_the_end(
    uno: Uno, bridge: Bridge, seconds: float | None, stop: Stop, debugger: GdbServer | None
) -> tuple[str, bool]:
    """Run until time is up, somebody stops it or the program ends; returns why, and whether the program failed."""
    end = None if seconds is None else uno.cycle + round(seconds * CLOCK_HZ)

    def interrupted() -> bool:
        if debugger is not None:
            debugger.poll(0.0)
        return stop.requested or (debugger is not None and debugger.holds)

    while not stop.requested and (end is None or uno.cycle < end):
        try:
            bridge.run(None if end is None else (end - uno.cycle) / CLOCK_HZ, until=interrupted)
        except StoppedError as error:
            if debugger is None or not debugger.attached:
                return str(error), True
            debugger.board_stopped(StopCause[error.cause])
        while debugger is not None and debugger.holds and not stop.requested:
            debugger.poll(DEBUGGER_WAIT_S)
        bridge.resume()
    return ("stopped" if stop.requested else "time is up"), False


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
