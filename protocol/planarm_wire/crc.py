"""CRC-16/MCRF4XX, the check of header and payload.

Polynomial 0x1021 reflected (0x8408), initial 0xFFFF, no final xor: the check value of "123456789" is 0x6F91
(catalogue of parametrised CRC algorithms, G. Cook). It is what avr-libc's `_crc_ccitt_update` computes.
"""

from __future__ import annotations

from typing import Final

from planarm_wire.messages import CRC_INITIAL

_REFLECTED_POLYNOMIAL: Final = 0x8408


def _table_entry(value: int) -> int:
    for _ in range(8):
        value = (value >> 1) ^ (_REFLECTED_POLYNOMIAL if value & 1 else 0)
    return value


_TABLE: Final = tuple(_table_entry(byte) for byte in range(256))


def crc16(data: bytes, initial: int = CRC_INITIAL) -> int:
    """Return the CRC of `data`, continuing from `initial` (the CRC of what came before, if anything did)."""
    crc = initial
    for byte in data:
        crc = (crc >> 8) ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc
