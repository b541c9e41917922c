"""Messages to payloads and back, by the layouts in `messages`. No I/O, no state.

Only the form is checked here: sizes, ranges of the types, known codes. The limits on values (a segment's duration,
the least interval) are kept by the host's certificate and by the firmware.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sized
from typing import Any, Final, SupportsIndex, cast

from planarm_wire.errors import WireError
from planarm_wire.layout import EACH_JOINT, END, MAX_VARINT_BYTES, SCALARS, Field
from planarm_wire.messages import BOARDS, JOINTS, LAYOUTS, MAX_PAYLOAD_BYTES, MESSAGES, Message, Struct

_VARINTS: Final = ("varuint", "varint")
_JOINT_COUNTS: Final = frozenset(board.joints for board in BOARDS.values())


def encode(message: Message) -> tuple[int, bytes]:
    """Return the message's type code and payload.

    Raises WireError, naming message and field, when a value does not fit its type, when a field that the wire
    leaves out is not 0, or when the payload grows over MAX_PAYLOAD_BYTES.
    """
    place = _name(type(message))
    payload = bytearray()
    _write(message, payload, place)
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise WireError(
            f"{place}: the payload has {len(payload)} bytes, over MAX_PAYLOAD_BYTES = {MAX_PAYLOAD_BYTES}; "
            "put fewer segments into one message"
        )
    return int(message.TYPE), bytes(payload)


def decode(type_code: int, payload: bytes, joints: int = JOINTS) -> Message:
    """Return the message that a payload holds, from or for a device with so many joints.

    A message that tells the number of joints itself, as WELCOME does, is read by what it tells.

    Raises WireError, naming message and field, when the type is unknown, the payload is too short or too long, a
    number is written in more bytes than it needs or is outside its type, or a code is none of its enumeration.
    """
    kind = MESSAGES.get(type_code)
    if kind is None:
        raise WireError(f"message type 0x{type_code:02X} is unknown to this version of the protocol")
    place = _name(kind)
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise WireError(f"{place}: a payload of {len(payload)} bytes is over MAX_PAYLOAD_BYTES = {MAX_PAYLOAD_BYTES}")
    values, end = _read(kind, payload, 0, place, joints)
    if end != len(payload):
        raise WireError(f"{place}: {len(payload) - end} bytes are left over after the last field")
    return cast("Message", values)


def encoded_bytes(item: Message | Struct) -> int:
    """Return how many payload bytes a message or struct takes, such as one segment of SEGMENTS."""
    out = bytearray()
    _write(item, out, _name(type(item)))
    return len(out)


def _name(kind: type) -> str:
    return kind.__name__.lower()


def _write(item: Message | Struct, out: bytearray, place: str) -> None:
    for field in LAYOUTS[type(item)]:
        value = getattr(item, field.name)
        if field.when is not None and getattr(item, field.when[0]) < field.when[1]:
            if value != 0:
                raise WireError(
                    f"{place}.{field.name}: is {value}, but must be 0 while {_condition(field)} does not hold"
                )
        elif field.repeat is None:
            _write_one(field, value, out, place, "")
        else:
            _check_count(field, value, f"{place}.{field.name}")
            for index, entry in enumerate(value):
                _write_one(field, entry, out, place, index)


def _write_one(field: Field, value: object, out: bytearray, place: str, index: int | str) -> None:
    """Append a value; places are put into words for errors only, as a host writes thousands of numbers a second."""
    if isinstance(field.kind, type):
        if type(value) is not field.kind:
            raise WireError(f"{_here(place, field, index)}: is {value!r}, not a {field.kind.__name__}")
        _write(cast("Struct", value), out, _here(place, field, index))
        return
    try:
        number = operator.index(cast("SupportsIndex", value))  # numpy's integers are welcome, floats are not
    except TypeError:
        raise WireError(f"{_here(place, field, index)}: is {value!r}, not a whole number") from None
    scalar = SCALARS[field.kind]
    if field.enum is not None or not scalar.minimum <= number <= scalar.maximum:
        _check_number(field, number, _here(place, field, index))
    if field.kind not in _VARINTS:
        out += number.to_bytes(scalar.max_bytes, "little", signed=scalar.signed)
        return
    if scalar.signed:
        number = (number << 1) ^ (number >> 31)
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)


def _here(place: str, field: Field, index: int | str) -> str:
    return f"{place}.{field.name}" if index == "" else f"{place}.{field.name}[{index}]"


def _read(kind: type[Any], data: bytes, at: int, place: str, joints: int) -> tuple[Any, int]:
    values: dict[str, Any] = {}
    for field in LAYOUTS[kind]:
        here = f"{place}.{field.name}"
        if _is_absent(field, values.__getitem__):
            values[field.name] = 0
        elif field.repeat is None:
            values[field.name], at = _read_one(field, data, at, here, joints)
            if field.name == "joints" and values["joints"] in _JOINT_COUNTS:
                joints = values["joints"]
        else:
            entries: list[Any] = []
            count = joints if field.repeat == EACH_JOINT else field.repeat
            while len(entries) != count and (count != END or at < len(data)):
                entry, at = _read_one(field, data, at, f"{here}[{len(entries)}]", joints)
                entries.append(entry)
            _check_count(field, entries, here)
            values[field.name] = tuple(entries)
    return kind(**values), at


def _read_one(field: Field, data: bytes, at: int, place: str, joints: int) -> tuple[Any, int]:
    if isinstance(field.kind, type):
        return _read(field.kind, data, at, place, joints)
    scalar = SCALARS[field.kind]
    if field.kind in _VARINTS:
        number, at = _read_leb128(data, at, place)
        if scalar.signed:
            number = (number >> 1) ^ -(number & 1)
    else:
        end = at + scalar.max_bytes
        if end > len(data):
            raise WireError(f"{place}: the payload ends {end - len(data)} bytes short of this {field.kind}")
        number, at = int.from_bytes(data[at:end], "little", signed=scalar.signed), end
    _check_number(field, number, place)
    return (number if field.enum is None else field.enum(number)), at


def _read_leb128(data: bytes, at: int, place: str) -> tuple[int, int]:
    number = 0
    for index, byte in enumerate(data[at : at + MAX_VARINT_BYTES]):
        number |= (byte & 0x7F) << (7 * index)
        if byte & 0x80:
            continue
        if byte == 0 and index > 0:
            raise WireError(f"{place}: the number is written in more bytes than it needs")
        if number > SCALARS["varuint"].maximum:
            raise WireError(f"{place}: {number} is over 32 bits")
        return number, at + index + 1
    if at + MAX_VARINT_BYTES <= len(data):
        raise WireError(f"{place}: the number goes on after {MAX_VARINT_BYTES} bytes")
    raise WireError(f"{place}: the payload ends inside this number")


def _is_absent(field: Field, value_of: Callable[[str], int]) -> bool:
    return field.when is not None and value_of(field.when[0]) < field.when[1]


def _condition(field: Field) -> str:
    return f"{field.when[0]} >= {field.when[1]}" if field.when else ""


def _check_number(field: Field, number: int, place: str) -> None:
    scalar = SCALARS[str(field.kind)]
    if not scalar.minimum <= number <= scalar.maximum:
        raise WireError(f"{place}: {number} is outside {scalar.minimum} .. {scalar.maximum} ({field.kind})")
    if field.enum is not None and number not in [int(code) for code in field.enum]:
        known = ", ".join(f"{code.value} {code.name}" for code in field.enum)
        raise WireError(f"{place}: {number} is no {field.enum.__name__} (known: {known})")


def _check_count(field: Field, entries: Sized, place: str) -> None:
    count = len(entries)
    if field.repeat == END and count == 0:
        raise WireError(f"{place}: is empty, needs one entry or more")
    if field.repeat == EACH_JOINT:
        if count not in _JOINT_COUNTS:
            raise WireError(f"{place}: has {count} entries; devices have {sorted(_JOINT_COUNTS)} joints")
    elif field.repeat not in (END, count):
        raise WireError(f"{place}: has {count} entries, needs {field.repeat}")
