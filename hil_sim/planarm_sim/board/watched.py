"""What a board tells of the program that it runs: its interrupts and functions, and to a debugger all there is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from planarm_sim.board.edge_log import EdgeLog
from planarm_sim.board.serial import SerialPort
from planarm_sim.cpu.chip import Chip, StopCause
from planarm_sim.errors import UsageError
from planarm_sim.loader import Symbol, load_elf

if TYPE_CHECKING:
    from planarm_sim.debug import Target
    from planarm_sim.insight import Insight, Observer

__all__ = ["WatchedBoard"]


class WatchedBoard:
    """The part of `Uno` that watches the program."""

    _chip: Chip
    _symbols: tuple[Symbol, ...]
    _observer: Observer | None
    _edges: EdgeLog
    serial: SerialPort

    def observe(self, *, symbols: str | Path | None = None, keep_intervals: bool = True) -> None:
        """Watch the program from now on, or anew; see `insight`. The board does the same, a few times slower.

        Args:
            symbols: ELF file with the program's functions, for a program that came as Intel HEX.
            keep_intervals: keep each interrupt for `interrupt_intervals`; memory grows with every one.

        Raises:
            ImageError: `symbols` cannot be read.
        """
        from planarm_sim.insight import Observer  # noqa: PLC0415 - a start need not wait for it

        functions = self._symbols if symbols is None else load_elf(symbols).symbols
        self._observer = Observer(functions, keep_intervals=keep_intervals)
        self._observer.begin(self._chip.cycle)
        self._chip.watch(self._observer)

    @property
    def is_observed(self) -> bool:
        """Whether the program is watched."""
        return self._observer is not None

    def insight(self) -> Insight:
        """What the program did since `observe`, or since the last `restore` after it.

        Raises:
            UsageError: the program is not watched.
        """
        return self._watching().insight(self._chip.cycle)

    def interrupt_intervals(self) -> NDArray[Any]:
        """Every interrupt that has returned since `observe`, in order of entries.

        Returns:
            Structured array: vector (number, see `planarm_sim.insight.VECTOR_NAMES`), flag, entry, exit (cycles: the
            request came to stand, the first instruction began, RETI was over), nested_in (interrupts it lay in).

        Raises:
            UsageError: the program is not watched.
        """
        return self._watching().intervals()

    def take_running_interrupts(self) -> tuple[list[tuple[int, int]], int]:
        """Return which interrupts ran since the last call, and forget their intervals; for runs without end.

        Returns:
            The cycles at which another one, or none (0), began to run, with its number, as far as that is settled; and
            the cycle up to which it is: now, or when the interrupt that has not yet returned began.

        Raises:
            UsageError: the program is not watched.
        """
        return self._watching().take_running(self._chip.cycle)

    def debug_target(self) -> Target:
        """The board as a debugger sees it; see `planarm_sim.debug`."""
        from planarm_sim.debug import Target  # noqa: PLC0415 - a start need not wait for it

        return Target(self._chip, self._observer)

    def serve_gdb(self, port: int = 0, *, announce: Callable[[int], None] = lambda _port: None) -> None:
        """Have avr-gdb run this board (`target remote localhost:PORT`), and come back when it has gone.

        Time passes as the debugger says, as fast as it can be computed; the board stands still until it attaches.

        Args:
            port: TCP port, of this computer only; 0 takes a free one.
            announce: takes the port as soon as a debugger can attach.

        Raises:
            BridgeError: the port cannot be had.
        """
        from planarm_sim.debug import GdbServer, serve  # noqa: PLC0415 - a start need not wait for it

        def run_slice(cycles: int) -> StopCause:
            cause = self._chip.run_to(self._chip.cycle + cycles)
            self._collect()
            return cause

        with GdbServer(port, self.debug_target) as server:
            announce(server.port)
            serve(server, run_slice)
        self._collect()

    def _interrupt_changes(self) -> list[tuple[int, int]]:
        """Return when another interrupt, or none, began to run, and its number, since the recording's start."""
        if self._observer is None:
            return []
        from planarm_sim.insight.figures import running_interrupts  # noqa: PLC0415 - a start need not wait for it

        changes = running_interrupts(self._observer.intervals())
        return [(cycle, vector) for cycle, vector in changes if cycle >= self._edges.start_cycle]

    def _watching(self) -> Observer:
        if self._observer is None:
            raise UsageError("nobody has watched this board; call observe() before the run that is to be looked at")
        return self._observer

    def _collect(self) -> bool:
        """Fetch what the chip sent and did; tell whether it sent something."""
        sent = self.serial.collect()
        self._edges.collect()
        return sent
