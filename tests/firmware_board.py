"""The firmware on a board, driven from Python, and what a motion's edges should be.

The board is either the core, built for this computer, on a simple simulation of its timer and pins, or the released
flash image on the emulated Uno.
"""

from __future__ import annotations

import ctypes
import itertools
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from planarm_sim import Uno
from planarm_wire.boards import Board as Wiring
from planarm_wire.codec import decode, encode, encoded_bytes
from planarm_wire.framing import Frame, FrameDecoder, encode_frame
from planarm_wire.messages import (
    BAUD,
    BOARDS,
    MAX_COARSE_STEPS,
    PROTOCOL_VERSION,
    QUEUE_BYTES,
    QUEUE_FRAME_BYTES,
    Clear,
    Enable,
    Hello,
    Message,
    Move,
    Query,
    Segment,
    Segments,
    Start,
    State,
    Status,
    Welcome,
)
from planarm_wire.steps import direction, duration_ticks, expand_moves

LEAD_TICKS = 60_000
WAKE_TICKS = 340_000  # ENABLE, the mark in EEPROM, the drivers
ANSWER_TICKS = 120_000  # the longest frame, what it asks for, and the answer, on the line one after the other
REST = Move(0, 0, 0, 0)
UNO = BOARDS["uno"]

SUPERVISOR_EVENTS = [
    "enable",
    "release",
    "segments",
    "start",
    "clear",
    "hold",
    "resume",
    "stop",
    "quick_stop",
    "config",
    "soft_limits",
    "home",
    "set_position",
    "at_rest",
    "starved",
    "fed",
    "done",
    "clear_kept",
]
"""In the order of supervisor::Event."""


@dataclass(frozen=True)
class Delays:
    """How long things take on the simulated board, in ticks. The defaults are near the Uno's."""

    pass_ticks: int = 600
    entry_ticks: int = 58
    late_entry_ticks: int = 0
    late_every: int = 0
    leave_ticks: int = 16


@dataclass(frozen=True)
class Edge:
    tick: int
    pin: str
    level: int


class _Edge(ctypes.Structure):
    _fields_ = (("tick", ctypes.c_uint64), ("pin", ctypes.c_uint8), ("level", ctypes.c_uint8))


class _Delays(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_uint32) for name in ("pass", "entry", "late_entry", "late_every", "leave"))


class Firmware(Protocol):
    """One board, as the host's end sees it. Ticks are cycles of 62.5 ns."""

    wiring: Wiring

    def power_on(self, boot_count: int, tick: int, delays: Delays) -> None: ...

    def receive(self, data: bytes) -> None: ...

    def run(self, ticks: int) -> None: ...

    def now(self) -> int: ...

    def take_sent(self) -> bytes: ...

    def take_edges(self) -> list[Edge]: ...


class EmulatedFirmware:
    """The released image on the emulated Uno. Boot counts, start ticks and delays are the chip's own."""

    BOOT_CYCLES = 500_000

    def __init__(self, image: Path, wiring: Wiring = UNO, *, bootloader: Path | None = None) -> None:
        self.wiring = wiring
        self.uno = Uno.from_hex(image, baud=BAUD, bootloader=bootloader)
        self.uno.run(cycles=self.BOOT_CYCLES)
        self.uno.clear_edges()
        self._booted = self.uno.snapshot()

    def power_on(self, _boot_count: int, _tick: int, _delays: Delays) -> None:
        self.uno.restore(self._booted)

    def receive(self, data: bytes) -> None:
        self.uno.serial.write(data)

    def run(self, ticks: int) -> None:
        self.uno.run(cycles=ticks)

    def now(self) -> int:
        return self.uno.cycle

    def take_sent(self) -> bytes:
        return self.uno.serial.read()

    def take_edges(self) -> list[Edge]:
        found = [
            Edge(int(cycle), pin, int(level))
            for pin in (*self.wiring.step_pins, *self.wiring.dir_pins, self.wiring.enable_pin)
            for cycle, level in self.uno.edges(pin)
        ]
        self.uno.clear_edges()
        return sorted(found, key=lambda edge: edge.tick)


class NativeFirmware:
    """The shared library that `firmware/build.py native` makes. It holds one board."""

    def __init__(self, library: Path, wiring: Wiring = UNO) -> None:
        self.wiring = wiring
        self._library = ctypes.CDLL(str(library))
        self._library.planarm_power_on.argtypes = (ctypes.c_uint32, ctypes.c_uint64, _Delays)
        self._library.planarm_receive.argtypes = (ctypes.c_char_p, ctypes.c_size_t)
        self._library.planarm_run.argtypes = (ctypes.c_uint64,)
        for name in ("planarm_signal", "planarm_state"):
            getattr(self._library, name).restype = ctypes.c_uint8
        self._library.planarm_signal.argtypes = (ctypes.c_uint8,)
        self._library.planarm_latch.argtypes = (ctypes.c_uint8,)
        self._library.planarm_set_inputs.argtypes = (ctypes.c_uint8,)
        self._library.planarm_now.restype = ctypes.c_uint64
        self._library.planarm_take_sent.restype = ctypes.c_size_t
        self._library.planarm_take_edges.restype = ctypes.c_size_t

    def power_on(self, boot_count: int, tick: int, delays: Delays) -> None:
        fields = (delays.pass_ticks, delays.entry_ticks, delays.late_entry_ticks, delays.late_every, delays.leave_ticks)
        self._library.planarm_power_on(boot_count, tick, _Delays(*fields))

    def receive(self, data: bytes) -> None:
        self._library.planarm_receive(data, len(data))

    def run(self, ticks: int) -> None:
        self._library.planarm_run(ticks)

    def now(self) -> int:
        return int(self._library.planarm_now())

    def signal(self, event: int) -> bool:
        """Give the supervisor an event; tell whether its table has a row for it."""
        return bool(self._library.planarm_signal(event))

    def state(self) -> State:
        """The supervisor's state."""
        return State(self._library.planarm_state())

    def latch(self, fault: int) -> None:
        """Latch a fault."""
        self._library.planarm_latch(fault)

    def set_inputs(self, inputs: int) -> None:
        """Set the inputs: bit j the limit switch of joint j, bit 7 the open stop input."""
        self._library.planarm_set_inputs(inputs)

    def take_sent(self) -> bytes:
        buffer = ctypes.create_string_buffer(65_536)
        count = self._library.planarm_take_sent(buffer, len(buffer))
        return buffer.raw[:count]

    def take_edges(self) -> list[Edge]:
        edges: list[Edge] = []
        buffer = (_Edge * 4096)()
        while count := self._library.planarm_take_edges(buffer, len(buffer)):
            edges += [Edge(edge.tick, f"D{edge.pin}", edge.level) for edge in buffer[:count]]
        return edges


class Board:
    """A board just powered on, with a host's end of the line: sequence numbers, and replies as messages."""

    def __init__(
        self, firmware: NativeFirmware, *, delays: Delays = Delays(), tick: int = 0, boot_count: int = 1
    ) -> None:
        self._firmware = firmware
        self.wiring = firmware.wiring
        self._decoder = FrameDecoder()
        self.seq = 0
        self.edges: list[Edge] = []
        self.replies: deque[tuple[int, Message]] = deque()
        firmware.power_on(boot_count, tick, delays)

    @property
    def now(self) -> int:
        return self._firmware.now()

    def receive(self, data: bytes) -> None:
        self._firmware.receive(data)

    def run(self, ticks: int) -> None:
        """Let time pass and collect edges and replies; every reply must be a good frame."""
        self._firmware.run(ticks)
        self.edges += self._firmware.take_edges()
        for item in self._decoder.feed(self._firmware.take_sent()):
            assert isinstance(item, Frame), item
            self.replies.append((item.seq, decode(item.type_code, item.payload, self.wiring.joints)))

    def forget_replies(self) -> None:
        """Drop what came so far, a frame that is not whole included."""
        self.replies.clear()
        self._decoder = FrameDecoder()

    def send(self, message: Message, *, seq: int | None = None) -> None:
        """Send one frame, with the next sequence number unless told otherwise."""
        self.receive(encode_frame(self.seq if seq is None else seq, *encode(message)))
        if seq is None:
            self.seq = (self.seq + 1) % 256

    def ask(self, message: Message | None = None, *, seq: int | None = None) -> Status:
        """Send a frame (QUERY unless told otherwise) and return the STATUS that answers it."""
        self.replies.clear()
        self.send(Query() if message is None else message, seq=seq)
        self.run(ANSWER_TICKS)
        last = self.replies[-1][1]
        assert isinstance(last, Status), last
        return last

    def hello(self, *, version: int = PROTOCOL_VERSION, nonce: int = 0x01020304, seq: int = 0) -> Welcome:
        """Open a session and return the WELCOME."""
        self.replies.clear()
        self.send(Hello(version, nonce), seq=seq)
        self.seq = (seq + 1) % 256
        self.run(ANSWER_TICKS)
        ((_, welcome),) = self.replies
        assert isinstance(welcome, Welcome), welcome
        return welcome

    def get_ready(self) -> Status:
        """HELLO and ENABLE, and the time that the drivers take to wake."""
        self.hello()
        self.ask(Enable(1))
        self.run(WAKE_TICKS)
        return self.ask()

    def recover(self) -> Status:
        """CLEAR and ENABLE, and the time that the drivers take to wake."""
        self.ask(Clear())
        self.ask(Enable(1))
        self.run(WAKE_TICKS)
        return self.ask()

    def stream(
        self,
        segments: Sequence[Segment],
        *,
        lead_ticks: int = LEAD_TICKS,
        slice_ticks: int = 8000,
        head: tuple[int, int, int] = (0, 0, 0),
    ) -> Status:
        """Play a whole motion, one segment a frame, keeping the queue full; return the first STATUS after its end.

        Keeps no window: for motions whose segments the board reads as fast as they come (Streamer for others).
        """
        waiting = deque(segments)
        started = False
        free = self.ask_now().free_bytes
        end = self.now + lead_ticks + sum(map(duration_ticks, segments)) + 10_000_000
        while self.now < end:
            while waiting and free >= encoded_bytes(message := Segments(*head, (waiting[0],))):
                self.send(message)
                waiting.popleft()
                free -= encoded_bytes(message) + QUEUE_FRAME_BYTES
                self.run(8000 if started else 40_000)
            if not started:
                self.send(Start(lead_ticks))
                started = True
            self.run(slice_ticks)
            status = self.ask_now()
            if status.state not in (State.RUNNING, State.STARVED):
                return status
            free = status.free_bytes
        raise AssertionError(f"the motion did not end: {status}")

    def ask_now(self) -> Status:
        """QUERY and return its STATUS as soon as it is there."""
        self.replies.clear()
        self.send(Query())
        end = self.now + 2_000_000
        while not any(seq == self.seq for seq, _ in self.replies):
            assert self.now < end, (
                "no answer: is more than HOST_WINDOW_BYTES on the line, so that the ring lost the QUERY?"
            )
            self.run(2000)
        status = self.replies[-1][1]
        assert isinstance(status, Status), status
        return status

    def rises(self, joint: int) -> list[int]:
        """The ticks of a joint's rising STEP edges so far."""
        return [edge.tick for edge in self.edges if edge.pin == self.wiring.step_pins[joint] and edge.level]

    def position_at(self, joint: int, tick: int) -> int:
        """Signed steps up to and with a tick, rebuilt from the pins."""
        positive = False
        position = 0
        for edge in itertools.takewhile(lambda edge: edge.tick <= tick, self.edges):
            if edge.pin == self.wiring.dir_pins[joint]:
                positive = bool(edge.level)
            elif edge.pin == self.wiring.step_pins[joint] and edge.level:
                position += 1 if positive else -1
        return position

    def motion_edges(self) -> list[Edge]:
        """All edges but ENABLE's."""
        return [edge for edge in self.edges if edge.pin != self.wiring.enable_pin]


def run_of(
    steps: int, *, first: int = 1000, interval: int = 1000, add: int = 0, positive: bool = True, fraction: int = 0
) -> Move:
    """A move with whole-tick interval and change, and a fraction of 2^-8 ticks more in the interval."""
    if steps == 0:
        return REST
    if steps == 1:
        return Move(2 + positive, first, 0, 0)
    return Move(
        2 * steps + positive, first, (interval << 8) + fraction, add << (8 if steps <= MAX_COARSE_STEPS else 16)
    )


def segment_of(duration: int, *moves: Move, last: bool = False, joints: int = UNO.joints) -> Segment:
    """A segment; joints without a move rest."""
    return Segment(2 * duration + last, (*moves, *(REST,) * (joints - len(moves))))


def room_after(*messages: Segments) -> int:
    """What STATUS tells as free when these are queued."""
    return QUEUE_BYTES - QUEUE_FRAME_BYTES - sum(encoded_bytes(m) + QUEUE_FRAME_BYTES for m in messages)


def end_motion(segments: Iterable[Segment]) -> list[Segment]:
    """The segments, the last of them marked as such."""
    *head, tail = segments
    return [*head, replace(tail, duration_flags=tail.duration_flags | 1)]


@dataclass(frozen=True)
class Schedule:
    """The edges that a motion should make, relative to its first segment's start: for each joint (tick, +1 or -1)."""

    steps: tuple[list[tuple[int, int]], ...]
    ends: list[int]

    @classmethod
    def of(cls, segments: Sequence[Segment]) -> Schedule:
        ends = list(itertools.accumulate(duration_ticks(segment) for segment in segments))
        steps: tuple[list[tuple[int, int]], ...] = tuple([] for _ in (segments[0].moves if segments else UNO.step_pins))
        for segment, start in zip(segments, [0, *ends], strict=False):
            for joint, ticks in enumerate(expand_moves(segment)):
                steps[joint].extend((start + tick, direction(segment.moves[joint])) for tick in ticks)
        return cls(steps, ends)

    def positions(self) -> tuple[int, ...]:
        return tuple(sum(sign for _, sign in joint) for joint in self.steps)
