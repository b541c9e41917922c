"""Intel HEX, read strictly.

Format: Intel, "Hexadecimal Object File Format Specification", revision A, 1988. A record is
``:LLAAAATT<data>CC``: length, address, type, data, and a checksum that makes the byte sum of the record 0
modulo 256. Types: 00 data, 01 end of file, 02 extended segment address (x 16), 03 start segment address,
04 extended linear address (x 65536), 05 start linear address. Start addresses mean nothing to an AVR, which
starts at its reset vector; they are checked and dropped.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from planarm_sim.errors import ImageError
from planarm_sim.loader.image import FlashBuilder, Image

__all__ = ["parse_hex"]

DATA, END, EXTENDED_SEGMENT, START_SEGMENT, EXTENDED_LINEAR, START_LINEAR = range(6)

ADDRESS_RECORD_BYTES = {END: 0, EXTENDED_SEGMENT: 2, START_SEGMENT: 4, EXTENDED_LINEAR: 2, START_LINEAR: 4}
"""Data bytes that each type but DATA must carry."""

RECORD = re.compile(r":(?:[0-9A-Fa-f]{2}){5,}")
HEADER_BYTES = 4
WINDOW_BYTES = 0x10000
"""A record's own address has 16 bits; one record must not run over the end of that window."""


@dataclass(frozen=True, slots=True)
class _Record:
    kind: int
    address: int
    data: bytes


def parse_hex(text: str, source: str) -> Image:
    """Read an Intel HEX file.

    Args:
        text: the file's content; line ends may be LF or CR LF.
        source: the file's name, for messages.

    Raises:
        ImageError: any deviation from the format, bytes outside the flash or given twice, no data, no
            end-of-file record; the message names file, line, value and limit.
    """
    builder = FlashBuilder(source)
    base = 0
    ended = False
    for number, line in enumerate(text.splitlines(), start=1):
        place = f"line {number}"
        if not line:
            continue
        if ended:
            raise ImageError(f"{source}, {place}: a record after the end-of-file record")
        record = _parse_record(line, f"{source}, {place}")
        if record.kind == DATA:
            builder.place(base + record.address, record.data, place)
        elif record.kind == EXTENDED_SEGMENT:
            base = int.from_bytes(record.data, "big") * 16
        elif record.kind == EXTENDED_LINEAR:
            base = int.from_bytes(record.data, "big") * WINDOW_BYTES
        ended = record.kind == END
    if not ended:
        raise ImageError(f"{source}: the end-of-file record (:00000001FF) is missing; the file may be cut off")
    return builder.build()


def _parse_record(line: str, where: str) -> _Record:
    if RECORD.fullmatch(line) is None:
        raise ImageError(f"{where}: {line[:24]!r} is not a record: ':' and at least five pairs of hex digits")
    raw = bytes.fromhex(line[1:])
    length, address, kind = raw[0], int.from_bytes(raw[1:3], "big"), raw[3]
    data = raw[HEADER_BYTES:-1]
    if len(data) != length:
        raise ImageError(f"{where}: the record announces {length} data bytes and holds {len(data)}")
    if (checksum := -sum(raw[:-1]) & 0xFF) != raw[-1]:
        raise ImageError(f"{where}: checksum 0x{raw[-1]:02X}, should be 0x{checksum:02X}; the file is damaged")
    _check_form(kind, address, data, where)
    return _Record(kind, address, data)


def _check_form(kind: int, address: int, data: bytes, where: str) -> None:
    if kind == DATA:
        if address + len(data) > WINDOW_BYTES:
            raise ImageError(f"{where}: {len(data)} bytes at 0x{address:04X} run over the record's limit 0xFFFF")
        return
    if kind not in ADDRESS_RECORD_BYTES:
        raise ImageError(f"{where}: record type {kind:02X}; Intel HEX has 00 to 05")
    if len(data) != ADDRESS_RECORD_BYTES[kind]:
        raise ImageError(
            f"{where}: a record of type {kind:02X} holds {ADDRESS_RECORD_BYTES[kind]} data bytes, not {len(data)}"
        )
    if address != 0 and kind != END:
        raise ImageError(f"{where}: a record of type {kind:02X} has address 0x0000, not 0x{address:04X}")
