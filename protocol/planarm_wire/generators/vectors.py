"""Writes vectors.json: frames, damaged bytes and step expansions that every implementation must agree on.

The values are chosen here by hand; what they must give is computed by the codec and by the plain step reference.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from typing import Any, Final

from planarm_wire import messages as m
from planarm_wire.codec import encode
from planarm_wire.crc import crc16
from planarm_wire.framing import FrameDecoder, FrameError, encode_frame
from planarm_wire.generators.text import NOTICE
from planarm_wire.spec import Spec
from planarm_wire.steps import expand_moves

_STUFFED_U32: Final = 0x7B7C7D7E  # every byte must be escaped
_REST: Final = m.Move(0)
_RAMP_UP: Final = m.Move(2 * 5 + 1, 100, 2000 << 8, -(100 << 8))
_RAMP_DOWN: Final = m.Move(2 * 4, 0, (1000 << 8) + 1, 0x81)
_ALL_STUFFED: Final = m.Move(0x7D, 0x7C, 0x7B, 0x3E)  # the last is 0x7C after zigzag
_EXTREME: Final = m.Move(2 * m.MAX_SEGMENT_STEPS + 1, m.MAX_SEGMENT_TICKS, m.MAX_INTERVAL_TICKS << 8, -(2**31))


_AT_ZERO: Final = m.Ledger(0, (0, 0))


def _status(state: m.State, *, free_bytes: int, mcu_ticks: int = 0, ledger: m.Ledger = _AT_ZERO) -> m.Status:
    return m.Status(state, m.Fault.NONE, 0, m.Result.OK, 0, free_bytes, 0, 0, 0, 0, 0, 100, 100, mcu_ticks, ledger)


_SEGMENTS: Final[tuple[m.Segment, ...]] = (
    m.Segment(2 * 20_000, (_REST, _REST)),
    m.Segment(2 * 20_000 + 1, (m.Move(1), m.Move(3, 19_999))),
    m.Segment(2 * 16_000, (_RAMP_UP, _RAMP_DOWN)),
    m.Segment(2 * 4_000, (m.Move(2 * 4 + 1, 0, 800 << 8, 0), m.Move(2 * 2, 1, (1294 << 8) + 0xFF, 0))),
    # A fraction of a tick: the floor of a falling sum, and a sum that passes 32 bits.
    m.Segment(2 * 400_000 + 1, (m.Move(2 * 40, 7, (9_000 << 8) + 5, -13), m.Move(2 * 7 + 1, 3, 59_999 << 8, 1))),
    m.Segment(2 * 12_000_000, (m.Move(2 * 300 + 1, 799, 39_900 << 8, -0x123456), m.Move(2, 11_999_999))),
    # The most steps whose add counts 2^-8 ticks, and one more. Slow moves; the interval before they begin.
    m.Segment(2 * 200_000, (m.Move(2 * 128, 5, 1_000 << 8, 3), m.Move(2 * 129 + 1, 5, 1_000 << 8, 3))),
    m.Segment(2 * 400_000, (m.Move(2 * 6, 5, 65_536 << 8, -129), m.Move(2 * 6 + 1, 5, (65_536 << 8) - 1, -129))),
    m.Segment(2 * 900_000, (m.Move(2 * 9 + 1, 320, 131_072 << 8, -((98_304 << 8) // 7)), _REST)),
)

_MESSAGES: Final[tuple[m.Message, ...]] = (
    m.Hello(m.PROTOCOL_VERSION, 0),
    m.Hello(m.PROTOCOL_VERSION, _STUFFED_U32),
    m.Hello(0xFF, 0xFFFFFFFF),
    m.Query(),
    m.Enable(0),
    m.Enable(1),
    *(m.Segments(0x7D, 0xFF, 3, (segment,)) for segment in _SEGMENTS),
    m.Segments(0, 0, 0, (_SEGMENTS[0],) * 9),
    m.Segments(0xFF, 0, 0xFF, (m.Segment(2 * m.MAX_SEGMENT_TICKS + 1, (_EXTREME, _EXTREME)),)),
    m.Segments(0x7E, 0x7B, 0x7C, (m.Segment(0x7E, (_ALL_STUFFED, _ALL_STUFFED)),) * 5),
    m.Start(m.MIN_LEAD_TICKS),
    m.Start(0xFFFFFFFF),
    m.Clear(),
    m.Resume(),
    m.Override(100),
    m.Stop(1),
    m.Config(m.PinMap.OWN, m.JOINTS, 0b10, 0b111, 60_000, 160_000, 56, (160_000, _STUFFED_U32)),
    m.SoftLimits((-(2**31), 0), (2**31 - 1, -1)),
    m.Home(1, 1, 8_000, 160_000, 20_000, _STUFFED_U32),
    m.SetPosition((-1, _STUFFED_U32)),
    m.Welcome(m.PROTOCOL_VERSION, 1, 2, 0x01234567, (1, 2, 3), m.Reset.POWER_ON, 0, m.JOINTS, m.Ledger(0, (0, 0))),
    m.Welcome(
        0xFF,
        _STUFFED_U32,
        _STUFFED_U32,
        _STUFFED_U32,
        (125, 126, 255),
        m.Reset.WATCHDOG,
        1,
        0x7D,
        m.Ledger(2**32 - 1, (-(2**31), 2**31 - 1)),
    ),
    _status(m.State.IDLE, free_bytes=m.QUEUE_BYTES - m.QUEUE_FRAME_BYTES),
    _status(m.State.RUNNING, free_bytes=7, mcu_ticks=123_456_789, ledger=m.Ledger(40, (-3, 16_000))),
    m.Status(
        m.State.FAULT,
        m.Fault.UNDERRUN,
        0x7B,
        m.Result.VERSION,
        0x7E,
        0x7D7E,
        0x7D,
        0x7B,
        0x7C,
        0xFF,
        0x83,
        100,
        99,
        2**32 - 1,
        m.Ledger(_STUFFED_U32, (-1, _STUFFED_U32)),
    ),
)

_BAD_PAYLOADS: Final[tuple[tuple[int, str, str], ...]] = (
    (0x01, "0100000000ff", "left over"),
    (0x01, "01000000", "too short"),
    (0x02, "00", "left over"),
    (0x04, "", "no head"),
    (0x04, "000000", "no segment"),
    (0x04, "00000080000000", "a number in more bytes than it needs"),
    (0x04, "000000ffffffff1f0000", "a number over 32 bits"),
    (0x04, "000000ffffffffff0f0000", "a number that goes on after 5 bytes"),
    (0x04, "000000c0b80202", "ends inside a move"),
    (0x04, "000000c0b8020000c0", "ends inside the second segment"),
    (0x7F, "", "no such message"),
)


def vectors_json(spec: Spec) -> str:
    """Return the text of vectors.json."""
    content = {
        "about": NOTICE,
        "protocol_version": spec.version,
        "spec_hash": spec.spec_hash,
        "crc": [{"data": data.hex(), "crc": crc16(data)} for data in (b"", b"\0", b"123456789", bytes(range(256)))],
        "frames": [_frame(index, message) for index, message in enumerate(_MESSAGES)],
        "streams": list(_streams()),
        "bad_payloads": [{"type": code, "payload": data, "why": why} for code, data, why in _BAD_PAYLOADS],
        "segments": [
            {"segment": dataclasses.asdict(segment), "step_ticks": expand_moves(segment)} for segment in _SEGMENTS
        ],
    }
    return json.dumps(content, indent=1) + "\n"


def _frame(index: int, message: m.Message) -> dict[str, Any]:
    seq = (0, 1, 0x7E, 0x7D, 0x7B, 0x7C, 0xFF)[index % 7]
    type_code, payload = encode(message)
    return {
        "message": message.TYPE.name.lower(),
        "fields": dataclasses.asdict(message),
        "seq": seq,
        "type": type_code,
        "payload": payload.hex(),
        "line": encode_frame(seq, type_code, payload).hex(),
    }


def _streams() -> Iterator[dict[str, Any]]:
    """Yield bytes on the line, sound and damaged, with what a receiver makes of them."""
    query = encode_frame(5, *encode(m.Query()))
    hello = encode_frame(6, *encode(m.Hello(m.PROTOCOL_VERSION, _STUFFED_U32)))
    status = encode_frame(7, *encode(_MESSAGES[-2]))
    delimiter, escape = bytes((m.DELIMITER,)), bytes((m.ESCAPE,))
    long_header = bytes((m.MAX_PAYLOAD_BYTES + 1, 0, 4))
    cases = {
        "two frames": query + hello,
        "silence: delimiters only": delimiter * 3 + query,
        "reserved bytes between and inside frames are dropped": bytes(m.RESERVED)
        + query[:2]
        + bytes(m.RESERVED)
        + query[2:],
        "bytes of noise, ended by a delimiter": b"\x00\xff\x55" + delimiter + query,
        "noise without a delimiter takes the next frame with it": b"\x00\xff\x55" + query + hello,
        "cut off": hello[:-4] + delimiter + query,
        "cut off inside the header": hello[:2] + delimiter + query,
        "one byte lost in the payload": hello[:6] + hello[7:] + query,
        "header damaged": _flipped(status, 1, 0x01) + query,
        "header's CRC damaged": _flipped(status, 3, 0x80) + query,
        "payload damaged": _flipped(status, 9, 0x10) + query,
        "payload's CRC damaged": _flipped(status, len(status) - 2, 0x02) + query,
        "escape before a byte that needs none": query[:1] + escape + query[1:] + query,
        "escape before the delimiter": query[:-1] + escape + delimiter + query,
        "escape twice": escape + escape + b"\x5d" + delimiter + query,
        "more bytes than the header announces": query[:-1] + b"\x00\x00" + delimiter + query,
        "a length over the limit": long_header + crc16(long_header).to_bytes(2, "little") + delimiter + query,
        "far more bytes than a frame has": b"\x01" * 300 + delimiter + query,
    }
    for name, line in cases.items():
        yield {"name": name, "line": line.hex(), "gives": [_verdict(found) for found in FrameDecoder().feed(line)]}


def _flipped(frame: bytes, index: int, bits: int) -> bytes:
    return frame[:index] + bytes((frame[index] ^ bits,)) + frame[index + 1 :]


def _verdict(found: object) -> dict[str, Any]:
    if isinstance(found, FrameError):
        return {"error": found.cause.name.lower(), "byte_count": found.byte_count}
    return {k: v.hex() if isinstance(v, bytes) else v for k, v in dataclasses.asdict(found).items()}  # type: ignore[call-overload]
