"""How many joints the device of a recording has: its WELCOME tells, and so does what it is told by CONFIG."""

from __future__ import annotations

from collections.abc import Iterable

from planarm.link.journal import Kind, Record
from planarm_wire.codec import decode
from planarm_wire.errors import WireError
from planarm_wire.framing import Frame, FrameDecoder
from planarm_wire.messages import JOINTS, Config, MessageType, Welcome

TELLING = (MessageType.WELCOME, MessageType.CONFIG)


def joints_told(records: Iterable[Record]) -> int:
    """Return the joints of the device; those of the usual board where no message tells."""
    decoders = {Kind.SENT: FrameDecoder(), Kind.RECEIVED: FrameDecoder()}
    for record in records:
        decoder = decoders.get(record.kind)
        for found in decoder.feed(record.data) if decoder else ():
            if isinstance(found, Frame) and found.type_code in TELLING:
                joints = _told_by(found)
                if joints is not None:
                    return joints
    return JOINTS


def _told_by(frame: Frame) -> int | None:
    try:
        message = decode(frame.type_code, frame.payload)
    except WireError:
        return None
    return message.joints if isinstance(message, Config | Welcome) else None
