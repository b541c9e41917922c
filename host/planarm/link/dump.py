"""A byte stream or a journal as readable messages, one line each, and what they add up to."""

from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any

from planarm.link.journal import Kind, Record
from planarm.link.told_joints import joints_told
from planarm_wire.codec import decode
from planarm_wire.errors import WireError
from planarm_wire.framing import Frame, FrameDecoder, FrameError
from planarm_wire.messages import (
    HOLD_CODE,
    JOINTS,
    RESERVED,
    TICKS_HZ,
    Fault,
    Hello,
    Message,
    Result,
    Segments,
    Status,
    Welcome,
)
from planarm_wire.steps import duration_ticks, is_last, signed_steps

_SEQUENCE = 256
_WINDOW = 128


@dataclass(frozen=True, slots=True)
class Line:
    """One message, note or damage; `t_s` is None in a bare byte stream."""

    t_s: float | None
    way: str
    text: str

    def __str__(self) -> str:
        time = "" if self.t_s is None else f"{self.t_s:12.6f}  "
        return f"{time}{self.way} {self.text}"


@dataclass(slots=True)
class LineFigures:
    """What a recording adds up to.

    Attributes:
        messages: of each type, copies left out.
        copies: frames sent again.
        damaged: stretches of bytes that are no frame.
        round_trips_s: from a frame's sending to the reply that acknowledges it, where it was sent once.
        least_free_bytes: of the device's queue.
        most_free_bytes: of the device's queue.
        faults: that the device told.
    """

    messages: Counter[str] = field(default_factory=Counter)
    copies: int = 0
    damaged: int = 0
    round_trips_s: list[float] = field(default_factory=list)
    least_free_bytes: int | None = None
    most_free_bytes: int | None = None
    faults: set[str] = field(default_factory=set)

    def figures(self) -> dict[str, Any]:
        """Return them as plain values; round trips as median, 99th percentile and largest, in ms."""
        trips = sorted(self.round_trips_s)
        at = {"p50": 0.5, "p99": 0.99, "max": 1.0}
        return {
            "messages": dict(sorted(self.messages.items())),
            "copies": self.copies,
            "damaged": self.damaged,
            "round_trip_ms": {
                name: round(1e3 * trips[min(int(share * len(trips)), len(trips) - 1)], 3) for name, share in at.items()
            }
            if trips
            else {},
            "free_bytes": [self.least_free_bytes, self.most_free_bytes],
            "faults": sorted(self.faults),
        }


class Dump:
    """Reads records in order; `lines` yields text, `figures` grows with it."""

    def __init__(self) -> None:
        self.figures = LineFigures()
        self._to_device, self._to_host = FrameDecoder(), FrameDecoder()
        self._in_flight: deque[tuple[int, float, bool]] = deque()  # number expected after it, when, sent once
        self._next_seq: int | None = None
        self._joints = JOINTS

    def lines(self, records: Iterable[Record]) -> Iterator[Line]:
        """Yield a line for each message, note and damage."""
        records = list(records)
        self._joints = joints_told(records)
        for record in records:
            if record.kind is Kind.NOTE:
                told = ", ".join(f"{key} {value}" for key, value in record.note().items())
                yield Line(record.t_s, "--", told)
            elif record.kind is Kind.SENT:
                yield from self._sent(record.data, record.t_s)
            else:
                yield from self._received(record.data, record.t_s)

    def _sent(self, data: bytes, t_s: float | None) -> Iterator[Line]:
        for code in data:
            if code in RESERVED:
                yield Line(t_s, "->", "HOLD" if code == HOLD_CODE else "EMERGENCY STOP, one of three")
        for found in self._to_device.feed(data):
            copy = isinstance(found, Frame) and self._is_copy(found, t_s)
            yield Line(t_s, "->", self._text(found) + (" (again)" if copy else ""))
            self.figures.copies += copy
            if not copy:
                self._count(found)

    def _received(self, data: bytes, t_s: float | None) -> Iterator[Line]:
        for found in self._to_host.feed(data):
            self._count(found)
            trip = self._round_trip(found.seq, t_s) if isinstance(found, Frame) and t_s is not None else ""
            yield Line(t_s, "<-", self._text(found) + trip)

    def _is_copy(self, frame: Frame, t_s: float | None) -> bool:
        """Whether a frame was sent before; notes when it went out."""
        if isinstance(self._message(frame), Hello):
            self._next_seq = (frame.seq + 1) % _SEQUENCE
            self._in_flight.clear()
            return False
        behind = 0 if self._next_seq is None else (self._next_seq - frame.seq) % _SEQUENCE
        following = (frame.seq + 1) % _SEQUENCE
        if 0 < behind < _WINDOW:
            self._in_flight = deque((seq, at, once and seq != following) for seq, at, once in self._in_flight)
            return True
        if behind == 0:
            self._next_seq = following
            if t_s is not None:
                self._in_flight.append((following, t_s, True))
        return False

    def _round_trip(self, expected: int, t_s: float) -> str:
        if expected not in [seq for seq, _, _ in self._in_flight]:
            return ""
        while self._in_flight:
            seq, at, once = self._in_flight.popleft()
            if seq == expected:
                if once:
                    self.figures.round_trips_s.append(t_s - at)
                return f", after {1e3 * (t_s - at):.2f} ms"
        return ""

    def _count(self, found: Frame | FrameError) -> None:
        figures, message = self.figures, self._message(found)
        if message is None:
            figures.damaged += 1
            return
        figures.messages[type(message).__name__.upper()] += 1
        if isinstance(message, Status):
            free = message.free_bytes
            figures.least_free_bytes = min(free, figures.least_free_bytes or free)
            figures.most_free_bytes = max(free, figures.most_free_bytes or free)
            if message.fault is not Fault.NONE:
                figures.faults.add(message.fault.name.lower())

    def _text(self, found: Frame | FrameError) -> str:
        message = self._message(found)
        if isinstance(found, FrameError):
            return str(found)
        if message is None:
            return f"#{found.seq:<3} a frame of unknown form, type {found.type_code:#04x}"
        return f"#{found.seq:<3} {describe(message)}"

    def _message(self, found: Frame | FrameError) -> Message | None:
        if isinstance(found, FrameError):
            return None
        try:
            return decode(found.type_code, found.payload, self._joints)
        except WireError:
            return None


def stream_lines(data: bytes, dump: Dump) -> Iterator[Line]:
    """Yield the messages of the bytes that a host sent."""
    yield from (Line(None, line.way, line.text) for line in dump.lines([Record(Kind.SENT, 0.0, data)]))


def describe(message: Message) -> str:
    """Return a message in words."""
    if isinstance(message, Segments):
        return _segments(message)
    if isinstance(message, Status):
        return _status(message)
    if isinstance(message, Welcome):
        version = ".".join(map(str, message.firmware_version))
        return (
            f"WELCOME firmware {version}, boot {message.boot_nonce:#010x} ({message.reset_cause.name.lower()}),"
            f" {message.ledger.executed_segments} segments, {message.ledger.position_usteps} usteps"
        )
    told = ", ".join(f"{one.name} {_value(getattr(message, one.name))}" for one in fields(message))
    return f"{type(message).__name__.upper()} {told}".rstrip()


def _segments(message: Segments) -> str:
    parts = []
    for segment in message.segments:
        steps = ", ".join(f"{signed_steps(move):+d}" for move in segment.moves)
        last = " last" if is_last(segment) else ""
        parts.append(f"{1e3 * duration_ticks(segment) / TICKS_HZ:.3f} ms ({steps}){last}")
    return f"SEGMENTS {'; '.join(parts)}; slow {message.slow}, fast {message.fast}, need {message.need}"


def _status(message: Status) -> str:
    ledger = message.ledger
    text = (
        f"STATUS {message.state.name.lower()}, {ledger.executed_segments} segments, {ledger.position_usteps} usteps,"
        f" {message.free_bytes} bytes free, rate {message.rate_percent} %"
    )
    if message.fault is not Fault.NONE:
        text += f", fault {message.fault.name.lower()}"
    if message.refusal is not Result.OK:
        text += f", refused #{message.refusal_seq}: {message.refusal.name.lower()}"
    return text


def _value(value: object) -> str:
    return value.name.lower() if isinstance(value, Enum) else str(value)
