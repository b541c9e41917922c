"""A transport that keeps a journal: nothing leaves before it is on disk."""

from planarm.link.arm_record import ArmTrace
from planarm.link.clock import Clock
from planarm.link.journal import MOST_BYTES, JournalWriter, Kind
from planarm.link.transport import PinTrace, Transport
from planarm_wire.framing import Frame, FrameDecoder
from planarm_wire.messages import RESERVED, MessageType

HARMLESS = frozenset((MessageType.HELLO, MessageType.QUERY))
"""What moves nothing: it need not be on the disk before it is sent."""


class RecordingTransport:
    """Another transport, with everything that passes it in a journal."""

    def __init__(self, line: Transport, journal: JournalWriter) -> None:
        self.line = line
        self.journal = journal

    @property
    def clock(self) -> Clock:
        """The line's."""
        return self.line.clock

    @property
    def pins(self) -> PinTrace | None:
        """The line's."""
        return self.line.pins

    @property
    def arm(self) -> ArmTrace | None:
        """The line's."""
        return self.line.arm

    def nonce(self) -> int:
        """The line's."""
        return self.line.nonce()

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        """Read, and keep what came."""
        data = self.line.read(max_bytes, deadline_s)
        if data and self.journal.size < MOST_BYTES:
            self.journal.add(Kind.RECEIVED, self.clock.now_s(), data)
        return data

    def write(self, data: bytes) -> None:
        """Keep `data`, have it on the disk if it can move anything, and only then write it.

        Raises:
            OutputError: it cannot be kept; nothing is written to the line.
        """
        matters = moves_something(data)
        if matters or self.journal.size < MOST_BYTES:
            self.journal.add(Kind.SENT, self.clock.now_s(), data)
        if matters:
            self.journal.sync()
        self.line.write(data)

    def close(self) -> None:
        """Close the line and the journal."""
        self.line.close()
        self.journal.close()


def moves_something(data: bytes) -> bool:
    """Whether bytes to the device are more than questions; what is no whole frame may be anything."""
    if not set(RESERVED).isdisjoint(data):
        return True
    frames = FrameDecoder().feed(data)
    return not all(isinstance(frame, Frame) and frame.type_code in HARMLESS for frame in frames)
