"""Frames: nothing special inside, any chunking, any damage, and the next good frame always arrives."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_wire import framing
from planarm_wire.errors import WireError
from planarm_wire.framing import Frame, FrameDecoder, FrameError, FrameFault, encode_frame
from planarm_wire.messages import (
    DELIMITER,
    ESCAPE,
    MAX_PAYLOAD_BYTES,
    RESERVED,
)

BYTE = st.integers(0, 255)
SPECIAL_BYTES = st.sampled_from((DELIMITER, ESCAPE, *RESERVED, 0x5B, 0x5C, 0x5D, 0x5E, 0, 0xFF))
PAYLOADS = st.lists(BYTE | SPECIAL_BYTES, max_size=MAX_PAYLOAD_BYTES).map(bytes)
FRAMES = st.builds(Frame, BYTE | SPECIAL_BYTES, BYTE | SPECIAL_BYTES, PAYLOADS)
NOISE = st.lists(BYTE | SPECIAL_BYTES, max_size=130).map(bytes)


def encoded(frame: Frame) -> bytes:
    return encode_frame(frame.seq, frame.type_code, frame.payload)


def decoded(line: bytes) -> list[Frame | FrameError]:
    return FrameDecoder().feed(line)


@given(st.lists(FRAMES, max_size=5))
@settings(deadline=None)
def test_frames_come_back_as_they_were(frames: list[Frame]) -> None:
    assert decoded(b"".join(encoded(frame) for frame in frames)) == frames


@given(FRAMES)
@settings(deadline=None)
def test_no_special_byte_stands_inside_a_frame(frame: Frame) -> None:
    line = encoded(frame)
    assert line[-1] == DELIMITER
    assert not set(line[:-1]) & {DELIMITER, *RESERVED}
    for index, byte in enumerate(line):
        if byte == ESCAPE:
            assert line[index + 1] ^ 0x20 in {DELIMITER, ESCAPE, *RESERVED}
    assert len(line) <= framing.MAX_FRAME_BYTES


def test_the_worst_case_is_reached_but_for_what_the_crc_decides() -> None:
    payload = bytes((DELIMITER,)) * MAX_PAYLOAD_BYTES
    longest = max(len(encode_frame(seq, code, payload)) for seq in (ESCAPE, DELIMITER) for code in (*RESERVED, ESCAPE))
    # Only the length byte and up to four CRC bytes may stand there unescaped.
    assert framing.MAX_FRAME_BYTES - 5 <= longest <= framing.MAX_FRAME_BYTES == 143


@given(st.lists(FRAMES | NOISE, max_size=6), st.lists(st.integers(0, 400), max_size=12))
@settings(deadline=None)
def test_any_chunking_gives_the_same(parts: list[Frame | bytes], cuts: list[int]) -> None:
    line = b"".join(encoded(part) if isinstance(part, Frame) else part for part in parts)
    decoder = FrameDecoder()
    edges = [0, *sorted(cuts), len(line)]
    in_chunks = [found for a, b in itertools.pairwise(edges) for found in decoder.feed(line[a:b])]
    assert in_chunks == decoded(line)
    one_by_one = FrameDecoder()
    assert [found for byte in line for found in one_by_one.feed(bytes((byte,)))] == in_chunks


@given(NOISE, FRAMES)
@settings(deadline=None)
def test_a_good_frame_after_a_delimiter_arrives_whatever_came_before(noise: bytes, frame: Frame) -> None:
    assert decoded(noise + bytes((DELIMITER,)) + encoded(frame))[-1] == frame
    # Without a delimiter between them the noise may take one frame with it, never two.
    assert decoded(noise + encoded(frame) + encoded(frame))[-1] == frame


@given(NOISE)
@settings(deadline=None)
def test_every_stretch_between_delimiters_has_one_verdict_that_counts_its_bytes(noise: bytes) -> None:
    line = noise + bytes((DELIMITER,))
    stretches = [bytes(b for b in part if b not in RESERVED) for part in line.split(bytes((DELIMITER,)))]
    verdicts = decoded(line)
    assert len(verdicts) == sum(1 for stretch in stretches if stretch)
    for stretch, verdict in zip(filter(None, stretches), verdicts, strict=True):
        if isinstance(verdict, FrameError):
            assert verdict.byte_count == len(stretch)


@given(FRAMES)
@settings(deadline=None, max_examples=60)
def test_no_single_flipped_bit_makes_another_valid_frame(frame: Frame) -> None:
    line = encoded(frame)
    for bit in range(8 * len(line)):
        damaged = bytearray(line)
        damaged[bit // 8] ^= 1 << (bit % 8)
        for found in decoded(bytes(damaged) + bytes((DELIMITER,))):
            assert isinstance(found, FrameError) or found == frame, f"bit {bit}"


@given(FRAMES, st.data())
@settings(deadline=None)
def test_a_frame_with_a_lost_doubled_or_cut_off_part_is_refused(frame: Frame, data: st.DataObject) -> None:
    line = encoded(frame)[:-1]
    index = data.draw(st.integers(0, len(line) - 1))
    end = bytes((DELIMITER,))
    for damaged in (line[:index] + line[index + 1 :], line[: index + 1] + line[index:], line[:index]):
        assert all(isinstance(found, FrameError) for found in decoded(damaged + end) if found != frame)


def test_each_cause_is_told() -> None:
    line = encode_frame(1, 2, b"abcdef")[:-1]
    end = bytes((DELIMITER,))
    cases = {
        line[:4]: FrameFault.TRUNCATED,
        line[:-3]: FrameFault.TRUNCATED,
        line + b"\0": FrameFault.TOO_LONG,
        b"\0" * 72: FrameFault.TOO_LONG,
        bytes((line[0], line[1] ^ 1)) + line[2:]: FrameFault.HEADER_CRC,
        line[:6] + b"x" + line[7:]: FrameFault.PAYLOAD_CRC,
        line[:6] + bytes((ESCAPE,)) + line[6:]: FrameFault.BAD_ESCAPE,
        line + bytes((ESCAPE,)): FrameFault.BAD_ESCAPE,
        bytes((ESCAPE, ESCAPE, DELIMITER ^ 0x20)): FrameFault.BAD_ESCAPE,
    }
    for damaged, cause in cases.items():
        assert decoded(damaged + end) == [FrameError(cause, len(damaged))], damaged.hex()
    assert str(FrameError(FrameFault.TRUNCATED, 4)) == "damaged frame of 4 bytes: fewer bytes than the header announces"


def test_silence_and_reserved_bytes_give_nothing() -> None:
    assert decoded(bytes((DELIMITER,)) * 4) == []
    assert decoded(bytes((*RESERVED, DELIMITER, *RESERVED, DELIMITER))) == []


def test_an_endless_line_without_delimiter_holds_no_more_than_a_frame() -> None:
    decoder = FrameDecoder()
    assert decoder.feed(b"\x55" * 100_000) == []
    assert len(decoder._body) <= framing.MAX_FRAME_BYTES
    assert decoder.feed(bytes((DELIMITER,))) == [FrameError(FrameFault.TOO_LONG, 100_000)]


@pytest.mark.parametrize(
    ("seq", "type_code", "payload", "message"),
    [
        (256, 0, b"", "seq 256 is outside 0 .. 255"),
        (0, -1, b"", "type_code -1 is outside 0 .. 255"),
        (0, 0, bytes(MAX_PAYLOAD_BYTES + 1), "a payload of 65 bytes is over MAX_PAYLOAD_BYTES = 64"),
    ],
)
def test_what_fits_no_frame_is_refused(seq: int, type_code: int, payload: bytes, message: str) -> None:
    with pytest.raises(WireError, match=message):
        encode_frame(seq, type_code, payload)
