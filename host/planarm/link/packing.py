"""Segments into SEGMENTS messages: as full as they can be, each at most half of the window long.

So one message is on the line while the other is acknowledged.
"""

from collections.abc import Sequence

from planarm.link.session import Session
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import HOST_WINDOW_BYTES, Segment, Segments
from planarm_wire.rates import (
    MESSAGE_SEGMENTS,
    NO_ALLOWANCE,
    SEGMENTS_HEAD_BYTES,
    SHARED_PAYLOAD_BYTES,
    Allowance,
    head_of,
)

FRAME_BYTES = HOST_WINDOW_BYTES // 2


class Packer:
    """Hands out a motion's segments message by message.

    Args:
        session: whose next frame a message will be; its number decides how many bytes are stuffed.
        segments: the motion.
        allowances: one a segment, or none.

    Attributes:
        sent: segments taken so far.
        until: segments from this number on are kept back.
        payload_bytes: of the next message, once `next_message` has returned it.
    """

    def __init__(self, session: Session, segments: Sequence[Segment], allowances: Sequence[Allowance]) -> None:
        self.sent = 0
        self._session = session
        self._segments = tuple(segments)
        self._allowances = tuple(allowances) or (NO_ALLOWANCE,) * len(self._segments)
        self.until = len(self._segments)
        self.payload_bytes = 0
        self._message: Segments | None = None
        self._looked_at_seq = -1

    def keep_back(self, first: int) -> None:
        """Hand out no segment from number `first` on.

        Raises:
            ValueError: it was taken.
        """
        if first < self.sent:
            raise ValueError(f"segment {first} cannot be kept back: {self.sent} were taken")
        self.until, self._message = first, None

    def go_on_with(self, segments: Sequence[Segment], allowances: Sequence[Allowance]) -> None:
        """Hand out these from now on; those that were taken are the same."""
        self._segments, self._allowances = tuple(segments), tuple(allowances)
        self.until, self._message = len(segments), None

    def next_message(self) -> Segments | None:
        """Return the next segments, as many as one message may hold; None when all are taken or kept back."""
        if self._message is not None and self._looked_at_seq == self._session.next_seq:
            return self._message  # asked about at every pass: it is coded once
        stale = self._message is None or self._is_long(self._message)  # stuffing changes with the frame's number
        if stale and self.sent < self.until:
            self._message = self._pack()
            self.payload_bytes = encoded_bytes(self._message)
        self._looked_at_seq = self._session.next_seq
        return self._message

    def take(self) -> None:
        """Count the next message as sent."""
        if self._message is not None:
            self.sent += len(self._message.segments)
        self._message = None

    def _pack(self) -> Segments:
        count, room_bytes = 0, SHARED_PAYLOAD_BYTES - SEGMENTS_HEAD_BYTES
        for segment in self._segments[self.sent : min(self.until, self.sent + MESSAGE_SEGMENTS)]:
            room_bytes -= encoded_bytes(segment)
            if room_bytes < 0 and count:
                break
            count += 1
        message = self._message_of(count)
        while self._is_long(message):
            message = self._message_of(len(message.segments) - 1)
        return message

    def _message_of(self, count: int) -> Segments:
        """Return the next `count` segments as a message; its head holds for all of them."""
        part = slice(self.sent, self.sent + count)
        return Segments(*head_of(self._allowances[part]), self._segments[part])

    def _is_long(self, message: Segments) -> bool:
        """Whether `message` takes more than its share of the window and can be made shorter."""
        return len(message.segments) > 1 and self._session.encoded_bytes(message) > FRAME_BYTES
