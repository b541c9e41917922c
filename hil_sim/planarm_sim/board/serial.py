"""The host's end of the Uno's serial line, in emulated time.

Frames are 8N1, ten bits a byte (ATmega328P datasheet, 20.4). Host to board, bytes follow one another without
gaps; board to host, a byte can be read once its stop bit has passed, or when the USB bridge has passed it on. The far
end samples in the middle of its own bits, so a program that set another baud rate is received as garbage here as well.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from planarm_sim.board.serial_log import FROM_BOARD, TO_BOARD, SerialLog, SerialLogState
from planarm_sim.board.usb_bridge import PACKET_BYTES, RING_BYTES, UsbBridge, UsbState, bridge_bit_cycles
from planarm_sim.cpu.chip import Chip
from planarm_sim.errors import UsageError

__all__ = ["CLOCK_HZ", "FRAME_BITS", "SerialPort", "SerialState", "Usb"]

Usb: TypeAlias = Literal["direct", "16u2"]

CLOCK_HZ = 16_000_000
FRAME_BITS = 10
MAX_BAUD = 2_000_000
"""Fastest rate of the chip's receiver at 16 MHz (datasheet, 20.10)."""


@dataclass(frozen=True, slots=True)
class SerialState:
    """What `SerialPort.snapshot` keeps."""

    baud: int
    burst_start: int
    burst_bytes: int
    ends: tuple[int, ...]
    received: bytes
    framing_errors: int
    log: SerialLogState
    usb: UsbState | None


class SerialPort:
    """Bytes to and from the board.

    Args:
        chip: the chip whose RXD and TXD this line is wired to.
        baud: the host's rate, bits a second.
        usb: what the host's end is. "direct": a UART of its own, exactly at its rate, whose bytes are there when their
            stop bit has passed. "16u2": the board's USB bridge; see `usb_bridge`.

    Attributes:
        bridge: the USB bridge; None when the line is direct.
    """

    def __init__(self, chip: Chip, baud: int, usb: Usb = "direct") -> None:
        if usb not in get_args(Usb):
            raise UsageError(f"usb is {usb!r}; a serial line is {' or '.join(map(repr, get_args(Usb)))}")
        self._chip = chip
        self.bridge = UsbBridge() if usb == "16u2" else None
        self._burst_start = 0  # cycle at which the bytes written without a gap began
        self._burst_bytes = 0
        self._ends: deque[int] = deque()  # ends of the stop bits still to come
        self._received = bytearray()
        self._framing_errors = 0
        self._log = SerialLog()
        self.baud = baud

    @property
    def baud(self) -> int:
        """The host's rate, bits a second; a change holds for the bytes written from then on.

        Raises:
            UsageError: set outside 300 to 2,000,000.
        """
        return self._baud

    @baud.setter
    def baud(self, value: int) -> None:
        if not 300 <= value <= MAX_BAUD:
            raise UsageError(f"baud is {value}; a 16 MHz Uno takes 300 to {MAX_BAUD}")
        # Cycles per bit as a ratio: exact, so that no rounding adds up.
        bit_cycles = (CLOCK_HZ, value) if self.bridge is None else (bridge_bit_cycles(value), 1)
        if self._burst_bytes:
            self._burst_start, self._burst_bytes = self._line_free_cycle(), 0
        self._baud, self._bit_cycles = value, bit_cycles

    @property
    def pending(self) -> int:
        """Bytes written whose stop bit has not passed yet."""
        while self._ends and self._ends[0] <= self._chip.cycle:
            self._ends.popleft()
        return len(self._ends)

    @property
    def idle_cycle(self) -> int:
        """Cycle at which the last byte written has passed; it may be over already."""
        return self._line_free_cycle()

    @property
    def next_delivery_cycle(self) -> int:
        """First cycle at which there may be bytes to read that are not there now, whatever the program does."""
        cycle = self._chip.cycle
        byte_cycles = FRAME_BITS * self._bit_cycles[0] // self._bit_cycles[1]
        return cycle + 1 if self.bridge is None else self.bridge.next_delivery_cycle(cycle, byte_cycles)

    @property
    def room(self) -> int:
        """Bytes that the host can hand over now; the USB bridge takes no more than its ring and one packet hold."""
        taken_ahead = RING_BYTES if self.bridge is None else RING_BYTES + PACKET_BYTES
        return max(0, taken_ahead - self.pending)

    @property
    def host_takes(self) -> bool:
        """Whether the host fetches what the USB bridge has for it; a direct line is always read.

        Raises:
            UsageError: set on a direct line.
        """
        return self.bridge is None or self.bridge.host_takes

    @host_takes.setter
    def host_takes(self, value: bool) -> None:
        if self.bridge is None:
            raise UsageError("a direct line has nobody who could leave bytes lying; make the board with usb='16u2'")
        self.bridge.advance(self._chip.cycle)
        self.bridge.host_takes = value
        self.bridge.advance(self._chip.cycle)

    @property
    def framing_errors(self) -> int:
        """Bytes received so far whose stop bit was not where the host looked: the baud rates differ."""
        return self._framing_errors

    def write(self, data: bytes) -> None:
        """Send bytes to the board; the first starts now, or after those still on their way.

        Raises:
            UsageError: something else than bytes.
        """
        if not isinstance(data, bytes | bytearray | memoryview):
            raise UsageError(
                f"a serial line takes bytes, not {type(data).__name__}: encode text, wrap numbers by bytes()"
            )
        if self._line_free_cycle() < self._chip.cycle:
            self._burst_start, self._burst_bytes = self._chip.cycle, 0
        bit_cycles = self._bit_cycles[0] / self._bit_cycles[1]
        for byte in data:
            start = self._line_free_cycle()
            self._chip.push_rx(start, bit_cycles, byte)
            self._burst_bytes += 1
            self._ends.append(self._line_free_cycle())
            self._log.add(start, self._ends[-1], TO_BOARD, byte)

    def read(self) -> bytes:
        """Take everything received so far."""
        self._fetch()
        data = bytes(self._received)
        self._received.clear()
        return data

    def discard(self) -> int:
        """Throw away everything that the board sent and nobody read, what lies in the USB bridge included.

        Returns:
            How many bytes that were.
        """
        lost = len(self.read())
        return lost if self.bridge is None else lost + self.bridge.discard(self._chip.cycle)

    def peek(self) -> bytes:
        """Everything received so far, left in place."""
        self._fetch()
        return bytes(self._received)

    def collect(self) -> bool:
        """Fetch the frames that the chip has sent, and tell whether there were any; the board does after every run."""
        frames = self._chip.drain_tx()
        if len(frames) == 0:
            return False
        ends, bit_cycles = frames["cycle"], frames["bit_cycles"]
        self._log.extend(ends - FRAME_BITS * bit_cycles, ends, FROM_BOARD, frames["byte"])
        data = frames["byte"].astype(np.uint8)
        if not self._hears_every_bit(int(bit_cycles.min()), int(bit_cycles.max())):
            heard, data = self._sample(frames["byte"].astype(np.int64), bit_cycles)
            ends = ends[heard]
        if self.bridge is None:
            self._received += data.tobytes()
            return True
        for end, byte in zip(ends.tolist(), data.tolist(), strict=True):
            self.bridge.receive(end, byte)
        return True

    def _fetch(self) -> None:
        if self.bridge is not None:
            self._received += self.bridge.fetch(self._chip.cycle)

    def snapshot(self) -> SerialState:
        """Copy the line's state."""
        return SerialState(
            self._baud,
            self._burst_start,
            self._burst_bytes,
            tuple(self._ends),
            bytes(self._received),
            self._framing_errors,
            self._log.snapshot(),
            self.bridge.snapshot() if self.bridge is not None else None,
        )

    def restore(self, state: SerialState) -> None:
        """Go back to `state`, of a line of the same kind.

        Raises:
            UsageError: it is of the other kind.
        """
        if (state.usb is None) != (self.bridge is None):
            raise UsageError("a snapshot of a board with another usb= cannot be restored here")
        if self.bridge is not None and state.usb is not None:
            self.bridge.restore(state.usb)
        self.baud = state.baud
        self._burst_start, self._burst_bytes = state.burst_start, state.burst_bytes
        self._ends = deque(state.ends)
        self._received = bytearray(state.received)
        self._framing_errors = state.framing_errors
        self._log.restore(state.log)

    @property
    def log(self) -> NDArray[Any]:
        """Every frame on the wire both ways since power-up, or since `clear_log`, in order of its stop bit.

        Returns:
            Structured array: start, end (int64: cycles at which its start bit begins and its stop bit ends), direction
            (uint8: 0 to the board, 1 from it) and byte (uint16, as its sender meant it). A frame that is still on its
            way to the board is there, one that the board has not finished is not.
        """
        return self._log.recorded()

    def clear_log(self) -> None:
        """Forget the frames recorded so far."""
        self._log = SerialLog()

    def take_log(self) -> NDArray[Any]:
        """Return the frames that are over as `log` does, and forget them; for runs without end."""
        return self._log.take(self._chip.cycle)

    def _line_free_cycle(self) -> int:
        """First cycle after the last byte written; exact, so that no rounding adds up over a burst."""
        cycles, per = self._bit_cycles
        return self._burst_start - (-self._burst_bytes * FRAME_BITS * cycles // per)

    def _hears_every_bit(self, least: int, most: int) -> bool:
        """Tell whether this end samples each of ten bits once, of a board whose bits last `least` to `most` cycles.

        Bit n is sampled n + 1/2 host bits after the start, and lasts from n to n + 1 board bits. So a host bit must be
        18/19 of a board's or longer (bit 9 is not bit 8 again) and shorter than 18/17 (bit 8 is not yet bit 9).
        """
        cycles, per = self._bit_cycles
        return 18 * per * most <= 19 * cycles and 17 * cycles < 18 * per * least

    def _sample(self, data: NDArray[Any], board_bit_cycles: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        """Receive frames as a UART of another rate does, each from its start bit on; the line is high after it.

        Returns:
            Which frames were heard at all, a mask of all of them, and the bytes that these became.
        """
        waves = data << 1 | 0x200  # start bit, eight data bits from the lowest on, stop bit
        ratios = self._bit_cycles[0] / self._bit_cycles[1] / board_bit_cycles
        places = np.minimum(((np.arange(FRAME_BITS) + 0.5) * ratios[:, None]).astype(np.int64), FRAME_BITS - 1)
        samples = waves[:, None] >> places & 1
        heard = samples[:, 0] == 0  # else the middle of the host's start bit finds the line high: a spike
        samples = samples[heard]
        self._framing_errors += int(np.count_nonzero(samples[:, -1] == 0))
        return heard, np.packbits(samples[:, 1:-1].astype(np.uint8), axis=1, bitorder="little")[:, 0]
