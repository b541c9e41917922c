r"""Frames: header, header CRC, payload, payload CRC, byte-stuffed, ended by the delimiter. No I/O, no clock.

    length  seq  type | crc lo  crc hi | payload ... | crc lo  crc hi | 0x7E
    \___ header ____/  \\_ of header _/   length > 0    \ of payload /

The payload's CRC starts from the header's, so that a payload cannot be taken for another header's. The numbers
are those of `messages.toml`, section framing.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from planarm_wire.crc import crc16
from planarm_wire.errors import WireError
from planarm_wire.messages import (
    CRC_BYTES,
    DELIMITER,
    ESCAPE,
    ESCAPE_XOR,
    HEADER_BYTES,
    MAX_PAYLOAD_BYTES,
    RESERVED,
)

MAX_FRAME_BYTES: Final = 2 * (HEADER_BYTES + CRC_BYTES + MAX_PAYLOAD_BYTES + CRC_BYTES) + 1
"""The longest frame on the line: everything stuffed, and the delimiter."""

_STUFFED: Final = frozenset((DELIMITER, ESCAPE, *RESERVED))
_STUFFING: Final = {code: bytes((ESCAPE, code ^ ESCAPE_XOR)) for code in _STUFFED}
_HEAD_BYTES: Final = HEADER_BYTES + CRC_BYTES
_LONGEST: Final = _HEAD_BYTES + MAX_PAYLOAD_BYTES + CRC_BYTES


class FrameFault(Enum):
    """Why a stretch of bytes between two delimiters is no frame, in the order in which it is looked for."""

    BAD_ESCAPE = "an escape byte is not followed by the code of an escaped byte"
    TOO_LONG = "more bytes than the header announces, or than any frame may have"
    TRUNCATED = "fewer bytes than the header announces"
    HEADER_CRC = "the header's CRC is wrong"
    PAYLOAD_CRC = "the payload's CRC is wrong"


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame that passed all checks."""

    seq: int
    type_code: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class FrameError:
    """A stretch of bytes between two delimiters that is no frame."""

    cause: FrameFault
    byte_count: int
    """Bytes on the line since the delimiter before, without either delimiter and without dropped reserved bytes."""

    def __str__(self) -> str:
        return f"damaged frame of {self.byte_count} bytes: {self.cause.value}"


def encode_frame(seq: int, type_code: int, payload: bytes) -> bytes:
    """Return the frame's bytes as they go on the line, ending with the delimiter.

    Raises WireError when `seq` or `type_code` is no byte or the payload is longer than MAX_PAYLOAD_BYTES.
    """
    for name, value in (("seq", seq), ("type_code", type_code)):
        if not 0 <= value <= 0xFF:
            raise WireError(f"frame: {name} {value} is outside 0 .. 255")
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise WireError(
            f"frame: a payload of {len(payload)} bytes is over MAX_PAYLOAD_BYTES = {MAX_PAYLOAD_BYTES}; "
            "send fewer segments in one message"
        )
    header = bytes((len(payload), seq, type_code))
    header_crc = crc16(header)
    body = header + header_crc.to_bytes(CRC_BYTES, "little")
    if payload:
        body += payload + crc16(payload, header_crc).to_bytes(CRC_BYTES, "little")
    stuffed = b"".join(_STUFFING.get(byte) or bytes((byte,)) for byte in body)
    return stuffed + bytes((DELIMITER,))


class FrameDecoder:
    """Turns bytes, in chunks of any size, into frames and frame errors. Holds at most one frame's bytes."""

    __slots__ = ("_bad_escape", "_body", "_byte_count", "_escaped")

    def __init__(self) -> None:
        self._restart()

    def feed(self, data: bytes) -> list[Frame | FrameError]:
        """Take the next bytes of the line and return what they completed, in order.

        Whatever came before, a whole frame that follows a delimiter is returned. Never raises.
        """
        found: list[Frame | FrameError] = []
        for byte in data:
            if byte == DELIMITER:
                if self._byte_count:
                    found.append(self._close())
                self._restart()
            elif byte not in RESERVED:
                self._take(byte)
        return found

    def _restart(self) -> None:
        self._body = bytearray()
        self._byte_count = 0
        self._escaped = False
        self._bad_escape = False

    def _take(self, byte: int) -> None:
        self._byte_count += 1
        if byte == ESCAPE:
            self._bad_escape |= self._escaped
            self._escaped = True
            return
        if self._escaped:
            byte ^= ESCAPE_XOR
            self._bad_escape |= byte not in _STUFFED
            self._escaped = False
        if len(self._body) <= _LONGEST:  # one byte more than any frame has is enough to know that it is too long
            self._body.append(byte)

    def _close(self) -> Frame | FrameError:
        body = bytes(self._body)
        cause = FrameFault.BAD_ESCAPE if self._bad_escape or self._escaped else _fault(body)
        if cause is not None:
            return FrameError(cause, self._byte_count)
        length, seq, type_code = body[:HEADER_BYTES]
        return Frame(seq, type_code, body[_HEAD_BYTES : _HEAD_BYTES + length])


def _fault(body: bytes) -> FrameFault | None:
    """Return what is wrong with a frame's unstuffed bytes, or None."""
    if len(body) > _LONGEST:
        return FrameFault.TOO_LONG
    if len(body) < _HEAD_BYTES:
        return FrameFault.TRUNCATED
    header_crc = crc16(body[:HEADER_BYTES])
    if header_crc != int.from_bytes(body[HEADER_BYTES:_HEAD_BYTES], "little"):
        return FrameFault.HEADER_CRC
    length = body[0]
    expected = _HEAD_BYTES + (length + CRC_BYTES if length else 0)
    if length > MAX_PAYLOAD_BYTES or len(body) > expected:
        return FrameFault.TOO_LONG
    if len(body) < expected:
        return FrameFault.TRUNCATED
    sound = not length or crc16(body[_HEAD_BYTES:-CRC_BYTES], header_crc) == int.from_bytes(body[-CRC_BYTES:], "little")
    return None if sound else FrameFault.PAYLOAD_CRC
