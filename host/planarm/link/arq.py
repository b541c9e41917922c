"""Go-back-N with cumulative acknowledgements: every frame is carried out once, in order, whatever the line loses.

The device takes only the frame it expects next and tells in every reply which number that is (`[sequence]` of
messages.toml). The sender here keeps what is not yet acknowledged, within a window of encoded bytes that the device's
receive ring can hold, and sends all of it again when

- no acknowledgement came for the retransmission time-out, or
- a reply repeats the acknowledgement that was already known while frames are in flight: the device has seen a frame it
  could not use, so one before it was lost.

A repeated acknowledgement is believed once in a time-out only, and not sooner after the frame was sent than any answer
ever came: such a reply was under way before the frame arrived. Copies that turn out to be superfluous are answered with
repeated acknowledgements too, and without that rule each answer would cause the next copies (the "sorcerer's
apprentice" of RFC 1123, 4.2.3.1). It is not believed at all when the reply says that the device is merely out of room
for the oldest frame: that frame is asked again at the time-out.

The time-out follows the measured round trip as in RFC 6298 (Karn's rule included), between two bounds. At 250,000 baud
a full window takes 4.5 ms to send and a reply 1.3 ms; the Uno's USB bridge holds replies for up to 4.1 ms (its timer 0
overflows every 65,536 cycles of 16 MHz) and USB adds about 1 ms each way. 20 ms lies above that sum of 12 ms with room
for the computer's scheduler. 250 ms keeps a line alive whose USB chip holds bytes for 16 ms and more, and still asks
several times before the link is given up. Time-outs in a row grow by half, not by the RFC's factor of two: nobody else
uses this line, so there is no congestion to yield to, and a motion waits for the bytes.

No I/O: methods take the time and return the bytes to write.
"""

from collections import deque
from dataclasses import dataclass
from enum import Enum, auto

from planarm_wire.messages import DELIMITER, HOST_WINDOW_BYTES

INITIAL_TIMEOUT_S = 0.050
MIN_TIMEOUT_S = 0.020
MAX_TIMEOUT_S = 0.250
BACK_OFF = 1.5
LONG_FRAME_BYTES = 30
"""As long as this, a frame tells what a full window of them takes."""

_SEQUENCE = 256
_LEAD = bytes([DELIMITER])  # ends whatever noise the device has gathered since the last frame


class Ack(Enum):
    """What an acknowledgement says."""

    ADVANCED = auto()
    REPEATED = auto()
    STRAY = auto()  # names a frame that was never sent: the device does not have our sequence


@dataclass(frozen=True, slots=True)
class Resent:
    """Frames that were sent again: when, how many, and whether no answer came in time (else the device asked)."""

    at_s: float
    frames: int
    unanswered: bool


@dataclass(slots=True)
class ArqCounters:
    """What the sender did since the session's start."""

    frames_sent: int = 0  # first transmissions
    retransmissions: int = 0  # frames sent again
    timeouts: int = 0
    repeated_acks: int = 0
    busy_replies: int = 0
    bytes_sent: int = 0  # copies and leading delimiters included
    bytes_taken: int = 0  # of frames that were acknowledged, each counted once


@dataclass(slots=True)
class _Outstanding:
    frame: bytes
    room: int
    sent_s: float
    first_sent_s: float
    first: bool = True  # never sent again, so its round trip can be measured


class GoBackN:
    """The sender's side; frames come encoded, so that the window counts what the line carries."""

    def __init__(self, next_seq: int, window_bytes: int = HOST_WINDOW_BYTES) -> None:
        self.next_seq = next_seq
        self.window_bytes = window_bytes
        self.bytes_in_flight = 0
        self.room_in_flight = 0
        self.counters = ArqCounters()
        self.resent: list[Resent] = []
        self.answered_s: float | None = None
        """When the newest acknowledged frame was first sent: every later reply was made after that."""
        self.quickest_s = float("inf")
        """Least time from a frame's first sending to its acknowledgement."""
        self._outstanding: deque[_Outstanding] = deque()
        self._smoothed_s: float | None = None
        self._least_s = 0.0
        self._deviation_s = 0.0
        self.round_trip_s = 0.0  # the newest that was measured
        self._timeout_s = self._least_timeout_s = INITIAL_TIMEOUT_S
        self._patience = 1.0  # grows with every time-out in a row
        self._timer_s = 0.0
        self._deaf_until_s = float("-inf")

    @property
    def idle(self) -> bool:
        """Whether everything sent has been acknowledged."""
        return not self._outstanding

    @property
    def deadline_s(self) -> float:
        """When `on_time` has something to send again; infinity when nothing is in flight."""
        return self._timer_s + self._wait_s if self._outstanding else float("inf")

    def fits(self, frame: bytes) -> bool:
        """Whether `frame` may go out now without exceeding the window."""
        return self.bytes_in_flight + len(frame) <= self.window_bytes

    def send(self, frame: bytes, room: int, now_s: float) -> bytes:
        """Take `frame`, encoded with `next_seq`, into the window and return the bytes to write.

        `room` is what the frame takes of the device's queue, in bytes. The caller asks `fits` first.
        """
        if not self.fits(frame):
            raise ValueError(f"{len(frame)} bytes do not fit: {self.bytes_in_flight} of {self.window_bytes} in flight")
        if not self._outstanding:
            self._timer_s = now_s
        self._outstanding.append(_Outstanding(frame, room, now_s, now_s))
        self.bytes_in_flight += len(frame)
        self.room_in_flight += room
        self.next_seq = (self.next_seq + 1) % _SEQUENCE
        self.counters.frames_sent += 1
        self.counters.bytes_sent += len(frame)
        return frame

    def on_ack(self, ack: int, free_room: int, now_s: float) -> tuple[Ack, bytes]:
        """Take in a reply: `ack` is the number the device expects next, `free_room` what it can queue.

        Returns what the acknowledgement says, and the bytes to write again, if any.
        """
        advance = (ack - self.next_seq + len(self._outstanding)) % _SEQUENCE
        if advance > len(self._outstanding):
            return Ack.STRAY, b""
        if advance == 0:
            return Ack.REPEATED, self._on_repeated(free_room, now_s)
        for _ in range(advance):
            newest = self._outstanding.popleft()
            self.bytes_in_flight -= len(newest.frame)
            self.counters.bytes_taken += len(newest.frame)
            self.room_in_flight -= newest.room
        self.answered_s = newest.first_sent_s
        self.quickest_s = min(self.quickest_s, now_s - newest.first_sent_s)
        if newest.first:
            self._measure(now_s - newest.sent_s, len(newest.frame))
        self._timer_s = now_s
        return Ack.ADVANCED, b""

    def on_time(self, now_s: float) -> bytes:
        """Return the bytes to write again when the time-out has passed, else nothing."""
        if now_s < self.deadline_s:
            return b""
        self._patience *= BACK_OFF
        self.counters.timeouts += 1
        return self._go_back(now_s, unanswered=True)

    @property
    def _soonest_s(self) -> float:
        """The least time in which an answer ever came; that of frames sent again, too, while there are no others."""
        return self._least_s or (0.0 if self.quickest_s == float("inf") else self.quickest_s)

    @property
    def _wait_s(self) -> float:
        return min(self._timeout_s * self._patience, MAX_TIMEOUT_S)

    def _on_repeated(self, free_room: int, now_s: float) -> bytes:
        if not self._outstanding:
            return b""
        if self._outstanding[0].room > free_room:
            self.counters.busy_replies += 1
            return b""
        self.counters.repeated_acks += 1
        if now_s < self._deaf_until_s or now_s - self._outstanding[0].sent_s < self._soonest_s:
            return b""
        return self._go_back(now_s, unanswered=False)

    def _go_back(self, now_s: float, *, unanswered: bool) -> bytes:
        copies = _LEAD
        for outstanding in self._outstanding:
            outstanding.sent_s = now_s
            outstanding.first = False
            copies += outstanding.frame
        self._timer_s = now_s
        self._deaf_until_s = now_s + self._wait_s
        self.resent.append(Resent(now_s, len(self._outstanding), unanswered))
        self.counters.retransmissions += len(self._outstanding)
        self.counters.bytes_sent += len(copies)
        return copies

    def _measure(self, round_trip_s: float, frame_bytes: int) -> None:
        """RFC 6298, section 2; only such a measurement ends the growth of the time-out (section 5).

        Short frames alone on a slow line come back long before the frames of a full window would: until a long one was
        measured the time-out gets no shorter than it began.
        """
        self._patience = 1.0
        self.round_trip_s = round_trip_s
        if self._smoothed_s is None:
            self._smoothed_s, self._deviation_s, self._least_s = round_trip_s, round_trip_s / 2, round_trip_s
        else:
            self._deviation_s += (abs(self._smoothed_s - round_trip_s) - self._deviation_s) / 4
            self._smoothed_s += (round_trip_s - self._smoothed_s) / 8
            self._least_s = min(self._least_s, round_trip_s)
        if frame_bytes >= LONG_FRAME_BYTES:
            self._least_timeout_s = MIN_TIMEOUT_S
        self._timeout_s = min(max(self._smoothed_s + 4 * self._deviation_s, self._least_timeout_s), MAX_TIMEOUT_S)
