"""Couples the emulated Uno to a line of bytes and to a clock.

One thread, one loop: run the chip up to the moment that the clock shows, hand over what it sent, take what the host
sent, sleep until there is something to do. Bytes are paced at the baud rate by `Uno.serial`, in emulated time, in
both directions. Two speeds:

- real: emulated time follows the clock; the processor sleeps for the rest.
- max: emulated time runs as fast as it can be computed. Bytes take the same emulated time on the line as ever, so
  order, overruns and replies are those of the real speed; but to a host that measures by the clock the board looks
  some ten times faster, so use it with hosts that wait for answers rather than for moments.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from planarm_sim.board import CLOCK_HZ
from planarm_sim.bridge.line import Clock, Line
from planarm_sim.errors import UsageError

if TYPE_CHECKING:
    from planarm_sim.bench import Bench
    from planarm_sim.board import Uno

__all__ = ["Bridge", "BridgeCounts", "Speed"]

Speed = Literal["real", "max"]

LIVELY_SLICE_S = 0.000_25
"""Real speed: longest sleep while bytes are under way; 6 bytes at 250,000 baud."""

LEAST_SLICE_S = 0.000_02
"""Real speed: shortest sleep, about what a look at the line costs."""

QUIET_SLICE_S = 0.002
"""Longest sleep otherwise: how late an opened port, a stop or the board's first byte may be noticed."""

AHEAD_S = 0.000_3
"""Real speed: the chip is brought up to date so long before a delivery of the USB bridge: a short run is left then."""

QUIET_AFTER_S = 0.005
"""The line counts as lively for so long after its last byte: a firmware's answer may be under way."""

RESET_READ_BYTES = 4096

BOOT_S = 0.1
"""How long an opened board stays in reset, by the clock. Hosts flush their buffers just after opening and would lose
what a board that runs at once sends first. A real Uno's boot loader takes longer: 0.5 to 1.5 s."""

MAX_CHUNK_S = 0.010
"""Longest piece of emulated time between two looks at the line."""

GIVE_UP_LAG_S = 0.250
"""Lag behind the clock that is not caught up any more, but reported and forgotten."""


@dataclass(frozen=True, slots=True)
class BridgeCounts:
    """What passed the bridge.

    Attributes:
        opened: how often a host opened the line.
        from_host_bytes: bytes taken from hosts.
        to_host_bytes: bytes handed to hosts.
        lost_bytes: bytes the board sent that nobody took: port closed, or the host's buffer full.
        lag_given_up_s: emulated time that was lost against the clock, in all.
    """

    opened: int = 0
    from_host_bytes: int = 0
    to_host_bytes: int = 0
    lost_bytes: int = 0
    lag_given_up_s: float = 0.0


class Bridge:
    """The loop, one `step` at a time.

    Args:
        uno: the board, or the bench around it.
        line: the host's side.
        clock: the time that `speed` "real" follows.
        speed: see the module's text.
        follow_baud: take the rate that the host sets, as the board's USB bridge does.
        boot_s: seconds by the clock for which the board stays in reset when a host opens the line, as a Uno does (its
            DTR line resets it), unless the host before left DTR up; what the host sends meanwhile is lost. None:
            opening changes nothing.
        say: takes notices for the user, one line each.
        after_run: called after every piece of emulated time, to carry recorded edges away.
    """

    def __init__(
        self,
        uno: Uno | Bench,
        line: Line,
        clock: Clock,
        *,
        speed: Speed = "real",
        boot_s: float | None = BOOT_S,
        follow_baud: bool = False,
        say: Callable[[str], None],
        after_run: Callable[[], None],
    ) -> None:
        self._uno = uno
        self._line = line
        self._clock = clock
        self._real = speed == "real"
        self._boot_s = boot_s
        self._follow_baud = follow_baud
        self._refused_baud: int | None = None
        self._undelivered = b""
        self._boots_at_s: float | None = None  # in reset until then
        self._say = say
        self._after_run = after_run
        self._is_open = False
        self._stirred = True  # something happened on the line that is not looked at yet
        self._slept_s = 0.0
        self._look_at_s = 0.0  # the latest moment for the next look
        self._dtr_stayed_up = False
        self._opened = self._from_host = self._to_host = self._lost = 0
        self._lag_given_up_s = 0.0
        self._quiet_from_cycle = 0
        self._anchor_s = clock.now_s()
        self._anchor_cycle = uno.cycle

    @property
    def counts(self) -> BridgeCounts:
        """What passed so far."""
        return BridgeCounts(self._opened, self._from_host, self._to_host, self._lost, self._lag_given_up_s)

    def run(self, seconds: float | None = None, *, until: Callable[[], bool] = lambda: False) -> None:
        """Step for so many seconds of emulated time, or until `until` says so.

        Raises:
            StoppedError: the program came to an end; see `Uno.run`.
        """
        end = None if seconds is None else self._uno.cycle + round(seconds * CLOCK_HZ)
        while not until() and (end is None or self._uno.cycle < end):
            self.step(end)

    def step(self, end_cycle: int | None = None) -> None:
        """Run the chip up to now (at most to `end_cycle`), serve the line, and sleep for the time that is left."""
        self._look_at_the_line()
        if self._boots_at_s is not None:
            self._stay_in_reset(self._boots_at_s)
            return
        uno = self._uno
        target = min(self._target_cycle(), uno.cycle + round(MAX_CHUNK_S * CLOCK_HZ))
        if end_cycle is not None:
            target = min(target, end_cycle)
        if target > uno.cycle:
            uno.run(cycles=target - uno.cycle)
        self._to_line()
        self._from_line()
        self._after_run()  # last: what is recorded can wait, the host does not
        self._sleep()

    def resume(self) -> None:
        """Go on after a while in which the board stood still and the clock did not: nothing is to be made up."""
        self._anchor_s, self._anchor_cycle = self._clock.now_s(), self._uno.cycle

    def _look_at_the_line(self) -> None:
        """Notice what hosts did, unless nothing stirred in a short sleep just after a look: deliveries come first."""
        now_s = self._clock.now_s()
        if self._real and not self._stirred and self._slept_s <= 2 * AHEAD_S and now_s < self._look_at_s:
            return
        self._look_at_s = now_s + QUIET_SLICE_S
        self._notice_open()

    def _notice_open(self) -> None:
        if self._line.opened():
            self._opened += 1
            self._lost += len(self._uno.serial.read()) + len(self._undelivered)  # nobody was there
            self._undelivered = b""
            if self._boot_s is not None and not self._dtr_stayed_up:
                self._reset(self._boot_s)
        self._is_open = self._line.is_open()
        if self._is_open:
            self._dtr_stayed_up = self._line.keeps_dtr()
        if self._follow_baud and self._is_open:
            self._set_baud(self._line.baud())

    def _set_baud(self, baud: int | None) -> None:
        """Take the rate that the host has set; one that the board's USB bridge cannot make is told once."""
        if baud is None or baud in (self._uno.serial.baud, self._refused_baud):
            return
        try:
            self._uno.serial.baud = baud
        except UsageError as error:
            self._refused_baud = baud
            self._say(f"the host sets {baud} baud, the line stays at {self._uno.serial.baud}: {error}")

    def _reset(self, boot_s: float) -> None:
        uno = self._uno
        uno.run(cycles=max(uno.serial.idle_cycle - uno.cycle, 0))  # what is on the line is the old program's
        self._lost += uno.serial.discard()
        uno.reset()
        self._boots_at_s = self._clock.now_s() + boot_s

    def _stay_in_reset(self, boots_at_s: float) -> None:
        """Let the clock run and the board stand still; the boot loader gets what the host sends."""
        now_s = self._clock.now_s()
        if now_s < boots_at_s:
            self._line.read(RESET_READ_BYTES)
            self._line.wait(min(boots_at_s - now_s, QUIET_SLICE_S), for_bytes=False)
        else:
            self._boots_at_s = None
            self.resume()

    def _target_cycle(self) -> int:
        uno = self._uno
        if not self._real:
            return uno.cycle + round((QUIET_SLICE_S if self._is_quiet() else LIVELY_SLICE_S) * CLOCK_HZ)
        target = self._anchor_cycle + int((self._clock.now_s() - self._anchor_s) * CLOCK_HZ)
        lag_s = (target - uno.cycle) / CLOCK_HZ
        if lag_s > GIVE_UP_LAG_S:
            if self._lag_given_up_s == 0.0:
                self._say(
                    f"emulation is {lag_s:.2f} s behind the clock at {uno.time_s:.3f} s: the computer is too slow or "
                    f"too busy for real time; the board's clock lags from here on"
                )
            self._lag_given_up_s += lag_s
            self._anchor_s += lag_s
            return uno.cycle
        return target

    def _is_quiet(self) -> bool:
        return self._uno.cycle > self._quiet_from_cycle and self._uno.serial.pending == 0

    def _lively(self) -> None:
        self._quiet_from_cycle = self._uno.cycle + round(QUIET_AFTER_S * CLOCK_HZ)

    def _to_line(self) -> None:
        fresh = self._uno.serial.read()
        data = self._undelivered + fresh
        if not data:
            return
        if fresh:
            self._lively()
        self._is_open = self._is_open and self._line.is_open()  # else the next host would read old bytes
        taken = self._line.write(data) if self._is_open else 0
        self._to_host += taken
        if self._uno.serial.bridge is None or not self._is_open:
            self._lost += len(data) - taken
            self._undelivered = b""
        else:  # a host that does not read leaves the rest in the USB bridge, which runs over
            self._undelivered = data[taken:]
            self._uno.serial.host_takes = not self._undelivered

    def _from_line(self) -> None:
        data = self._line.read(self._uno.serial.room) if self._is_open else b""
        if data:
            self._from_host += len(data)
            self._uno.serial.write(data)
            self._lively()

    def _sleep(self) -> None:
        if self._real:
            ahead_s = (self._uno.cycle - self._anchor_cycle) / CLOCK_HZ - (self._clock.now_s() - self._anchor_s)
            self._slept_s = ahead_s + self._slice_s()
            self._stirred = self._line.wait(self._slept_s, for_bytes=self._uno.serial.room > 0)

    def _slice_s(self) -> float:
        """How much emulated time may pass before the line wants to be served, unless the host sends something."""
        serial, cycle = self._uno.serial, self._uno.cycle
        if serial.bridge is None:
            most_s = QUIET_SLICE_S if self._is_quiet() else LIVELY_SLICE_S
        else:  # the USB bridge hands bytes over at moments that are known before
            due_s = (serial.next_delivery_cycle - cycle) / CLOCK_HZ
            most_s = min(QUIET_SLICE_S, due_s if due_s < 2 * AHEAD_S or self._is_quiet() else due_s - AHEAD_S)
        if serial.room == 0:  # the host waits with more bytes, and those under way must not run out before
            most_s = min(most_s, (serial.idle_cycle - cycle) / CLOCK_HZ / 2)
        return max(most_s, LIVELY_SLICE_S if serial.bridge is None else LEAST_SLICE_S)
