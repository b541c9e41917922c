"""The words in which a message's layout is told: scalars with their ranges, and fields made of them.

The specification's reader, the generated `messages` and the codec share these; nothing here knows a message.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

END: Final = -1
"""The `repeat` of a field that goes on to the payload's end."""

EACH_JOINT: Final = -2
"""The `repeat` of a field that is there once for each of the device's joints."""

MAX_VARINT_BYTES: Final = 5
"""LEB128 carries 7 bits a byte, so 32 bits need five."""


@dataclass(frozen=True, slots=True)
class Scalar:
    """A number on the wire: its range, and its size in bytes (least and most; they differ for LEB128)."""

    minimum: int
    maximum: int
    min_bytes: int
    max_bytes: int
    signed: bool
    c_type: str


SCALARS: Final[dict[str, Scalar]] = {
    "u8": Scalar(0, 2**8 - 1, 1, 1, False, "uint8_t"),
    "u16": Scalar(0, 2**16 - 1, 2, 2, False, "uint16_t"),
    "u32": Scalar(0, 2**32 - 1, 4, 4, False, "uint32_t"),
    "i8": Scalar(-(2**7), 2**7 - 1, 1, 1, True, "int8_t"),
    "i32": Scalar(-(2**31), 2**31 - 1, 4, 4, True, "int32_t"),
    "varuint": Scalar(0, 2**32 - 1, 1, MAX_VARINT_BYTES, False, "uint32_t"),
    "varint": Scalar(-(2**31), 2**31 - 1, 1, MAX_VARINT_BYTES, True, "int32_t"),
}


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message or struct, as the codec reads and writes it."""

    name: str
    kind: str | type
    """A key of SCALARS, or the struct's class."""
    repeat: int | None = None
    """How many times, as a tuple; END: the rest of the payload, EACH_JOINT: once a joint; None: a plain value."""
    when: tuple[str, int] | None = None
    """(earlier field, least value): below it this field is absent from the wire and 0 in the message."""
    enum: type[IntEnum] | None = None
    """The codes that a scalar may take."""
