"""Sequence, states, refusals and replies of the firmware's core, against docs/protocol.md and the golden vectors."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import pytest

from firmware_board import (
    ANSWER_TICKS,
    LEAD_TICKS,
    Board,
    Delays,
    Firmware,
    NativeFirmware,
    Schedule,
    end_motion,
    room_after,
    run_of,
    segment_of,
)
from planarm_wire.codec import encoded_bytes
from planarm_wire.framing import encode_frame
from planarm_wire.messages import (
    DELIMITER,
    EMERGENCY_CODE,
    EMERGENCY_REPEATS,
    ENABLE_PIN,
    MAX_SEGMENT_TICKS,
    MIN_LEAD_TICKS,
    PROTOCOL_VERSION,
    QUEUE_FRAME_BYTES,
    SPEC_HASH,
    Clear,
    Enable,
    Fault,
    Message,
    Move,
    Query,
    Result,
    Segment,
    Segments,
    Start,
    State,
    Status,
    Welcome,
)

VECTORS = json.loads((Path(__file__).parents[2] / "protocol" / "vectors.json").read_text(encoding="utf-8"))
SHORT = segment_of(20_000, run_of(4), run_of(3))


@pytest.fixture
def board(firmware: Firmware) -> Board:
    return Board(firmware)


def bring_to(board: Board, state: State) -> None:
    """From power-up to a state."""
    board.hello()
    if state is State.IDLE:
        return
    board.ask(Enable(1))
    if state is State.READY:
        return
    board.ask(Segments(0, 0, 0, (segment_of(10_000_000),)))
    board.ask(Start(LEAD_TICKS))
    if state is State.FAULT:
        board.ask(Segments(0, 0, 0, (segment_of(0),)))
    assert board.ask().state is state


@pytest.mark.parametrize("vector", VECTORS["streams"], ids=lambda vector: vector["name"])
def test_streams_of_the_golden_vectors(board: Board, vector: dict) -> None:
    # The same verdicts as the vectors: damage is counted, each good frame is answered, only HELLO changes the session.
    line = bytes.fromhex(vector["line"])
    for at in range(0, len(line), 64):
        board.receive(line[at : at + 64])
        board.run(ANSWER_TICKS)
    gives = vector["gives"]
    good = [frame for frame in gives if "error" not in frame]
    assert board.replies
    hellos = [
        frame for frame in good if frame["type_code"] == 1 and frame["payload"].startswith(f"{PROTOCOL_VERSION:02x}")
    ]
    welcomes = [reply for _, reply in board.replies if isinstance(reply, Welcome)]
    assert len(welcomes) <= len(hellos)
    if hellos:
        assert welcomes[-1].host_nonce == int.from_bytes(bytes.fromhex(hellos[-1]["payload"])[1:], "little")
    board.hello()
    assert board.ask().crc_errors == len(gives) - len(good)


@pytest.mark.parametrize("vector", VECTORS["frames"], ids=lambda vector: f"{vector['message']} seq {vector['seq']}")
def test_every_golden_frame_passes_the_checks(board: Board, vector: dict) -> None:
    board.receive(bytes.fromhex(vector["line"]))
    board.run(ANSWER_TICKS)
    assert len(board.replies) == 1
    board.hello()
    assert board.ask().crc_errors == 0


@pytest.mark.parametrize(
    "vector", VECTORS["bad_payloads"], ids=lambda vector: f"type {vector['type']}: {vector['why']}"
)
def test_bad_payloads_are_refused(board: Board, vector: dict) -> None:
    board.get_ready()
    payload = bytes.fromhex(vector["payload"])
    board.receive(encode_frame(board.seq, vector["type"], payload))
    board.run(ANSWER_TICKS)
    if vector["type"] != 1:
        board.seq = (board.seq + 1) % 256
    status = board.ask()
    assert status.refusal is (Result.UNKNOWN_TYPE if vector["why"] == "no such message" else Result.MALFORMED)
    assert board.motion_edges() == []
    # A motion with a part left out must never run.
    assert (status.fault is Fault.BAD_SEGMENT) == (vector["type"] == 4)


@pytest.mark.parametrize("vector", VECTORS["segments"], ids=lambda vector: str(vector["segment"]["duration_flags"]))
def test_segments_of_the_golden_vectors(board: Board, vector: dict) -> None:
    fields = vector["segment"]
    segment = Segment(fields["duration_flags"] | 1, tuple(Move(**move) for move in fields["moves"]))
    board.get_ready()
    board.stream([segment], slice_ticks=50_000)
    rises = [board.rises(joint) for joint in range(2)]
    lead = next(r[0] - t[0] for r, t in zip(rises, vector["step_ticks"], strict=True) if t) if any(rises) else 0
    assert [[tick - lead for tick in joint] for joint in rises] == vector["step_ticks"]


def test_welcome(board: Board) -> None:
    welcome = board.hello(nonce=0xDEADBEEF, seq=77)
    assert (welcome.protocol_version, welcome.host_nonce, welcome.spec_hash) == (
        PROTOCOL_VERSION,
        0xDEADBEEF,
        SPEC_HASH,
    )
    assert (welcome.ledger.executed_segments, welcome.ledger.position_usteps) == (0, (0, 0))
    assert board.replies[-1][0] == 78


def test_boot_nonces_look_unrelated(native_firmware: NativeFirmware) -> None:
    nonces = [Board(native_firmware, boot_count=count).hello().boot_nonce for count in range(64)]
    assert len(set(nonces)) == len(nonces)
    changed = [(a ^ b).bit_count() for a, b in itertools.pairwise(nonces)]
    assert min(changed) >= 4
    assert 13 <= sum(changed) / len(changed) <= 19  # half of 32 bits


def test_nothing_is_carried_out_before_hello(board: Board) -> None:
    assert board.ask(Enable(1), seq=0).state is State.IDLE
    assert board.edges == []


def test_wrong_version_is_refused(board: Board) -> None:
    assert board.hello(version=PROTOCOL_VERSION + 1).protocol_version == PROTOCOL_VERSION
    status = board.ask(Enable(1))
    assert (status.state, status.refusal) == (State.IDLE, Result.VERSION)
    board.hello()
    assert board.ask(Enable(1)).state is State.READY


def test_a_frame_is_carried_out_once(board: Board) -> None:
    board.get_ready()
    first = board.ask(Segments(0, 0, 0, (SHORT,)))
    again = board.ask(Segments(0, 0, 0, (SHORT,)), seq=board.seq - 1)
    ahead = board.ask(Segments(0, 0, 0, (SHORT,)), seq=board.seq + 1)
    assert first.free_bytes == again.free_bytes == ahead.free_bytes == room_after(Segments(0, 0, 0, (SHORT,)))
    assert board.replies[-1][0] == board.seq
    assert ahead.refusal is Result.OK


def test_sequence_wraps(board: Board) -> None:
    board.hello(seq=250)
    for _ in range(20):
        assert board.ask().crc_errors == 0
        assert board.replies[-1][0] == board.seq


def test_frames_in_a_row_share_replies(native_firmware: NativeFirmware) -> None:
    # Replies are never queued: the line is busy with one reply, the next tells all that happened meanwhile.
    board = Board(native_firmware, delays=Delays(pass_ticks=200))
    board.hello()
    board.replies.clear()
    for _ in range(20):
        board.send(Query())
    board.run(200_000)
    assert 1 <= len(board.replies) <= 3
    assert board.replies[-1][0] == board.seq


COMMANDS: dict[str, Message] = {
    "enable": Enable(1),
    "release": Enable(0),
    "segments": Segments(0, 0, 0, (SHORT,)),
    "start": Start(LEAD_TICKS),
    "clear": Clear(),
}
# docs/protocol.md, states and messages: the state after the command, or None when it is refused.
TABLE = {
    State.IDLE: {"enable": State.READY, "release": State.IDLE, "segments": None, "start": None, "clear": State.IDLE},
    State.READY: {
        "enable": State.READY,
        "release": State.IDLE,
        "segments": State.READY,
        "start": None,
        "clear": State.READY,
    },
    State.RUNNING: {"enable": None, "release": None, "segments": State.RUNNING, "start": None, "clear": None},
    State.FAULT: {"enable": None, "release": None, "segments": None, "start": None, "clear": State.READY},
}


@pytest.mark.parametrize("state", TABLE)
@pytest.mark.parametrize("command", COMMANDS)
def test_commands_by_state(board: Board, state: State, command: str) -> None:
    bring_to(board, state)
    before = board.ask()
    after = board.ask(COMMANDS[command])
    expected = TABLE[state][command]
    assert after.state is (state if expected is None else expected)
    if expected is None and before.refusal is Result.OK:
        assert (after.refusal, after.refusal_seq) == (Result.WRONG_STATE, board.seq - 1)
    if expected is not None:
        assert after.refusal is Result.OK


def test_enable_pin_follows_the_state(board: Board) -> None:
    board.get_ready()
    board.ask(Enable(0))
    board.get_ready()
    board.ask(Segments(0, 0, 0, (segment_of(0),)))  # a fault keeps holding
    assert board.ask(Clear()).state is State.READY
    assert [edge.level for edge in board.edges] == [0, 1, 0], "the position is known: the drivers stay on"
    board.receive(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
    board.run(100_000)
    assert board.ask(Clear()).state is State.IDLE
    assert [(edge.pin, edge.level) for edge in board.edges] == [(ENABLE_PIN, level) for level in (0, 1, 0, 1)]


@pytest.mark.parametrize(
    ("message", "refusal"),
    [
        (Enable(2), Result.OUT_OF_RANGE),
        (Start(MIN_LEAD_TICKS - 1), Result.OUT_OF_RANGE),
        (Start(MAX_SEGMENT_TICKS + 1), Result.OUT_OF_RANGE),
        (Start(MIN_LEAD_TICKS), Result.OK),
    ],
)
def test_values_outside_their_limits(board: Board, message: Message, refusal: Result) -> None:
    board.get_ready()
    board.ask(Segments(0, 0, 0, (SHORT,)))
    assert board.ask(message).refusal is refusal


def test_first_refusal_stays_until_clear_or_hello(board: Board) -> None:
    board.get_ready()
    first = board.ask(Enable(7))
    second = board.ask(Start(LEAD_TICKS))
    assert (second.refusal, second.refusal_seq) == (Result.OUT_OF_RANGE, first.refusal_seq)
    assert board.ask(Clear()).refusal is Result.OK
    assert board.ask(Start(LEAD_TICKS)).refusal is Result.WRONG_STATE
    board.hello()
    assert board.ask().refusal is Result.OK


def fill(board: Board, message: Segments) -> int:
    """Queue a message until it fits once more, but not twice; return the bytes left."""
    taken: list[Segments] = []
    while room_after(*taken) >= 2 * encoded_bytes(message) + QUEUE_FRAME_BYTES:
        taken.append(message)
        assert board.ask(message).free_bytes == room_after(*taken)
    return room_after(*taken)


def test_segments_are_taken_all_or_none(board: Board) -> None:
    board.get_ready()
    one = Segments(0, 0, 0, (segment_of(20_000, run_of(2)),))
    more = Segments(0, 0, 0, one.segments * 3)
    left = fill(board, one)
    assert encoded_bytes(one) <= left < encoded_bytes(more)
    status = board.ask(more)
    assert (status.free_bytes, status.refusal, status.fault) == (left, Result.OK, Fault.NONE)
    board.seq -= 1  # busy: the same number is expected again
    assert board.replies[-1][0] == board.seq
    assert board.ask(one).free_bytes == max(0, left - encoded_bytes(one) - QUEUE_FRAME_BYTES)


def test_busy_leaves_no_trace_of_the_segments(board: Board) -> None:
    # The joint's rest, kept for the least interval across boundaries, must be that of the segments that were taken.
    board.get_ready()
    late_end = segment_of(20_001, run_of(1, first=20_000))
    early_end = segment_of(20_000, run_of(1, first=0))
    left = fill(board, Segments(0, 0, 0, (early_end,)))
    late = Segments(0, 0, 0, (late_end, early_end, early_end))
    assert encoded_bytes(late) > left
    board.ask(late)
    board.seq -= 1
    status = board.ask(Segments(0, 0, 0, (early_end,)))
    assert (status.fault, status.refusal) == (Fault.NONE, Result.OK)
    assert status.free_bytes < left


def test_hello_in_motion_leaves_the_motion_alone(board: Board) -> None:
    motion = end_motion([segment_of(100_000, run_of(90))] * 3)
    board.get_ready()
    for segment in motion:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(100_000)
    board.hello(nonce=5)
    board.run(400_000)
    status = board.ask()
    assert (status.state, status.ledger.position_usteps) == (State.READY, Schedule.of(motion).positions())
    rises = board.rises(0)
    assert [tick - rises[0] for tick in rises] == [tick - 1000 for tick, _ in Schedule.of(motion).steps[0]]


def test_the_end_of_a_motion_is_told_unasked(board: Board) -> None:
    board.get_ready()
    board.ask(Segments(0, 0, 0, (segment_of(2 * ANSWER_TICKS, run_of(3), last=True),)))
    board.ask(Start(LEAD_TICKS))
    board.replies.clear()
    board.run(2 * ANSWER_TICKS)
    ((seq, status),) = board.replies
    assert isinstance(status, Status)
    assert (seq, status.state, status.ledger.executed_segments) == (board.seq, State.READY, 1)


def test_release_drops_what_was_queued(board: Board) -> None:
    board.get_ready()
    board.ask(Segments(0, 0, 0, (SHORT,)))
    assert board.ask(Enable(0)).free_bytes == room_after()
    board.ask(Enable(1))
    assert board.ask(Start(LEAD_TICKS)).refusal is Result.WRONG_STATE
    board.run(100_000)
    assert board.motion_edges() == []


def test_ring_full_is_counted(native_firmware: NativeFirmware) -> None:
    board = Board(native_firmware)
    board.hello()
    board.receive(bytes([0x55]) * 300 + bytes([DELIMITER]))
    board.run(ANSWER_TICKS)
    board.receive(bytes([DELIMITER]))
    assert board.ask().ring_full == 301 - 128
