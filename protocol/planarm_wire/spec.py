"""Reads `messages.toml` into frozen values, strictly: whatever is not understood is an error that names its place."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from planarm_wire.boards import Board
from planarm_wire.errors import SpecError
from planarm_wire.layout import EACH_JOINT, END, SCALARS
from planarm_wire.spec_checks import check_different, check_keys, check_range, checked_name, suggestion, table_of

SPEC_PATH: Final = Path(__file__).parents[1] / "messages.toml"
ENUMS: Final = {"states": "State", "faults": "Fault", "resets": "Reset", "pin_maps": "PinMap", "results": "Result"}
"""Sections of codes, and the name of the enumeration made of each."""

_WORDS: Final = frozenset(("doc", "text", "fix"))
_PIN: Final = re.compile(r"[DA]\d{1,2}")
_WHEN: Final = re.compile(r"([a-z][a-z0-9_]*) >= (\d+)")


MOST_JOINTS: Final = 4
"""The Uno has pins and timers for so many."""


@dataclass(frozen=True, slots=True)
class Limit:
    """A number that both ends keep to, with its unit in its name."""

    name: str
    value: int
    doc: str


@dataclass(frozen=True, slots=True)
class Code:
    """A state, fault or result: its number, its words, and what the user can do about it."""

    name: str
    code: int
    text: str
    fix: str


@dataclass(frozen=True, slots=True)
class FieldSpec:
    """A field as written: `kind` names a scalar or a struct, `count` is its repeat as a number.

    END stands for the rest of the payload, EACH_JOINT for the device's joints.
    """

    name: str
    kind: str
    unit: str
    doc: str
    repeat: str
    count: int | None
    when: tuple[str, int] | None
    enum: str | None


@dataclass(frozen=True, slots=True)
class StructSpec:
    """A group of fields that messages and other structs use; sizes are payload bytes, least and most."""

    name: str
    doc: str
    fields: tuple[FieldSpec, ...]
    min_bytes: int
    max_bytes: int


@dataclass(frozen=True, slots=True)
class MessageSpec:
    """A message; `max_bytes` is the payload limit when the last field goes on to the end."""

    name: str
    code: int
    sender: Literal["host", "device"]
    doc: str
    fields: tuple[FieldSpec, ...]
    min_bytes: int
    max_bytes: int


@dataclass(frozen=True, slots=True)
class Framing:
    """Section framing."""

    doc: str
    delimiter: int
    escape: int
    escape_xor: int
    reserved: tuple[int, ...]
    crc: str
    crc_initial: int
    header_bytes: int
    crc_bytes: int
    max_payload_bytes: int

    @property
    def plain_frame_bytes(self) -> int:
        """The longest frame on the line when no byte needs an escape."""
        return self.header_bytes + self.crc_bytes + self.max_payload_bytes + self.crc_bytes + 1

    @property
    def max_frame_bytes(self) -> int:
        """The longest frame on the line: every byte stuffed, and the delimiter."""
        return 2 * (self.header_bytes + self.crc_bytes + self.max_payload_bytes + self.crc_bytes) + 1


@dataclass(frozen=True, slots=True)
class OutOfBandCode:
    """A byte outside of frames: its code, how often in a row it must come, and what it does."""

    name: str
    code: int
    repeats: int
    doc: str


@dataclass(frozen=True, slots=True)
class OutOfBand:
    """Section out_of_band."""

    doc: str
    codes: tuple[OutOfBandCode, ...]


@dataclass(frozen=True, slots=True)
class Spec:
    """The whole protocol."""

    name: str
    version: int
    doc: str
    spec_hash: int
    framing: Framing
    out_of_band: OutOfBand
    sequence_doc: str
    limits: tuple[Limit, ...]
    boards: tuple[Board, ...]
    states: tuple[Code, ...]
    faults: tuple[Code, ...]
    resets: tuple[Code, ...]
    pin_maps: tuple[Code, ...]
    results: tuple[Code, ...]
    structs: tuple[StructSpec, ...]
    messages: tuple[MessageSpec, ...]

    def limit(self, name: str) -> int:
        """Return the value of the limit `name`; KeyError when there is none."""
        return {limit.name: limit.value for limit in self.limits}[name]


def load_spec(path: Path = SPEC_PATH) -> Spec:
    """Read the specification; SpecError when it is missing or wrong."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SpecError(
            f"{path} is not here: the specification belongs to the source tree and is not installed with the "
            "package; run the generator in a checkout of the repository"
        ) from None
    return parse_spec(text, path.name)


def parse_spec(text: str, source: str = "messages.toml") -> Spec:
    """Turn the specification's text into a Spec; SpecError names the place in `source` and what is wrong there."""
    try:
        data = tomllib.loads(text)
        return _spec(data)
    except (tomllib.TOMLDecodeError, SpecError) as problem:
        raise SpecError(f"{source}: {problem}") from None


def spec_hash(data: Mapping[str, Any]) -> int:
    """Return the first four bytes, as a little-endian u32, of the SHA-256 of the specification's canonical JSON.

    Canonical: keys sorted, no spaces, ASCII. Strings under the keys doc, text and fix are left out, so that a better
    wording does not part a host from its firmware.
    """
    canonical = json.dumps(_without_words(data), sort_keys=True, separators=(",", ":"))
    return int.from_bytes(hashlib.sha256(canonical.encode()).digest()[:4], "little")


def _without_words(value: object) -> object:
    if isinstance(value, dict):
        return {k: _without_words(v) for k, v in value.items() if not (k in _WORDS and isinstance(v, str))}
    if isinstance(value, list):
        return [_without_words(item) for item in value]
    return value


def _spec(data: dict[str, Any]) -> Spec:
    sections = ("protocol", "framing", "out_of_band", "sequence", "limits", "boards", *ENUMS, "structs", "messages")
    check_keys(data, "top level", sections)
    protocol = table_of(data["protocol"], "protocol", {"name": str, "version": int, "doc": str})
    check_range(protocol["version"], 1, 0xFF, "protocol.version")
    framing = _framing(data["framing"])
    limits = _limits(data["limits"])
    values = {limit.name: limit.value for limit in limits}
    for needed in ("joints", "queue_bytes", "min_interval_ticks", "host_window_bytes"):
        if needed not in values:
            raise SpecError(f"limits: {needed} is missing")
    if framing.plain_frame_bytes > values["host_window_bytes"]:
        raise SpecError(
            f"limits.host_window_bytes: {values['host_window_bytes']} is less than the longest frame without escapes, "
            f"{framing.plain_frame_bytes} bytes; raise it, or lower framing.max_payload_bytes"
        )
    structs = _structs(data["structs"], values)
    return Spec(
        name=protocol["name"],
        version=protocol["version"],
        doc=protocol["doc"],
        spec_hash=spec_hash(data),
        framing=framing,
        out_of_band=_out_of_band(data["out_of_band"], framing.reserved),
        sequence_doc=table_of(data["sequence"], "sequence", {"doc": str})["doc"],
        limits=limits,
        boards=_boards(data["boards"], values, tuple(data["pin_maps"])),
        states=_codes(data["states"], "states", {"code": int, "doc": str}, 0, 0xFF),
        faults=_codes(data["faults"], "faults", {"code": int, "text": str, "fix": str}, 0, 0xFF),
        resets=_codes(data["resets"], "resets", {"code": int, "doc": str}, 0, 0xFF),
        pin_maps=_codes(data["pin_maps"], "pin_maps", {"code": int, "doc": str}, 0, 0xFF),
        results=_codes(data["results"], "results", {"code": int, "text": str, "fix": str}, -0x80, 0x7F),
        structs=tuple(structs.values()),
        messages=_messages(data["messages"], values, structs, framing.max_payload_bytes),
    )


def _framing(value: object) -> Framing:
    number_keys = ("delimiter", "escape", "escape_xor", "header_bytes", "crc_bytes", "max_payload_bytes")
    needed: dict[str, type] = {
        "doc": str,
        "crc": str,
        "crc_initial": int,
        "reserved": list,
        **dict.fromkeys(number_keys, int),
    }
    table = table_of(value, "framing", needed)
    for key in number_keys:
        check_range(table[key], 1, 0xFF, f"framing.{key}")
    check_range(table["crc_initial"], 0, 0xFFFF, "framing.crc_initial")
    reserved = tuple(table["reserved"])
    for code in reserved:
        check_range(code, 0, 0xFF, "framing.reserved")
    special = (table["delimiter"], table["escape"], *reserved)
    check_different(special, "framing: delimiter, escape and reserved")
    clash = {code ^ table["escape_xor"] for code in special} & set(special)
    if clash:
        raise SpecError(f"framing.escape_xor: an escaped byte would again be special: {sorted(map(hex, clash))}")
    return Framing(**{**table, "reserved": reserved})


def _out_of_band(value: object, reserved: tuple[int, ...]) -> OutOfBand:
    if not isinstance(value, dict):
        raise SpecError("out_of_band: not a table")
    doc = table_of({"doc": value.get("doc")}, "out_of_band", {"doc": str})["doc"]
    found = []
    for name, entry in value.items():
        if name == "doc":
            continue
        place = f"out_of_band.{checked_name(name, 'out_of_band')}"
        table = table_of(entry, place, {"code": int, "repeats": int, "doc": str})
        check_range(table["repeats"], 1, 8, f"{place}.repeats")
        found.append(OutOfBandCode(name, table["code"], table["repeats"], table["doc"]))
    if tuple(code.code for code in found) != reserved:
        raise SpecError(f"out_of_band: the codes must be those of framing.reserved, in order: {reserved}")
    return OutOfBand(doc, tuple(found))


def _limits(value: object) -> tuple[Limit, ...]:
    if not isinstance(value, dict) or not value:
        raise SpecError("limits: not a table with at least one limit")
    found = []
    for name, entry in value.items():
        table = table_of(entry, f"limits.{checked_name(name, 'limits')}", {"value": int, "doc": str})
        check_range(table["value"], 1, 0xFFFFFFFF, f"limits.{name}.value")
        found.append(Limit(name, table["value"], table["doc"]))
    return tuple(found)


def _boards(value: object, limits: Mapping[str, int], pin_maps: tuple[str, ...]) -> tuple[Board, ...]:
    if not isinstance(value, dict) or not value:
        raise SpecError("boards: not a table with at least one board")
    numbers = ("joints", "queue_bytes", "min_interval_ticks", "min_step_high_ticks", "min_step_low_ticks")
    lists = ("step_pins", "dir_pins", "limit_pins")
    words = ("doc", "pin_map", "enable_pin", "stop_pin")
    needed = {**dict.fromkeys(numbers, int), **dict.fromkeys(lists, list), **dict.fromkeys(words, str)}
    found = []
    for name, entry in value.items():
        place = f"boards.{checked_name(name, 'boards')}"
        table = table_of(entry, place, needed)
        check_range(table["joints"], 1, MOST_JOINTS, f"{place}.joints")
        if table["pin_map"] not in pin_maps:
            raise SpecError(f"{place}.pin_map: {table['pin_map']!r} is none of {', '.join(pin_maps)}")
        for key in lists:
            if len(table[key]) != table["joints"]:
                raise SpecError(f"{place}.{key}: {len(table[key])} pins for {table['joints']} joints")
        pins = [pin for key in lists for pin in table[key]] + [table["enable_pin"], table["stop_pin"]]
        for pin in pins:
            if not isinstance(pin, str) or not _PIN.fullmatch(pin):
                raise SpecError(f"{place}: {pin!r} is not a pin's name as printed on the board, such as D9")
        check_different(pins, f"{place}: pins")
        found.append(Board(name=name, **{**table, **{key: tuple(table[key]) for key in lists}}))
    for key in numbers:
        if getattr(found[0], key) != limits[key]:
            raise SpecError(f"limits.{key}: {limits[key]}, but boards.{found[0].name} has {getattr(found[0], key)}")
    return tuple(found)


def _codes(value: object, place: str, needed: dict[str, type], low: int, high: int) -> tuple[Code, ...]:
    if not isinstance(value, dict) or not value:
        raise SpecError(f"{place}: not a table with at least one entry")
    found = []
    for name, entry in value.items():
        here = f"{place}.{checked_name(name, place)}"
        table = table_of(
            entry, here, needed, may_be_empty=("fix",) if isinstance(entry, dict) and entry.get("code") == 0 else ()
        )
        check_range(table["code"], low, high, f"{here}.code")
        found.append(Code(name, table["code"], table.get("text", table.get("doc", "")), table.get("fix", "")))
    check_different([code.code for code in found], f"{place}: codes")
    return tuple(found)


def _structs(value: object, limits: Mapping[str, int]) -> dict[str, StructSpec]:
    if not isinstance(value, dict):
        raise SpecError("structs: not a table")
    known: dict[str, StructSpec] = {}
    for name, entry in value.items():
        place = f"structs.{checked_name(name, 'structs')}"
        table = table_of(entry, place, {"doc": str, "fields": list})
        fields = tuple(_fields(table["fields"], place, limits, known))
        if not fields or any(field.count == END for field in fields):
            raise SpecError(f"{place}.fields: a struct needs fields, and none of them may repeat to the end")
        known[name] = StructSpec(name, table["doc"], fields, *_size(fields, known, limits["joints"]))
    return known


def _messages(
    value: object, limits: Mapping[str, int], structs: Mapping[str, StructSpec], max_payload: int
) -> tuple[MessageSpec, ...]:
    if not isinstance(value, dict) or not value:
        raise SpecError("messages: not a table with at least one message")
    found = []
    for name, entry in value.items():
        place = f"messages.{checked_name(name, 'messages')}"
        table = table_of(entry, place, {"code": int, "from": str, "doc": str, "fields": list})
        sender = table["from"]
        if sender not in ("host", "device"):
            raise SpecError(f"{place}.from: {sender!r} is neither host nor device")
        check_range(table["code"], *((0, 0x7F) if sender == "host" else (0x80, 0xFF)), f"{place}.code")
        fields = tuple(_fields(table["fields"], place, limits, structs))
        least, most = _size(fields, structs, limits["joints"])
        if fields and fields[-1].count != END and _size(fields, structs, MOST_JOINTS)[1] > max_payload:
            raise SpecError(
                f"{place}: more bytes with {MOST_JOINTS} joints than framing.max_payload_bytes = {max_payload}"
            )
        if fields and fields[-1].count == END:
            most = max_payload
        found.append(MessageSpec(name, table["code"], sender, table["doc"], fields, least, most))
    check_different([message.code for message in found], "messages: codes")
    return tuple(found)


def _fields(
    entries: list[object], place: str, limits: Mapping[str, int], structs: Mapping[str, StructSpec]
) -> Iterable[FieldSpec]:
    before: dict[str, FieldSpec] = {}
    for index, entry in enumerate(entries):
        here = f"{place}.fields[{index}]"
        needed = {"name": str, "type": str, "doc": str}
        table = table_of(entry, here, needed, {"unit": str, "repeat": object, "when": str, "enum": str})
        name, kind = checked_name(table["name"], here), table["type"]
        here = f"{place}.{name}"
        if name in before:
            raise SpecError(f"{here}: there are two fields of this name")
        if kind not in SCALARS and kind not in structs:
            raise SpecError(f"{here}.type: {kind!r} is unknown{suggestion(kind, (*SCALARS, *structs))}")
        if (kind in SCALARS) != ("unit" in table):
            raise SpecError(f'{here}.unit: a number needs one ("1" for a bare number), a struct has none')
        count = _count(table.get("repeat"), here, limits)
        if count == END and index + 1 < len(entries):
            raise SpecError(f"{here}.repeat: only the last field of a message may go on to the end")
        enum = table.get("enum")
        if enum is not None and (enum not in ENUMS or kind not in ("u8", "i8")):
            raise SpecError(f"{here}.enum: {enum!r} is none of {', '.join(ENUMS)}, or the type is no byte")
        when = _condition(table.get("when"), here, before)
        if when is not None and (kind not in SCALARS or count is not None):
            raise SpecError(f"{here}.when: only a plain number may be absent")
        field = FieldSpec(
            name, kind, table.get("unit", ""), table["doc"], str(table.get("repeat", "")), count, when, enum
        )
        before[name] = field
        yield field


def _count(repeat: object, place: str, limits: Mapping[str, int]) -> int | None:
    """Return a repeat as a number: a count, the name of a limit, "joints", or "end"."""
    if repeat is None:
        return None
    if repeat in ("end", "joints"):
        return END if repeat == "end" else EACH_JOINT
    if isinstance(repeat, int) and not isinstance(repeat, bool):
        check_range(repeat, 1, 0xFF, f"{place}.repeat")
        return repeat
    if isinstance(repeat, str) and repeat in limits:
        return limits[repeat]
    raise SpecError(f'{place}.repeat: {repeat!r} is no count, no limit\'s name and not "end"')


def _condition(when: str | None, place: str, before: Mapping[str, FieldSpec]) -> tuple[str, int] | None:
    if when is None:
        return None
    match = _WHEN.fullmatch(when)
    if match is None:
        raise SpecError(f"{place}.when: {when!r} is not of the form 'field >= number'")
    ruling = before.get(match[1])
    if ruling is None or ruling.kind not in SCALARS or ruling.count is not None or ruling.when is not None:
        raise SpecError(f"{place}.when: {match[1]!r} is no plain number that always stands before it")
    return match[1], int(match[2])


def _size(fields: Iterable[FieldSpec], structs: Mapping[str, StructSpec], joints: int) -> tuple[int, int]:
    """Return the least and the most bytes of `fields`; a field that repeats to the end counts once."""
    least = most = 0
    for field in fields:
        if field.kind in SCALARS:
            scalar = SCALARS[field.kind]
            sizes = scalar.min_bytes, scalar.max_bytes
        else:
            sizes = _size(structs[field.kind].fields, structs, joints)
        count = 1 if field.count is None or field.count == END else joints if field.count == EACH_JOINT else field.count
        least += 0 if field.when else sizes[0] * count
        most += sizes[1] * count
    return least, most
