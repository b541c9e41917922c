"""The emulated Uno in this process, as a transport in virtual time. The one place in the host that knows the emulator.

Time passes for the emulator only while the host waits for it: `read` runs the chip until a reply has come out or the
deadline is reached, so a run is deterministic and as fast as the emulator computes. `Uno.serial` paces bytes at the
baud rate in both directions, ten bits a byte.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from planarm.errors import HostKilledError, LinkError
from planarm.link.arm_record import ArmSetup
from planarm.link.clock import Clock
from planarm.link.sim_bench import SimArm, build_bench
from planarm_wire.boards import Board
from planarm_wire.messages import BAUD, BOARDS, TICKS_HZ

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from planarm_sim import Bench, Uno
    from planarm_sim.faults import FaultRunner

SLICE_CYCLES = 1600
"""Where the USB bridge or a fault has to be looked after: a byte is noticed at most 100 us after it came."""
BITS_PER_BYTE = 10
QUIET_BYTES = 1.25
"""Else a reply is taken once the line has been quiet for so many byte times; 50 us at 250,000 baud."""
WAIT_CYCLES = 1_600_000
"""Longest piece of waiting for a reply, a tenth of a second."""


class EmulatorClock:
    """The emulated board's time; waiting runs the board, and the arm with it."""

    def __init__(self, uno: "Uno | Bench") -> None:
        self._uno = uno

    def now_s(self) -> float:
        """Emulated seconds since power-up."""
        return self._uno.cycle / TICKS_HZ

    def wait_until(self, t_s: float) -> None:
        """Run the board until its time is `t_s`."""
        if self.now_s() < t_s:
            _run(self._uno, _cycle_after(t_s))


class SimTransport:
    """A line to an Uno emulated from a flash image; `pins` shows its edges, `uno` is the board itself.

    With a setup drivers, motors and an arm stand around it, and `arm` shows what they do. `usb` is "direct", or "16u2"
    with the delays and limits of the board's USB bridge. `board` says how the image is wired. Without a setup its stop
    contact is closed.
    """

    def __init__(
        self,
        image: str | Path,
        baud: int = BAUD,
        setup: ArmSetup | None = None,
        usb: Literal["direct", "16u2"] = "direct",
        board: Board = BOARDS["uno"],
    ) -> None:
        from planarm_sim import SimError, Uno  # noqa: PLC0415 - brings Numba, which only emulation needs

        try:
            self.uno = Uno.from_hex(image, baud=baud, usb=usb)
        except (SimError, OSError) as error:
            raise LinkError(f"port sim://: {error}") from error
        self._machine: Uno | Bench = self.uno
        self._faults: FaultRunner | None = None
        self.arm: SimArm | None = None
        if setup is not None:
            self._machine, self._faults = build_bench(self.uno, setup)
            self.arm = SimArm(self._machine, self._faults)
        else:
            self.uno.pin(board.stop_pin).drive(0)  # a stop contact is closed while all is well
        self.clock: Clock = EmulatorClock(self._machine)
        self.pins = EmulatorPins(self.uno, board)
        self._received = bytearray()
        self._nonces = count(1)
        self._open = True

    def nonce(self) -> int:
        """1, 2, 3 ...: the same run has the same bytes."""
        return next(self._nonces)

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        """Run the board until it has sent something or its time is `deadline_s`; return at most `max_bytes` bytes."""
        self._check_open("read")
        uno, line = self.uno, self._machine.serial
        self._received += line.read()
        while not self._received and uno.cycle / TICKS_HZ < deadline_s:
            self._await_reply(deadline_s)
            self._meet_faults("read")
            self._received += line.read()
        data = bytes(self._received[:max_bytes])
        del self._received[:max_bytes]
        return data

    def write(self, data: bytes) -> None:
        """Put `data` on the line; it reaches the chip byte by byte as time passes."""
        self._check_open("write")
        self._meet_faults("write")
        self._machine.serial.write(data)

    def close(self) -> None:
        """Stop using the board; its pins stay readable."""
        self._open = False

    def _await_reply(self, deadline_s: float) -> None:
        """Run to the end of what the board sends next, or a slice where something else may come between."""
        uno, machine = self.uno, self._machine
        end = _cycle_after(deadline_s)
        if self._faults is not None or uno.serial.bridge is not None:
            _run(machine, min(uno.cycle + SLICE_CYCLES, end))
            return
        quiet = round(QUIET_BYTES * BITS_PER_BYTE * TICKS_HZ / uno.serial.baud)
        with _told_as_link_error():
            machine.run_to_reply(cycles=int(min(WAIT_CYCLES, end - uno.cycle)), quiet_cycles=quiet)

    def _meet_faults(self, action: str) -> None:
        """Do what a schedule of faults does to the host itself: its cable, its processor, its life."""
        faults = self._faults
        if faults is None:
            return
        if pause := faults.host_pause_cycles():
            _run(self._machine, self.uno.cycle + pause)
        if faults.host_killed:
            raise HostKilledError(f"port sim://: {faults.schedule.source} killed the host at {self.uno.time_s:.6f} s")
        if faults.unplugged:
            raise LinkError(f"port sim://: {action} at {self.uno.time_s:.6f} s: the cable is out")

    def _check_open(self, action: str) -> None:
        if not self._open:
            raise LinkError(f"port sim://: {action} after it was closed")


class EmulatorPins:
    """The emulated board's pins."""

    def __init__(self, uno: "Uno", board: Board) -> None:
        self._uno = uno
        self._board = board

    def edges(self, pin: str) -> "NDArray[Any]":
        """Edges of `pin` since power-up, as a structured array (cycle int64, level uint8)."""
        return self._uno.edges(pin)

    def write_vcd(self, path: Path) -> None:
        """Write the waveforms of STEP, DIR and ENABLE pins since power-up to a VCD file."""
        self._uno.write_vcd(path, self._board.driver_pins)


def _cycle_after(t_s: float) -> float:
    """Clock cycle that is surely not before `t_s`, whatever the rounding; infinity stays infinity."""
    return math.floor(t_s * TICKS_HZ) + 1 if math.isfinite(t_s) else t_s


def _run(uno: "Uno | Bench", cycle: float) -> None:
    """Run to `cycle`; an instruction may end a little later."""
    with _told_as_link_error():
        uno.run(cycles=max(0, int(cycle) - uno.cycle))


@contextmanager
def _told_as_link_error() -> Iterator[None]:
    from planarm_sim import SimError  # noqa: PLC0415

    try:
        yield
    except SimError as error:
        raise LinkError(f"port sim://: {error}") from error
