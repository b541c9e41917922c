"""Packets of GDB's remote serial protocol: ``$payload#checksum``, acknowledged by ``+`` or ``-``.

GDB manual, appendix "GDB Remote Serial Protocol", "Overview". Bytes in, events out; no I/O here.
"""

from __future__ import annotations

from typing import Final

__all__ = ["INTERRUPT", "RESEND", "PacketReader", "packet", "unescape"]

INTERRUPT: Final = b"\x03"
"""Event: the user pressed Ctrl-C."""
RESEND: Final = b"-"
"""Event: the other side did not understand the last packet."""
ESCAPE, ESCAPED_BY = 0x7D, 0x20
MAX_PACKET: Final = 0x4000


def checksum(payload: bytes) -> int:
    """Sum of the bytes modulo 256."""
    return sum(payload) & 0xFF


def packet(payload: bytes) -> bytes:
    """Frame a payload that holds none of ``$ # } *``; ours are hexadecimal and words."""
    return b"$" + payload + b"#" + f"{checksum(payload):02x}".encode()


def unescape(data: bytes) -> bytes:
    """Undo the escapes of binary data (packet X)."""
    result = bytearray()
    at = 0
    while at < len(data):
        if data[at] == ESCAPE and at + 1 < len(data):
            at += 1
            result.append(data[at] ^ ESCAPED_BY)
        else:
            result.append(data[at])
        at += 1
    return bytes(result)


class PacketReader:
    """Takes the other side's bytes apart."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> tuple[list[bytes], bytes]:
        """Take bytes; returns events (payloads with ``$`` before them, INTERRUPT, RESEND) and the acknowledgements."""
        self._buffer += data
        events: list[bytes] = []
        answers = bytearray()
        while self._buffer:
            first = bytes(self._buffer[:1])
            if first in (INTERRUPT, RESEND):
                events.append(first)
            elif first == b"$":
                end = self._buffer.find(b"#")
                if (end < 0 or len(self._buffer) < end + 3) and len(self._buffer) < MAX_PACKET:
                    break  # more to come
                payload, told = bytes(self._buffer[1:end]), bytes(self._buffer[end + 1 : end + 3])
                good = end > 0 and told.lower() == f"{checksum(payload):02x}".encode()
                answers += b"+" if good else b"-"
                if good:
                    events.append(b"$" + payload)
                del self._buffer[: end + 2 if end > 0 else len(self._buffer) - 1]
            del self._buffer[:1]
        return events, bytes(answers)
