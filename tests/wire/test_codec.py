"""Every message comes back as it was; every payload that is none is refused by message and field."""

import dataclasses
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from planarm_wire import messages as m
from planarm_wire.codec import decode, encode, encoded_bytes
from planarm_wire.errors import WireError
from planarm_wire.framing import FrameDecoder, encode_frame
from planarm_wire.layout import EACH_JOINT, END, SCALARS, Field
from planarm_wire.steps import LONGEST_INTERVAL_TICKS


def values(field: Field) -> st.SearchStrategy[Any]:
    if isinstance(field.kind, type):
        return items(field.kind)
    if field.enum is not None:
        return st.sampled_from(list(field.enum))
    scalar = SCALARS[field.kind]
    return st.integers(scalar.minimum, scalar.maximum)


@st.composite
def items(draw: st.DrawFn, kind: type) -> Any:
    """Any value of a message or struct, by its layout; what the wire leaves out is 0."""
    fields: dict[str, Any] = {}
    for field in m.LAYOUTS[kind]:
        if field.when is not None and fields[field.when[0]] < field.when[1]:
            fields[field.name] = 0
        elif field.name == "joints":  # the other count of a device says how many entries follow
            fields[field.name] = draw(st.integers(0, 255).filter(lambda joints: joints != 4))
        elif field.repeat is None:
            fields[field.name] = draw(values(field))
        else:
            count = m.JOINTS if field.repeat == EACH_JOINT else field.repeat
            least, most = (1, 16) if field.repeat == END else (count, count)
            fields[field.name] = tuple(draw(st.lists(values(field), min_size=least, max_size=most)))
    return kind(**fields)


MESSAGES = st.one_of([items(kind) for kind in m.MESSAGES.values()])


def fits(message: m.Message) -> bool:
    return encoded_bytes(message) <= m.MAX_PAYLOAD_BYTES


@given(MESSAGES, st.integers(0, 255))
@settings(deadline=None, max_examples=200)
def test_every_message_comes_back_through_codec_and_frame(message: m.Message, seq: int) -> None:
    assume(fits(message))
    type_code, payload = encode(message)
    (frame,) = FrameDecoder().feed(encode_frame(seq, type_code, payload))
    again = decode(frame.type_code, frame.payload)
    assert again == message
    assert type(again) is type(message)
    for field in dataclasses.fields(message):
        assert type(getattr(again, field.name)) is type(getattr(message, field.name))


@given(MESSAGES, st.data())
@settings(deadline=None)
def test_a_payload_cut_short_or_too_long_is_refused(message: m.Message, data: st.DataObject) -> None:
    assume(fits(message))
    type_code, payload = encode(message)
    if type_code != m.MessageType.SEGMENTS:
        with pytest.raises(WireError, match="left over"):
            decode(type_code, payload + b"\0")
    cut = data.draw(st.integers(0, max(len(payload) - 1, 0)))
    assume(cut < len(payload))
    if type_code == m.MessageType.SEGMENTS:
        # A cut between two segments leaves a shorter message, any other none; never the same one.
        assert isinstance(message, m.Segments)
        try:
            left = decode(type_code, payload[:cut]).segments
        except WireError:
            return
        assert left == message.segments[: len(left)]
        assert len(left) < len(message.segments)
    else:
        with pytest.raises(WireError, match="short of this"):
            decode(type_code, payload[:cut])


@given(st.sampled_from(list(m.MESSAGES)), st.binary(max_size=m.MAX_PAYLOAD_BYTES))
@settings(deadline=None, max_examples=300)
def test_any_payload_is_refused_or_is_the_one_form_of_its_message(type_code: int, payload: bytes) -> None:
    try:
        message = decode(type_code, payload)
    except WireError:
        return
    assert encode(message) == (type_code, payload)


def test_known_bytes() -> None:
    # LEB128 and zigzag by hand: 300 = 0xAC 0x02; -3 zigzags to 5; 2^32 - 1 is FF FF FF FF 0F.
    segment = m.Segment(300, (m.Move(5, 1, 2**32 - 1, -3), m.Move(1)))
    assert encode(m.Segments(0, 0, 0, (segment,))) == (0x04, bytes.fromhex("000000 ac02 05 01 ffffffff0f 05 01"))
    assert encode(m.Enable(1)) == (0x03, b"\x01")
    assert encode(m.Query()) == (0x02, b"")
    status = m.Status(
        m.State.FAULT, m.Fault.UNDERRUN, 1, m.Result.VERSION, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, m.Ledger(12, (-1, 8))
    )
    assert encode(status)[1].hex(" ") == (
        "03 02 01 fb 02 03 00 04 05 06 07 08 09 0a 0b 00 00 00 0c 00 00 00 ff ff ff ff 08 00 00 00"
    )


def test_numpys_integers_are_whole_numbers() -> None:
    move = m.Move(np.int64(5), np.uint32(10), np.int64(900 << 8), np.int64(-4))
    plain = m.Move(5, 10, 900 << 8, -4)
    assert encode(m.Segments(0, 0, 0, (m.Segment(20, (move, move)),))) == encode(
        m.Segments(0, 0, 0, (m.Segment(20, (plain, plain)),))
    )


REST = m.Move(0)
LEDGER = m.Ledger(0, (0, 0))
REFUSED: dict[str, tuple[Any, str]] = {
    "number too large": (m.Start(2**32), "start.lead_ticks: 4294967296 is outside 0 .. 4294967295 (u32)"),
    "negative number": (m.Hello(-1, 0), "hello.protocol_version: -1 is outside 0 .. 255 (u8)"),
    "no whole number": (m.Start(1.5), "start.lead_ticks: is 1.5, not a whole number"),
    "too few entries": (
        m.Segments(0, 0, 0, (m.Segment(2, (REST,)),)),
        "segments.segments[0].moves: has 1 entries; devices have [2, 4] joints",
    ),
    "no entry": (m.Segments(0, 0, 0, ()), "segments.segments: is empty, needs one entry or more"),
    "not the struct": (
        m.Segments(0, 0, 0, (m.Segment(2, (REST, 5)),)),
        "segments.segments[0].moves[1]: is 5, not a Move",
    ),
    "deep inside": (
        m.Segments(0, 0, 0, (m.Segment(2, (REST, REST)), m.Segment(2, (REST, m.Move(4, 0, 0, 2**31))))),
        "segments.segments[1].moves[1].add: 2147483648 is outside -2147483648 .. 2147483647 (varint)",
    ),
    "absent field is not 0": (
        m.Segments(0, 0, 0, (m.Segment(2, (m.Move(2, 0, 1), REST)),)),
        "segments.segments[0].moves[0].interval_q8: is 1, but must be 0 while steps_dir >= 4 does not hold",
    ),
    "unknown code": (
        m.Status(99, m.Fault.NONE, 0, m.Result.OK, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, LEDGER),
        "status.state: 99 is no State (known: 0 IDLE, 1 READY, 2 RUNNING, 3 FAULT, ",
    ),
    "payload too long": (
        m.Segments(0, 0, 0, (m.Segment(2, (REST, REST)),) * 21),
        "segments: the payload has 66 bytes, over MAX_PAYLOAD_BYTES = 64; put fewer segments into one message",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_message_that_does_not_fit_its_form_is_refused(case: str) -> None:
    message, text = REFUSED[case]
    with pytest.raises(WireError, match=f"^{re.escape(text)}"):
        encode(message)


UNREADABLE = {
    "unknown type": (0x55, "", "message type 0x55 is unknown"),
    "left over": (0x02, "00", "query: 1 bytes are left over after the last field"),
    "too short": (0x05, "0102", "start.lead_ticks: the payload ends 2 bytes short of this u32"),
    "no segment": (0x04, "000000", "segments.segments: is empty"),
    "no head": (0x04, "00", "segments.fast: the payload ends 1 bytes short of this u8"),
    "overlong": (
        0x04,
        "000000 8000 00 00",
        "segments.segments[0].duration_flags: the number is written in more bytes than",
    ),
    "over 32 bits": (
        0x04,
        "000000 ffffffff10 00 00",
        "segments.segments[0].duration_flags: 4563402751 is over 32 bits",
    ),
    "six bytes": (
        0x04,
        "000000 ffffffffff00 00 00",
        "segments.segments[0].duration_flags: the number goes on after 5 bytes",
    ),
    "ends inside a number": (
        0x04,
        "000000 80",
        "segments.segments[0].duration_flags: the payload ends inside this number",
    ),
    "ends inside a move": (
        0x04,
        "000000 02 00 02",
        "segments.segments[0].moves[1].first_ticks: the payload ends inside this",
    ),
    "unknown code": (0x82, "00 63" + "00" * 29, "status.fault: 99 is no Fault (known: 0 NONE, "),
    "over the limit": (0x04, "00" * 65, "segments: a payload of 65 bytes is over MAX_PAYLOAD_BYTES = 64"),
}


@pytest.mark.parametrize("case", UNREADABLE)
def test_a_payload_that_holds_no_message_is_refused(case: str) -> None:
    type_code, payload, text = UNREADABLE[case]
    with pytest.raises(WireError, match=f"^{re.escape(text)}"):
        decode(type_code, bytes.fromhex(payload))


@pytest.mark.parametrize("name", m.BOARDS)
def test_a_message_has_the_boards_number_of_joints(name: str) -> None:
    joints = m.BOARDS[name].joints
    ledger = m.Ledger(7, tuple(range(joints)))
    welcome = m.Welcome(m.PROTOCOL_VERSION, 1, 2, 3, (0, 1, 2), m.Reset.POWER_ON, 0, joints, ledger)
    assert decode(*encode(welcome)) == welcome, "it tells the number itself"
    segments = m.Segments(1, 2, 3, (m.Segment(200, (REST, m.Move(3, 5), *(REST,) * (joints - 2))),))
    assert decode(*encode(segments), joints) == segments
    status = m.Status(m.State.READY, m.Fault.NONE, 0, m.Result.OK, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, ledger)
    assert decode(*encode(status), joints) == status
    other = 6 - joints
    with pytest.raises(WireError, match=r"left over|ends"):
        decode(*encode(status), other)


MOVES = st.one_of(
    st.builds(
        m.Move,
        st.integers(4, 2 * m.MAX_SEGMENT_STEPS + 1),
        st.integers(0, 2**21 - 1),
        st.integers(m.MIN_INTERVAL_TICKS << 8, m.MAX_INTERVAL_TICKS << 8),
        st.integers(-(2**27), 2**27 - 1),
    ),
    st.builds(  # slow: one interval is at most that much longer than the next
        m.Move,
        st.integers(4, 2 * m.MAX_COARSE_STEPS + 1),
        st.integers(0, 2**21 - 1),
        st.integers(m.SLOW_INTERVAL_TICKS << 8, LONGEST_INTERVAL_TICKS << 8),
        st.integers(-LONGEST_INTERVAL_TICKS << 8, LONGEST_INTERVAL_TICKS << 8),
    ),
)


@given(st.tuples(MOVES, MOVES, MOVES, MOVES), st.integers(2, 2**21 - 1), st.tuples(*[st.integers(0, 255)] * 4))
@settings(deadline=None, max_examples=300)
def test_a_segment_of_four_joints_fits_a_message_and_its_frame_the_window(
    moves: tuple[m.Move, ...], duration: int, head: tuple[int, ...]
) -> None:
    """Of a LEB128 number only the last byte can need an escape, so a full frame is far from twice its length."""
    frame = encode_frame(head[3], *encode(m.Segments(*head[:3], (m.Segment(duration, moves),))))
    assert len(frame) <= m.HOST_WINDOW_BYTES
