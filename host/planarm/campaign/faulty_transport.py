"""A line to an emulated board on which things go wrong at seeded moments: bytes, power, cable, and the host itself."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import TYPE_CHECKING

from planarm.errors import HostKilledError, LinkError
from planarm_wire.messages import TICKS_HZ

if TYPE_CHECKING:
    from planarm_sim import Uno
    from planarm_sim.faults.line import FaultyLine

SLICE_CYCLES = 1600
WAIT_CYCLES = 16_000
"""Bytes that were held back get on with so much delay, 1 ms, while the host only waits."""
NEVER = 1 << 62


@dataclass(frozen=True, slots=True)
class Mishaps:
    """What happens to board and host; moments are cycles.

    Attributes:
        resets: the board restarts, each with the name of its cause.
        unplugged: the cable is out from .. to; the board keeps its supply.
        paused: the host does nothing from .. to.
        killed: the host's program ends; None: it does not.
    """

    resets: tuple[tuple[int, str], ...] = ()
    unplugged: tuple[int, int] = (NEVER, NEVER)
    paused: tuple[int, int] = (NEVER, NEVER)
    killed: int | None = None


class FaultyTransport:
    """A transport to an emulated board in virtual time, with mishaps; `line` carries the bytes and damages them."""

    arm = None
    pins = None

    def __init__(self, uno: Uno, line: FaultyLine, mishaps: Mishaps) -> None:
        self.uno = uno
        self.line = line
        self.clock = self
        self.resets_done = 0
        self._mishaps = mishaps
        self._agenda: list[tuple[int, Callable[[], None]]] = []
        for cycle, cause in mishaps.resets:
            self.at(cycle, partial(self._reset, cause))
        self._received = bytearray()
        self._nonces = count(1)

    def at(self, cycle: int, action: Callable[[], None]) -> None:
        """Have something done on a cycle."""
        self._agenda.append((cycle, action))
        self._agenda.sort(key=lambda entry: entry[0])

    def nonce(self) -> int:
        """1, 2, 3 ..."""
        return next(self._nonces)

    def now_s(self) -> float:
        """Emulated seconds since power-up."""
        return self.uno.cycle / TICKS_HZ

    def wait_until(self, t_s: float) -> None:
        """Run the board until its time is `t_s`."""
        self._run_to(_cycle_after(t_s))

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        """Run the board until it has sent a byte or its time is `deadline_s`."""
        self._meet("read")
        self._received += self.line.read()
        while not self._received and self.now_s() < deadline_s:
            self._run_to(min(self.uno.cycle + SLICE_CYCLES, _cycle_after(deadline_s)))
            self._meet("read")
            self._received += self.line.read()
        data = bytes(self._received[:max_bytes])
        del self._received[:max_bytes]
        return data

    def write(self, data: bytes) -> None:
        """Put `data` on the line."""
        self._meet("write")
        self.line.write(data)

    def close(self) -> None:
        """The board stays."""

    def repair(self) -> None:
        """From now on nothing goes wrong."""
        self._mishaps = Mishaps()
        self._agenda.clear()

    def _meet(self, action: str) -> None:
        """Do what the mishaps do to the host."""
        mishaps, now = self._mishaps, self.uno.cycle
        if mishaps.paused[0] <= now < mishaps.paused[1]:
            self._run_to(mishaps.paused[1])
        if mishaps.killed is not None and now >= mishaps.killed:
            raise HostKilledError(f"the host was killed at {self.now_s():.6f} s")
        if mishaps.unplugged[0] <= now < mishaps.unplugged[1]:
            raise LinkError(f"{action} at {self.now_s():.6f} s: the cable is out")

    def _run_to(self, target: int) -> None:
        """Run the board; what is on the agenda comes on its cycle, and bytes that were held back get on."""
        while self.uno.cycle < target:
            until = min(target, self.uno.cycle + WAIT_CYCLES)
            if self._agenda and self._agenda[0][0] <= until:
                cycle, action = self._agenda.pop(0)
                self.uno.run(cycles=max(0, cycle - self.uno.cycle))
                action()
                continue
            self.uno.run(cycles=until - self.uno.cycle)
            self.line.pump()

    def _reset(self, cause: str) -> None:
        from planarm_sim.cpu.chip import ResetCause  # noqa: PLC0415 - the emulator is loaded where it is used

        self.uno.reset(ResetCause[cause])
        self.resets_done += 1


def _cycle_after(t_s: float) -> int:
    return math.floor(t_s * TICKS_HZ) + 1 if math.isfinite(t_s) else NEVER
