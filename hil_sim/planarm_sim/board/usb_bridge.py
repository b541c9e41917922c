"""The Uno's USB bridge: an ATmega16U2 with the program `arduino-usbserial`, in emulated time.

What it does to bytes, from its source (arduino-core-avr, firmwares/atmegaxxu2/arduino-usbserial/Arduino-usbserial.c):

- Towards the host, the receive interrupt puts each byte into a ring of 128, without looking whether it is full. The
  main loop hands the ring's bytes to USB when timer 0 (8 bits, clk/256) has overflown, every 4.096 ms, or when more
  than 96 wait. A packet has at most 64 bytes; a host that does not fetch it holds up the main loop, which gives up a
  byte after 100 ms (LUFA's USB_STREAM_TIMEOUT_MS), while the ring runs over.
- Towards the board, bytes wait in another ring of 128, which takes none when it is full, and behind it in the packet of
  64 that the host sent last.
- Its baud rate comes from the same divider as the board's, so that 115,200 means 117,647 on both sides.
- Framing errors are not looked at: what was sampled is passed on.

The main loop's own time, some microseconds a turn, counts as none. A packet takes the time that lets 19 of them into a
frame of 1 ms (USB 2.0, table 5-9).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from planarm_sim.errors import UsageError

__all__ = ["FLUSH_CYCLES", "PACKET_BYTES", "RING_BYTES", "UsbBridge", "UsbState", "bridge_bit_cycles"]

RING_BYTES: Final = 128
NEARLY_FULL: Final = 96
PACKET_BYTES: Final = 64
FLUSH_CYCLES: Final = 256 * 256
"""Between two overflows of its timer 0, at the same 16 MHz as the board."""
PACKET_CYCLES: Final = 16_000 // 19
GIVE_UP_CYCLES: Final = 1_600_000
LEAST_BAUD: Final = 489
"""16 MHz / 8 / 4096: the divider has twelve bits."""


def bridge_bit_cycles(baud: int) -> int:
    """Cycles per bit of the bridge's UART: U2X but at 57,600, as LUFA's SERIAL_2X_UBBRVAL and SERIAL_UBBRVAL round.

    Raises:
        UsageError: slower than the divider goes.
    """
    if baud < LEAST_BAUD:
        raise UsageError(f"baud is {baud}; the Uno's USB bridge takes {LEAST_BAUD} and more")
    samples = 16 if baud == 57_600 else 8
    return samples * ((16_000_000 // samples + baud // 2) // baud)


@dataclass(frozen=True, slots=True)
class UsbState:
    """What `UsbBridge.snapshot` keeps."""

    ring: bytes
    places: tuple[int, int, int]
    packet: bytes
    packets: tuple[tuple[int, bytes], ...]
    counters: tuple[int, int, int, int | None]
    flags: tuple[bool, bool]
    overrun_bytes: int


class UsbBridge:
    """The way from the board to the host; the other way is paced by `SerialPort` alone.

    Attributes:
        host_takes: whether the host fetches packets; set by whoever plays the host, for what comes from now on.
        overrun_bytes: bytes that were put into a ring full by the firmware's count, which starts anew after 255.
    """

    def __init__(self) -> None:
        self._ring = bytearray(RING_BYTES)
        self._in = self._out = self._count = 0
        self._packet = bytearray()
        self._packets: deque[tuple[int, bytes]] = deque()  # with the cycle at which the host has them
        self._free_at = 0  # cycle from which the endpoint can send again
        self._next_tick = FLUSH_CYCLES
        self._left = 0  # bytes that the flush under way still has to hand over
        self._gives_up_at: int | None = None
        self._ticked = False
        self.host_takes = True
        self.overrun_bytes = 0

    def receive(self, cycle: int, byte: int) -> None:
        """The UART has a byte; cycles do not go back."""
        self.advance(cycle)
        self._ring[self._in] = byte
        self._in = (self._in + 1) % RING_BYTES
        self.overrun_bytes += self._count >= RING_BYTES
        self._count = (self._count + 1) & 0xFF  # the firmware counts in eight bits
        self._look(cycle)

    def advance(self, cycle: int) -> None:
        """Let time pass up to `cycle`."""
        while True:
            due = self._next_tick if self._gives_up_at is None else min(self._next_tick, self._gives_up_at)
            if due > cycle:
                break
            if due == self._next_tick:
                self._ticked = True
                self._next_tick += FLUSH_CYCLES
            self._look(due)
        self._look(cycle)

    def fetch(self, cycle: int) -> bytes:
        """Take what the host has received by `cycle`."""
        self.advance(cycle)
        data = bytearray()
        while self._packets and self._packets[0][0] <= cycle:
            data += self._packets.popleft()[1]
        return bytes(data)

    def discard(self, cycle: int) -> int:
        """Throw away what the host does not have by `cycle`; returns how many bytes."""
        lost = len(self.fetch(cycle)) + self._count + len(self._packet) + sum(len(data) for _, data in self._packets)
        self._out, self._count, self._left = self._in, 0, 0
        self._packet.clear()
        self._packets.clear()
        self._gives_up_at = None
        return lost

    def next_delivery_cycle(self, cycle: int, byte_cycles: int) -> int:
        """First cycle from `cycle` on at which the host may have bytes, if the board sends one each `byte_cycles`."""
        self.advance(cycle)
        if self._packets:
            return self._packets[0][0]
        nearly_full = cycle + max(0, NEARLY_FULL + 1 - self._count) * byte_cycles
        return max(cycle, self._free_at, min(self._next_tick, nearly_full)) + PACKET_CYCLES

    def snapshot(self) -> UsbState:
        """Copy the state."""
        return UsbState(
            bytes(self._ring),
            (self._in, self._out, self._count),
            bytes(self._packet),
            tuple(self._packets),
            (self._free_at, self._next_tick, self._left, self._gives_up_at),
            (self._ticked, self.host_takes),
            self.overrun_bytes,
        )

    def restore(self, state: UsbState) -> None:
        """Go back to `state`."""
        self._ring[:] = state.ring
        self._in, self._out, self._count = state.places
        self._packet = bytearray(state.packet)
        self._packets = deque(state.packets)
        self._free_at, self._next_tick, self._left, self._gives_up_at = state.counters
        self._ticked, self.host_takes = state.flags
        self.overrun_bytes = state.overrun_bytes

    def _look(self, cycle: int) -> None:
        """A turn of the main loop: go on with a flush, or begin one."""
        if self._left:
            self._hand_over(cycle)
        while not self._left and (self._ticked or self._count > NEARLY_FULL):
            self._ticked = False
            self._left = self._count
            self._hand_over(cycle)

    def _hand_over(self, cycle: int) -> None:
        """Move the flush's bytes into packets, as far as the host takes them."""
        while self._left:
            if len(self._packet) == PACKET_BYTES and not self._send(cycle):
                if self._gives_up_at is None:
                    self._gives_up_at = cycle + GIVE_UP_CYCLES
                if cycle < self._gives_up_at:
                    return
                self._remove()  # and lost
                self._gives_up_at = None
                continue
            self._gives_up_at = None
            self._packet.append(self._remove())
        if self._packet:
            self._send(cycle)

    def _remove(self) -> int:
        byte = self._ring[self._out]
        self._out = (self._out + 1) % RING_BYTES
        self._count = (self._count - 1) & 0xFF
        self._left -= 1
        return byte

    def _send(self, cycle: int) -> bool:
        if not self.host_takes:
            return False
        self._free_at = max(cycle, self._free_at) + PACKET_CYCLES
        self._packets.append((self._free_at, bytes(self._packet)))
        self._packet.clear()
        return True
