"""Writes messages.h: the wire's numbers and layouts for the firmware, in C++14 that avr-gcc 5.4 takes.

Only constants and types: nothing in it takes flash or RAM until it is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from planarm_wire.boards import Board
from planarm_wire.generators.text import NOTICE, byte_range, class_name, sentence, wrapped
from planarm_wire.layout import EACH_JOINT, END, SCALARS
from planarm_wire.spec import ENUMS, Code, FieldSpec, MessageSpec, Spec, StructSpec

_HEAD = """\
// The wire's numbers and codes. docs/protocol.md tells the rules around them.
//
// {notice}
#pragma once

#include <stdint.h>

#include "wiring.h"

namespace planarm {{
namespace wire {{
"""

_WIRING_HEAD = """\
{doc}
//
// {notice}
#pragma once

#include <stdint.h>

namespace planarm {{
namespace wire {{

"""

_WIRING_TAIL = """
}  // namespace wire
}  // namespace planarm
"""

_LAYOUT_HEAD = """
// Payloads of a fixed layout, byte by byte as they are on the wire.
static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the wire's numbers are little-endian, as here");
"""

BOARD_LIMITS = ("joints", "queue_bytes", "min_interval_ticks", "min_step_high_ticks", "min_step_low_ticks")

_TAIL = """
static_assert(HOST_WINDOW_BYTES < RX_RING_BYTES, "a full window fits the receive ring");

}  // namespace wire
}  // namespace planarm
"""


def messages_h(spec: Spec) -> str:
    """Return the text of messages.h."""
    lines = [_HEAD.format(notice=NOTICE)]
    lines.extend(_constants(spec))
    codes = ((m.name, m.code, f"From the {m.sender}: {m.doc}") for m in spec.messages)
    lines.extend(_enum("MessageType", "uint8_t", "Type codes of the messages.", codes))
    sections: tuple[tuple[str, str, str, tuple[Code, ...]], ...] = (
        ("states", "uint8_t", "What the device is doing.", spec.states),
        ("faults", "uint8_t", "Why the device stopped its pulses.", spec.faults),
        ("resets", "uint8_t", "Why the device last started.", spec.resets),
        ("pin_maps", "uint8_t", "Where the drivers are wired.", spec.pin_maps),
        ("results", "int8_t", "How a command went: 0 done, above 0 send it again, below 0 refused.", spec.results),
    )
    for section, base, doc, entries in sections:
        lines.extend(_enum(ENUMS[section], base, doc, ((e.name, e.code, e.text) for e in entries)))
    lines.append(_LAYOUT_HEAD.rstrip("\n"))
    structs = {struct.name: struct for struct in spec.structs}
    for struct in spec.structs:
        if struct.min_bytes == struct.max_bytes:
            lines.extend(_struct(struct, structs))
    for message in spec.messages:
        lines.extend(_layout(message, structs))
    return "\n".join(lines) + "\n" + _TAIL


def wiring_h(board: Board) -> Callable[[Spec], str]:
    """Return what makes the text of a board's wiring.h."""

    def text(spec: Spec) -> str:
        (wired,) = (one for one in spec.boards if one.name == board.name)
        code = {entry.name: entry.code for entry in spec.pin_maps}[wired.pin_map]
        docs = {limit.name: limit.doc.removeprefix("of the board uno: ") for limit in spec.limits}
        parts = [
            _WIRING_HEAD.format(
                doc=wrapped(f"The board {wired.name}: {sentence(wired.doc)}", "// ", 100), notice=NOTICE
            )
        ]
        parts.append(_constant("JOINTS", "uint8_t", str(wired.joints), "Joints that segments and ledger tell of."))
        for name in BOARD_LIMITS[1:]:
            value = getattr(wired, name)
            parts.append(_constant(name.upper(), _type(value), str(value), docs[name].split(",")[0]))
        parts.append(_constant("PIN_MAP_CODE", "uint8_t", str(code), f"The pin map {wired.pin_map}."))
        parts.extend(_pins("Step outputs, one a joint, as numbered on the board.", "STEP_PINS", wired.step_pins))
        parts.extend(_pins("Direction outputs; high is the positive direction.", "DIR_PINS", wired.dir_pins))
        parts.extend(_pins("Limit switches, to ground.", "LIMIT_PINS", wired.limit_pins))
        parts.append(_constant("ENABLE_PIN", "uint8_t", str(_pin(wired.enable_pin)), "Active low."))
        parts.append(_constant("STOP_PIN", "uint8_t", str(_pin(wired.stop_pin)), "The stop input, to ground."))
        return "\n".join(parts).replace("\n\n\n", "\n\n") + "\n" + _WIRING_TAIL

    return text


def _constants(spec: Spec) -> Iterator[str]:
    framing = spec.framing
    yield _constant("PROTOCOL_VERSION", "uint8_t", str(spec.version), "Both ends must have the same.")
    yield _constant("SPEC_HASH", "uint32_t", f"0x{spec.spec_hash:08X}", "Of the specification without its wording.")
    yield ""
    yield _constant("DELIMITER", "uint8_t", f"0x{framing.delimiter:02X}", "Ends every frame.")
    yield _constant("ESCAPE", "uint8_t", f"0x{framing.escape:02X}", "Announces an escaped byte.")
    yield _constant("ESCAPE_XOR", "uint8_t", f"0x{framing.escape_xor:02X}", "An escaped byte is its code xor this.")
    reserved = ", ".join(f"0x{code:02X}" for code in framing.reserved)
    yield "// Never inside a frame; receivers drop them."
    yield f"constexpr uint8_t RESERVED[{len(framing.reserved)}] = {{{reserved}}};"
    for code in spec.out_of_band.codes:
        yield _constant(f"{code.name.upper()}_CODE", "uint8_t", f"0x{code.code:02X}", f"Out of band: {code.doc}")
        yield _constant(f"{code.name.upper()}_REPEATS", "uint8_t", str(code.repeats), "In a row.")
    yield _constant("CRC_INITIAL", "uint16_t", f"0x{framing.crc_initial:04X}", framing.crc)
    yield _constant("HEADER_BYTES", "uint8_t", str(framing.header_bytes), "Length, seq and type.")
    yield _constant("CRC_BYTES", "uint8_t", str(framing.crc_bytes), "Of each of the two checks.")
    yield _constant("MAX_PAYLOAD_BYTES", "uint8_t", str(framing.max_payload_bytes), "Before stuffing.")
    yield _constant(
        "MAX_FRAME_BYTES", "uint8_t", str(framing.max_frame_bytes), "On the line, all stuffed, with delimiter."
    )
    yield ""
    for limit in spec.limits:
        if limit.name in BOARD_LIMITS:
            continue
        yield _constant(limit.name.upper(), _type(limit.value), str(limit.value), limit.doc)


def _type(value: int) -> str:
    """Return the narrowest unsigned type, so that arithmetic with it stays narrow on an 8-bit core."""
    return "uint8_t" if value <= 0xFF else "uint16_t" if value <= 0xFFFF else "uint32_t"


def _constant(name: str, kind: str, value: str, doc: str) -> str:
    suffix = {"uint32_t": "UL", "uint16_t": "U"}.get(kind, "")
    return f"{wrapped(sentence(doc), '// ', 100)}\nconstexpr {kind} {name} = {value}{suffix};"


def _pins(doc: str, name: str, pins: Iterable[str]) -> Iterator[str]:
    numbers = ", ".join(str(_pin(pin)) for pin in pins)
    yield f"// {doc}"
    yield f"constexpr uint8_t {name}[JOINTS] = {{{numbers}}};"


def _pin(pin: str) -> int:
    """Return the board's number of a pin: D9 is 9, A0 is 14 (Arduino Uno)."""
    return int(pin[1:]) + (14 if pin[0] == "A" else 0)


def _enum(name: str, base: str, doc: str, members: Iterable[tuple[str, int, str]]) -> Iterator[str]:
    yield f"\n// {doc}\nenum class {name} : {base} {{"
    for member, code, text in members:
        yield wrapped(sentence(text), "    // ", 100)
        number = str(code) if code < 10 else f"0x{code:X}"
        yield f"    {member.upper()} = {number},"
    yield "};"


def _layout(message: MessageSpec, structs: Mapping[str, StructSpec]) -> Iterator[str]:
    """Yield the payload as a struct; when its layout is not fixed, its least size only."""
    if message.min_bytes == message.max_bytes:
        yield from _struct(message, structs)
        return
    yield f"\n// {class_name(message.name)}: payload of {byte_range(message.min_bytes, message.max_bytes)}."
    yield f"constexpr uint8_t {message.name.upper()}_MIN_BYTES = {_size_of(message, structs, least=True)};"


def _struct(item: MessageSpec | StructSpec, structs: Mapping[str, StructSpec]) -> Iterator[str]:
    """Yield a struct that lies in memory as on the wire, and the bytes it takes there."""
    name = class_name(item.name)
    size = _size_of(item, structs)
    told = byte_range(item.min_bytes, item.max_bytes)
    yield f"\n// {name}: {told}{' with two joints' if size.a_joint else ''}."
    yield f"constexpr uint8_t {item.name.upper()}_BYTES = {size};"
    if not item.fields:
        return
    yield f"struct [[gnu::packed, gnu::may_alias]] {name} {{"
    for field in item.fields:
        yield f"    {_c_type(field)} {field.name}{_c_count(field)};"
    yield "};"
    yield f'static_assert(sizeof({name}) == {item.name.upper()}_BYTES, "as on the wire");'


def _c_type(field: FieldSpec) -> str:
    if field.enum is not None:
        return ENUMS[field.enum]
    return SCALARS[field.kind].c_type if field.kind in SCALARS else class_name(field.kind)


def _c_count(field: FieldSpec) -> str:
    if field.count is None:
        return ""
    return "[JOINTS]" if field.count == EACH_JOINT else f"[{field.count}]"


@dataclass(frozen=True, slots=True)
class Bytes:
    """A number of bytes that depends on the board's joints."""

    fixed: int = 0
    a_joint: int = 0

    def __add__(self, more: Bytes) -> Bytes:
        return Bytes(self.fixed + more.fixed, self.a_joint + more.a_joint)

    def repeated(self, field: FieldSpec) -> Bytes:
        """Return these bytes as often as the field stands there."""
        if field.count == EACH_JOINT:
            return Bytes(0, self.fixed)
        times = 1 if field.count is None or field.count == END else field.count
        return Bytes(times * self.fixed, times * self.a_joint)

    def __str__(self) -> str:
        if not self.a_joint:
            return str(self.fixed)
        return f"{self.fixed} + {self.a_joint} * JOINTS" if self.fixed else f"{self.a_joint} * JOINTS"


def _field_size(field: FieldSpec, structs: Mapping[str, StructSpec], least: bool) -> Bytes:
    if field.kind in SCALARS:
        scalar = SCALARS[field.kind]
        one = Bytes(scalar.min_bytes if least else scalar.max_bytes)
    else:
        one = _size_of(structs[field.kind], structs, least=least)
    return Bytes() if least and field.when else one.repeated(field)


def _size_of(item: MessageSpec | StructSpec, structs: Mapping[str, StructSpec], *, least: bool = False) -> Bytes:
    total = Bytes()
    for field in item.fields:
        total += _field_size(field, structs, least)
    return total
