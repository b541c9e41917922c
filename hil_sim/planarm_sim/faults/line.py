"""A serial line on which things go wrong: it stands in for `Uno.serial`, and keeps the order of bytes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planarm_sim.board import CLOCK_HZ, Uno
from planarm_sim.faults.schedule import Fault

__all__ = ["ActiveFault", "FaultyLine"]

TO_BOARD, TO_HOST = "to_board", "to_host"


@dataclass(frozen=True, slots=True)
class ActiveFault:
    """A fault with its times in clock cycles, and its own stream of random numbers."""

    fault: Fault
    begin: int
    end: int
    random: np.random.Generator

    def holds(self, cycle: int) -> bool:
        """Whether it is in force at a cycle."""
        return self.begin <= cycle < self.end


class FaultyLine:
    """Bytes to and from the board, with faults between.

    Args:
        uno: the board.
        active: returns the faults whose times are known.
    """

    def __init__(self, uno: Uno, active: Callable[[], tuple[ActiveFault, ...]]) -> None:
        self._uno = uno
        self._active = active
        self._waiting: dict[str, deque[tuple[int, int]]] = {TO_BOARD: deque(), TO_HOST: deque()}
        self._received = bytearray()
        self.counts = dict.fromkeys(("dropped", "flipped", "duplicated", "delayed", "inserted", "unplugged"), 0)

    @property
    def baud(self) -> int:
        """The host's rate."""
        return self._uno.serial.baud

    @baud.setter
    def baud(self, value: int) -> None:
        self._uno.serial.baud = value

    @property
    def host_takes(self) -> bool:
        """Whether the host takes bytes from the board's USB bridge."""
        return self._uno.serial.host_takes

    @host_takes.setter
    def host_takes(self, value: bool) -> None:
        self._uno.serial.host_takes = value

    @property
    def bridge(self) -> object | None:
        """The board's USB bridge; None when the line is direct."""
        return self._uno.serial.bridge

    @property
    def room(self) -> int:
        """Bytes that can be written now without being held back."""
        return max(0, self._uno.serial.room - len(self._waiting[TO_BOARD]))

    @property
    def pending(self) -> int:
        """Bytes written that have not reached the board."""
        return self._uno.serial.pending + len(self._waiting[TO_BOARD])

    @property
    def idle_cycle(self) -> int:
        """Cycle at which the last byte written has passed."""
        waiting = self._waiting[TO_BOARD]
        return max(self._uno.serial.idle_cycle, waiting[-1][0] if waiting else 0)

    @property
    def next_delivery_cycle(self) -> int:
        """First cycle at which there may be something to hand over that is not there now, either way."""
        held = [waiting[0][0] for waiting in self._waiting.values() if waiting]
        return max(self._uno.cycle + 1, min([self._uno.serial.next_delivery_cycle, *held]))

    def write(self, data: bytes) -> None:
        """Send bytes towards the board."""
        for byte in data:
            self._pass(TO_BOARD, byte)
        self.pump()

    def read(self) -> bytes:
        """Take everything that came through from the board."""
        self.pump()
        data = bytes(self._received)
        self._received.clear()
        return data

    def discard(self) -> int:
        """Throw away everything that the board sent and nobody read; returns how many bytes."""
        held = self._waiting[TO_HOST]
        lost = len(self.read()) + len(held) + self._uno.serial.discard()
        held.clear()
        return lost

    def peek(self) -> bytes:
        """Everything that came through, left in place."""
        self.pump()
        return bytes(self._received)

    def insert(self, direction: str, data: bytes) -> None:
        """Put noise on the line."""
        for way in (TO_BOARD, TO_HOST):
            if direction in (way, "both"):
                self._waiting[way].extend((self._uno.cycle, byte) for byte in data)
                self.counts["inserted"] += len(data)
        self.pump()

    def pump(self) -> None:
        """Hand over what is due, in both directions."""
        for byte in self._uno.serial.read():
            self._pass(TO_HOST, byte)
        to_board = self._due(TO_BOARD)
        if to_board:
            self._uno.serial.write(to_board)
        self._received += self._due(TO_HOST)

    def _due(self, way: str) -> bytes:
        waiting, due = self._waiting[way], bytearray()
        while waiting and waiting[0][0] <= self._uno.cycle:
            due.append(waiting.popleft()[1])
        return bytes(due)

    def _pass(self, way: str, byte: int) -> None:
        """Let a byte meet every fault in force; what is left of it waits its turn."""
        now, waiting = self._uno.cycle, self._waiting[way]
        copies, release = 1, now
        for active in self._active():
            settings, kind = active.fault.settings, active.fault.kind
            if not active.holds(now) or not kind.startswith("line."):
                continue
            if kind == "line.unplug":
                self.counts["unplugged"] += 1
                return
            if settings.get("direction") not in (way, "both") or "share" not in settings:
                continue
            if active.random.random() >= settings["share"]:
                continue
            if kind == "line.drop":
                self.counts["dropped"] += 1
                return
            if kind == "line.flip":
                self.counts["flipped"] += 1
                byte ^= 1 << int(active.random.integers(8))
            elif kind == "line.duplicate":
                self.counts["duplicated"] += 1
                copies += 1
            else:
                self.counts["delayed"] += 1
                release = now + round(settings["by_s"] * CLOCK_HZ)
        if waiting:
            release = max(release, waiting[-1][0])  # a line keeps the order
        waiting.extend((release, byte) for _ in range(copies))
