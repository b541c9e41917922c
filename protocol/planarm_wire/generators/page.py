"""Writes docs/protocol.md: the page from which somebody can implement either end."""

from __future__ import annotations

from collections.abc import Iterable

from planarm_wire.boards import Board
from planarm_wire.generators.text import NOTICE, byte_range, count_words, presence, sentence
from planarm_wire.layout import SCALARS
from planarm_wire.spec import Code, FieldSpec, Framing, MessageSpec, Spec, StructSpec

_FRAMING = """\
```
length  seq  type  |  crc lo  crc hi  |  payload ...   |  crc lo  crc hi  |  0x{delimiter:02X}
{header_bytes} header bytes     |  of the header   |  length bytes  |  of the payload  |  delimiter
```

{doc}

- **length** counts the payload's bytes before stuffing, 0 to {max_payload}. With length 0 there is neither payload
  nor payload CRC.
- **CRC**: {crc}.
  Its value over the ASCII digits `123456789` is 0x6F91. The header's CRC covers length, seq and type. The payload's
  CRC covers the payload and continues from the header's CRC value in place of the initial value.
- **Stuffing**, after the CRCs are made: each of {special} becomes
  0x{escape:02X} followed by the byte xor 0x{escape_xor:02X}.
- A frame on the line has at most {max_frame} bytes, delimiter included.

A receiver collects bytes up to a delimiter, drops {reserved} wherever they come, undoes the stuffing, and then
checks in this order. The first check that fails gives the verdict; the bytes are then forgotten, and the next frame
starts after the delimiter.

| # | check | verdict |
| --- | --- | --- |
| 1 | every 0x{escape:02X} is followed by the xored form of one of {special} | bad_escape |
| 2 | at most {most} bytes after unstuffing | too_long |
| 3 | at least {head} bytes | truncated |
| 4 | the header's CRC | header_crc |
| 5 | length is at most {max_payload}, and no more bytes came than it announces | too_long |
| 6 | no fewer bytes came than it announces | truncated |
| 7 | the payload's CRC, when length is not 0 | payload_crc |

No bytes at all between two delimiters is silence, not an error. The header has a CRC of its own because with one
CRC-16 over everything a damaged length picks which bytes are checked."""

_TYPES = """\
All numbers are little-endian.

{table}

- **LEB128**: seven bits a byte, the least significant first; bit 7 is set on every byte but the last. The shortest
  form is the only one: several bytes of which the last is 0x00, a sixth byte, or a value over 32 bits is malformed.
- **Zigzag** maps an i32 v to the u32 (v << 1) xor (v >> 31), the second shift arithmetic: 0, -1, 1, -2 become
  0, 1, 2, 3.
- A payload must end with its last field: bytes left over are malformed, and so are bytes missing.
- A field whose condition does not hold is left out, and counts as 0."""

_STEPS = """\
For a `move` with N = `steps_dir` >> 1 steps, I = `interval_q8` and A = `add`, step n rises

    T_n = first_ticks + floor((256 n I + n (n - 1) / 2 A) / 2^16)        n = 0 .. N - 1

ticks after the start of its segment, computed in exact integers (64 bits are enough; floor rounds towards minus
infinity). So the interval from step n to step n + 1 is 256 I + n A, in 2^-16 ticks. A is `add` where
N > {max_coarse_steps}, else 256 x `add`. A move with I >= {slow_interval_ticks} x 2^8 is slow; in any other A is a
signed number of 32 bits: 256 x `add` is taken modulo 2^32. The first segment of a motion starts `lead_ticks` after
START is carried out, and every other one where the segment before it ends: B_(k+1) = B_k + duration.

A segment is good when all of this holds for each joint; anything else latches `bad_segment`:

- 1 <= duration <= {max_segment_ticks}, N <= {max_segment_steps}, and T_n < duration for every n;
- {min_interval_ticks} x 2^16 <= 256 I + n A < 2^32 for n = 0 .. N - 2; in a slow move
  {min_slow_interval_ticks} x 2^16 <= 256 I + n A < 2^40, and N <= {max_coarse_steps};
- its first step comes at least {min_interval_ticks} ticks after the joint's last step in the segments before, and at
  least {min_reversal_ticks} after it where the direction changes (`min_interval_ticks` + `min_dir_setup_ticks`).

A pulse is high for at least {min_step_high_ticks} ticks and low for at least {min_step_low_ticks} ticks. A direction
pin changes at least {min_dir_setup_ticks} ticks before the next step rises."""

_HASH = """\
WELCOME carries `spec_hash` = 0x{spec_hash:08X} for this page: take `messages.toml` as parsed, drop every string under
the keys `doc`, `text` and `fix`, write it as JSON with sorted keys, no spaces and ASCII only, and read the first four
bytes of its SHA-256 as a little-endian u32. A better wording leaves it as it is; everything else changes it. A host
refuses a device whose `protocol_version` differs, and one whose `spec_hash` differs too: flash the image that was
released with the host."""

_VECTORS = """\
`protocol/vectors.json` holds frames of every message, damaged streams with the receiver's verdicts, payloads that
must be refused, and segments with the ticks of all their steps. An implementation of either end must agree with all
of them."""


def _steps(spec: Spec) -> str:
    limits = {limit.name: limit.value for limit in spec.limits}
    limits["min_reversal_ticks"] = limits["min_interval_ticks"] + limits["min_dir_setup_ticks"]
    return _STEPS.format(**{name: f"{value:,}" for name, value in limits.items()})


def protocol_md(spec: Spec) -> str:
    """Return the text of docs/protocol.md."""
    sections = {
        "Frames": _framing(spec.framing),
        "Out-of-band bytes": _out_of_band(spec),
        "Sequence": spec.sequence_doc.strip(),
        "Types": _types(),
        "Messages": "\n\n".join(_message(message) for message in spec.messages),
        "Structs": "\n\n".join(_struct(struct) for struct in spec.structs),
        "Step times": _steps(spec),
        "Limits": _table(
            ("name", "value", "meaning"),
            ((limit.name, f"{limit.value:,}", sentence(limit.doc)) for limit in spec.limits),
        ),
        "Boards": _boards(spec),
        "States": _table(("code", "name", "meaning"), ((str(c.code), c.name, sentence(c.text)) for c in spec.states)),
        "Faults": _codes(spec.faults),
        "Resets": _table(("code", "name", "meaning"), ((str(c.code), c.name, sentence(c.text)) for c in spec.resets)),
        "Pin maps": _table(
            ("code", "name", "meaning"), ((str(c.code), c.name, sentence(c.text)) for c in spec.pin_maps)
        ),
        "Results": "0 is done, above 0 asks to send again, below 0 is a refusal.\n\n" + _codes(spec.results),
        "Specification hash": _HASH.format(spec_hash=spec.spec_hash),
        "Golden vectors": _VECTORS,
    }
    head = f"<!-- {NOTICE} -->\n\n# The wire, version {spec.version}\n\n{spec.doc}\n"
    return head + "".join(f"\n## {title}\n\n{body}\n" for title, body in sections.items())


def _framing(framing: Framing) -> str:
    head = framing.header_bytes + framing.crc_bytes
    return _FRAMING.format(
        delimiter=framing.delimiter,
        escape=framing.escape,
        escape_xor=framing.escape_xor,
        header_bytes=framing.header_bytes,
        max_payload=framing.max_payload_bytes,
        max_frame=framing.max_frame_bytes,
        doc=framing.doc.strip(),
        crc=framing.crc,
        special=_hex_list((framing.delimiter, framing.escape, *framing.reserved)),
        reserved=_hex_list(framing.reserved),
        head=head,
        most=head + framing.max_payload_bytes + framing.crc_bytes,
    )


def _out_of_band(spec: Spec) -> str:
    rows = ((f"0x{c.code:02X}", str(c.repeats), c.name, sentence(c.doc)) for c in spec.out_of_band.codes)
    return f"{spec.out_of_band.doc.strip()}\n\n{_table(('code', 'in a row', 'name', 'meaning'), rows)}"


def _hex_list(codes: Iterable[int]) -> str:
    return ", ".join(f"0x{code:02X}" for code in codes)


def _types() -> str:
    forms = {"varuint": "LEB128", "varint": "zigzag, then LEB128"}
    rows = (
        (
            name,
            byte_range(scalar.min_bytes, scalar.max_bytes).removesuffix("s").removesuffix(" byte"),
            f"{scalar.minimum:,} .. {scalar.maximum:,}",
            forms.get(name, "two's complement" if scalar.signed else "binary"),
        )
        for name, scalar in SCALARS.items()
    )
    return _TYPES.format(table=_table(("type", "bytes", "range", "form"), rows))


def _message(message: MessageSpec) -> str:
    way = "host to device" if message.sender == "host" else "device to host"
    size = byte_range(message.min_bytes, message.max_bytes)
    head = f"### {message.name.upper()} (0x{message.code:02X}, {way})\n\n{sentence(message.doc)} Payload: {size}."
    return f"{head}\n\n{_fields(message.fields)}" if message.fields else head


def _struct(struct: StructSpec) -> str:
    size = byte_range(struct.min_bytes, struct.max_bytes)
    return f"### {struct.name}\n\n{sentence(struct.doc)} Takes {size}.\n\n{_fields(struct.fields)}"


def _fields(fields: Iterable[FieldSpec]) -> str:
    return _table(("field", "type", "unit", "meaning"), (_field_row(field) for field in fields))


def _field_row(field: FieldSpec) -> tuple[str, str, str, str]:
    kind = ", ".join(filter(None, (field.kind, count_words(field))))
    condition = presence(field)
    meaning = sentence(field.doc) + (f" See [{field.enum}](#{field.enum})." if field.enum else "")
    return (
        field.name,
        kind,
        field.unit if field.unit != "1" else "",
        meaning + (f" On the wire {condition}." if condition else ""),
    )


def _codes(codes: Iterable[Code]) -> str:
    return _table(
        ("code", "name", "what happened", "what to do"),
        ((str(c.code), c.name, sentence(c.text), sentence(c.fix) if c.fix else "") for c in codes),
    )


def _boards(spec: Spec) -> str:
    return "\n\n".join(_board(board, spec.limit("ticks_hz")) for board in spec.boards)


def _board(board: Board, ticks_hz: int) -> str:
    pins = zip(board.step_pins, board.dir_pins, board.limit_pins, strict=True)
    rows = ((str(joint), *names) for joint, names in enumerate(pins, start=1))
    least = board.min_interval_ticks
    return (
        f"### {board.name}\n\n{sentence(board.doc)} Pin map {board.pin_map}; a queue of {board.queue_bytes} bytes; "
        f"at least {least:,} ticks between two steps of a joint, {round(ticks_hz / least):,} steps/s; "
        f"pulses high for at least {board.min_step_high_ticks} ticks and low for {board.min_step_low_ticks}. "
        f"ENABLE is {board.enable_pin}, the stop input {board.stop_pin}.\n\n"
        + _table(("joint", "STEP", "DIR", "limit switch"), rows)
    )


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
