"""Asks a device how far it got with a session that broke off, before HELLO makes it forget that.

Every frame that a device does not expect is answered by STATUS, whose sequence number is the one that it does expect.
So a QUERY with a number that is surely wrong tells which frames were taken.
"""

from planarm.errors import LinkError
from planarm.link.session import HELLO_LATER_PAUSE_S, HELLO_PAUSES_S, SessionLimits
from planarm.link.transport import Transport
from planarm_wire.codec import encode
from planarm_wire.framing import Frame, FrameDecoder, encode_frame
from planarm_wire.messages import DELIMITER, MessageType, Query

DRAIN_S = 0.05
"""Replies to a host that is gone may still be on their way: the USB bridge holds them for 4.1 ms, USB for some more."""
FAR_AHEAD = 128
"""Half of all numbers: farther from the expected one than any frame in flight."""
_SEQUENCE = 256
_READ_BYTES = 4096


class Knock:
    """Asks with a wrong number until a status comes; no I/O."""

    def __init__(self, known_seq: int, now_s: float, limits: SessionLimits) -> None:
        self.expected_seq: int | None = None
        self._limit_s = now_s + limits.hello_s
        self._limits = limits
        self._due_s = now_s
        self._knocks = 0
        self._decoder = FrameDecoder()
        query_type, payload = encode(Query())
        wrong = (known_seq + FAR_AHEAD) % _SEQUENCE
        self._frame = bytes([DELIMITER]) + encode_frame(wrong, query_type, payload)

    @property
    def deadline_s(self) -> float:
        """When `on_time` has something to do."""
        return min(self._due_s, self._limit_s)

    def on_time(self, now_s: float) -> bytes:
        """Return what is to be written; LinkError when nobody answers.

        The pauses are those of HELLO: a boot loader may be listening first.
        """
        if now_s >= self._limit_s:
            raise LinkError(f"no answer within {self._limits.hello_s:g} s; check the cable and the board's power")
        if now_s < self._due_s:
            return b""
        later = self._knocks >= len(HELLO_PAUSES_S)
        self._due_s = now_s + (HELLO_LATER_PAUSE_S if later else HELLO_PAUSES_S[self._knocks])
        self._knocks += 1
        return self._frame

    def receive(self, data: bytes) -> None:
        """Take in bytes from the device."""
        for frame in self._decoder.feed(data):
            if isinstance(frame, Frame) and frame.type_code == MessageType.STATUS:
                self.expected_seq = frame.seq


def ask_expected(transport: Transport, next_seq: int, limits: SessionLimits | None = None) -> int:
    """Return the number that the device expects; a motion in progress goes on.

    Args:
        transport: the line.
        next_seq: the number that the next frame of the session would have had.
        limits: how long to wait.

    Raises:
        LinkError: it does not answer.
    """
    clock = transport.clock
    quiet_s = clock.now_s() + DRAIN_S
    while clock.now_s() < quiet_s:
        transport.read(_READ_BYTES, quiet_s)
    knock = Knock(next_seq, clock.now_s(), limits or SessionLimits())
    while knock.expected_seq is None:
        if asked := knock.on_time(clock.now_s()):
            transport.write(asked)
        knock.receive(transport.read(_READ_BYTES, knock.deadline_s))
    return knock.expected_seq
