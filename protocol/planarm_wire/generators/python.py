"""Writes messages.py: constants, enumerations with their words, and one frozen dataclass for each message."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planarm_wire.boards import Board
from planarm_wire.generators.text import NOTICE, byte_range, class_name, presence, sentence, wrapped
from planarm_wire.layout import EACH_JOINT, END, SCALARS
from planarm_wire.spec import ENUMS, Code, FieldSpec, MessageSpec, Spec, StructSpec

_HEAD = '''"""The wire's numbers, words and messages.

{notice}
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, Final, NamedTuple, TypeAlias

from planarm_wire.boards import Board
from planarm_wire.layout import EACH_JOINT, END, Field

'''

_WORDS = '''

class Words(NamedTuple):
    """What to tell the user about a code."""

    text: str
    """What happened."""
    fix: str
    """What to do about it; empty when there is nothing to do."""

'''


def messages_py(spec: Spec) -> str:
    """Return the text of messages.py."""
    parts = [_HEAD.format(notice=NOTICE), *_constants(spec)]
    parts.append(_enum("MessageType", "Type codes of the messages.", _type_codes(spec)))
    sections: dict[str, tuple[str, tuple[Code, ...]]] = {
        "states": ("What the device is doing.", spec.states),
        "faults": ("Why the device stopped its pulses.", spec.faults),
        "resets": ("Why the device last started.", spec.resets),
        "pin_maps": ("Where the drivers are wired.", spec.pin_maps),
        "results": ("How a command went: 0 done, above 0 send it again, below 0 refused.", spec.results),
    }
    for section, (doc, codes) in sections.items():
        parts.append(_enum(ENUMS[section], doc, ((c.name, c.code, c.text) for c in codes)))
    parts.append(_WORDS)
    for section in ("faults", "results"):
        parts.append(_words(ENUMS[section], sections[section][1]))
    parts.extend(_dataclass(struct) for struct in spec.structs)
    parts.extend(_dataclass(message) for message in spec.messages)
    parts.append(_tables(spec))
    return "".join(parts)


def _type_codes(spec: Spec) -> Iterator[tuple[str, int, str]]:
    for message in spec.messages:
        yield message.name, message.code, f"From the {message.sender}. {sentence(message.doc)}"


def _constants(spec: Spec) -> Iterator[str]:
    framing, board = spec.framing, spec.boards[0]
    yield _constant("PROTOCOL_VERSION", str(spec.version), "Both ends must have the same.")
    yield _constant("SPEC_HASH", f"0x{spec.spec_hash:08X}", "Hash of the specification without its wording.")
    yield _constant("DELIMITER", f"0x{framing.delimiter:02X}", "Ends every frame.")
    yield _constant("ESCAPE", f"0x{framing.escape:02X}", "Announces an escaped byte.")
    yield _constant("ESCAPE_XOR", f"0x{framing.escape_xor:02X}", "An escaped byte is its code xor this.")
    reserved = ", ".join(f"0x{code:02X}" for code in framing.reserved)
    yield _constant("RESERVED", f"({reserved})", "Never inside a frame; receivers drop them.")
    for code in spec.out_of_band.codes:
        doc = f"Out of band, {code.repeats} in a row: {code.doc}"
        yield _constant(f"{code.name.upper()}_CODE", f"0x{code.code:02X}", doc)
        yield _constant(f"{code.name.upper()}_REPEATS", str(code.repeats), "How often in a row the code must come.")
    yield _constant("CRC_INITIAL", f"0x{framing.crc_initial:04X}", framing.crc)
    yield _constant("HEADER_BYTES", str(framing.header_bytes), "Length, seq and type.")
    yield _constant("CRC_BYTES", str(framing.crc_bytes), "Of each of the two checks.")
    yield _constant("MAX_PAYLOAD_BYTES", str(framing.max_payload_bytes), "Before stuffing.")
    for limit in spec.limits:
        yield _constant(limit.name.upper(), f"{limit.value:_}", limit.doc)
    yield _constant(
        "STEP_PINS", _strings(board.step_pins), f"Of {board.name}, one a joint; the step is the rising edge."
    )
    yield _constant("DIR_PINS", _strings(board.dir_pins), f"Of {board.name}, one a joint; high is positive.")
    yield _constant("ENABLE_PIN", f'"{board.enable_pin}"', "Active low.")
    rows = "".join(_board(board) for board in spec.boards)
    yield f'BOARDS: Final[dict[str, Board]] = {{\n{rows}}}\n"""By name; each has a flash image."""\n'


def _board(board: Board) -> str:
    rows = "".join(f"        {name}={_literal(getattr(board, name))},\n" for name in Board.__slots__)
    return f'    "{board.name}": Board(\n{rows}    ),\n'


def _literal(value: object) -> str:
    if isinstance(value, tuple):
        return _strings(value)
    return f"{value:_}" if isinstance(value, int) else f'"{value}"'


def _strings(items: Iterable[str]) -> str:
    return "(" + ", ".join(f'"{item}"' for item in items) + ")"


def _constant(name: str, value: str, doc: str) -> str:
    return f"{name}: Final = {value}\n{_docstring(sentence(doc), '')}"


def _docstring(text: str, indent: str, more: str = "") -> str:
    """Return a docstring: one line if it fits and there is no more, else its first sentence and then the rest."""
    line = f'{indent}"""{text}"""\n'
    if len(line) <= 120 and not more:
        return line
    first, _, rest = text.partition(". ")
    paragraphs = [f'{indent}"""{first.rstrip(".")}.', *(wrapped(part, indent) for part in (rest, more) if part)]
    return "\n\n".join(paragraphs) + f'\n{indent}"""\n'


def _enum(name: str, doc: str, members: Iterable[tuple[str, int, str]]) -> str:
    body = "".join(
        f"    {member.upper()} = {_code(code)}\n" + _docstring(sentence(text), "    ") for member, code, text in members
    )
    return f'\n\nclass {name}(IntEnum):\n    """{doc}"""\n\n{body}'


def _code(code: int) -> str:
    return str(code) if code < 10 else f"0x{code:X}"


def _words(enum: str, codes: Iterable[Code]) -> str:
    name = f"{enum.upper()}_WORDS"
    rows = "".join(_word_row(enum, code) for code in codes)
    return f'\n{name}: Final[dict[{enum}, Words]] = {{\n{rows}}}\n"""The words of each {enum.lower()}."""\n'


def _word_row(enum: str, code: Code) -> str:
    row = f'    {enum}.{code.name.upper()}: Words("{code.text}", "{code.fix}"),\n'
    if len(row) <= 121:
        return row
    return f'    {enum}.{code.name.upper()}: Words(\n        "{code.text}",\n        "{code.fix}",\n    ),\n'


def _dataclass(item: StructSpec | MessageSpec) -> str:
    where = f"From the {item.sender}, payload" if isinstance(item, MessageSpec) else "On the wire"
    doc = _docstring(sentence(item.doc), "    ", f"{where} {byte_range(item.min_bytes, item.max_bytes)}.")
    lines = [f"\n\n@dataclass(frozen=True, slots=True)\nclass {class_name(item.name)}:\n{doc}"]
    if isinstance(item, MessageSpec):
        lines.append(f"\n    TYPE: ClassVar[MessageType] = MessageType.{item.name.upper()}\n")
    if item.fields:
        lines.append("\n")
    for field in item.fields:
        default = " = 0" if field.when else ""
        lines.append(f"    {field.name}: {_annotation(field)}{default}\n")
        notes = [field.unit if field.unit not in ("", "1") else "", field.kind, presence(field)]
        if field.count is not None and field.count != END:
            notes[1] = f"{'joints' if field.count == EACH_JOINT else field.count} x {field.kind}"
        lines.append(_docstring(f"{sentence(field.doc)} ({', '.join(filter(None, notes))})", "    "))
    return "".join(lines)


def _annotation(field: FieldSpec) -> str:
    number = "int" if field.enum is None else ENUMS[field.enum]
    item = number if field.kind in SCALARS else class_name(field.kind)
    if field.count is None:
        return item
    if field.repeat.isdigit():
        return f"tuple[{', '.join([item] * field.count)}]"
    return f"tuple[{item}, ...]"


def _tables(spec: Spec) -> str:
    groups = {
        "HostMessage": [m.name for m in spec.messages if m.sender == "host"],
        "DeviceMessage": [m.name for m in spec.messages if m.sender == "device"],
        "Struct": [s.name for s in spec.structs],
    }
    parts = ["\n"]
    for alias, names in groups.items():
        parts.append(_alias(alias, [class_name(name) for name in names]))
    parts.append("\nMessage: TypeAlias = HostMessage | DeviceMessage\n")
    rows = "".join(f"    {class_name(m.name)}.TYPE: {class_name(m.name)},\n" for m in spec.messages)
    parts.append(f'\nMESSAGES: Final[dict[int, type[Message]]] = {{\n{rows}}}\n"""The class for each type code."""\n')
    items: tuple[StructSpec | MessageSpec, ...] = (*spec.structs, *spec.messages)
    rows = "".join(_layout(item) for item in items)
    parts.append(f"\nLAYOUTS: Final[dict[type[Message | Struct], tuple[Field, ...]]] = {{\n{rows}}}\n")
    parts.append('"""The fields of each message and struct, in the order of the wire."""\n')
    return "".join(parts)


def _alias(alias: str, names: list[str]) -> str:
    line = f"\n{alias}: TypeAlias = {' | '.join(names)}"
    if len(line) <= 121:
        return line
    return f"\n{alias}: TypeAlias = (\n    " + "\n    | ".join(names) + "\n)"


def _layout(item: StructSpec | MessageSpec) -> str:
    if len(item.fields) < 2:
        return f"    {class_name(item.name)}: ({''.join(f'{_field(field)},' for field in item.fields)}),\n"
    rows = "".join(f"        {_field(field)},\n" for field in item.fields)
    return f"    {class_name(item.name)}: (\n{rows}    ),\n"


def _field(field: FieldSpec) -> str:
    kind = f'"{field.kind}"' if field.kind in SCALARS else class_name(field.kind)
    parts = [f'"{field.name}"', kind]
    if field.count is not None:
        words = {END: "END", EACH_JOINT: "EACH_JOINT"}
        parts.append(f"repeat={words.get(field.count, field.count)}")
    if field.when is not None:
        parts.append(f'when=("{field.when[0]}", {field.when[1]})')
    if field.enum is not None:
        parts.append(f"enum={ENUMS[field.enum]}")
    return f"Field({', '.join(parts)})"
