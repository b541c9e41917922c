"""Bytes that nobody meant: at the released image they move no STEP or DIR pin, and the next good frame is answered."""

import random
from pathlib import Path

import pytest

from planarm_sim import Uno
from planarm_wire import messages as wire
from planarm_wire.codec import decode, encode
from planarm_wire.framing import Frame, FrameDecoder, encode_frame

IMAGE = Path(__file__).resolve().parents[2] / "firmware/release/uno.hex"
MOVES_OF_BOTH_JOINTS = (wire.Move(2 * 40 + 1, 1000, 2000 << 8, 0), wire.Move(2 * 40, 1000, 2000 << 8, 0))
MOTION = wire.Segments(0, 0, 0, (wire.Segment(2 * 100_000 + 1, MOVES_OF_BOTH_JOINTS),))
BYTES_A_ROUND = 6000


class Board:
    """The emulated Uno and the host's end of a conversation with it."""

    def __init__(self) -> None:
        self.uno = Uno.from_hex(IMAGE)
        self.uno.run(seconds=0.02)
        self.decoder = FrameDecoder()
        self.seq = 0

    def send(self, message, count=True):
        """Send one good frame, led by a delimiter as after line noise, and return the replies to it."""
        self.uno.serial.write(bytes([wire.DELIMITER]) + encode_frame(self.seq, *encode(message)))
        self.seq = (self.seq + count) % 256
        return self.replies()

    def replies(self):
        self.uno.run(seconds=self.uno.serial.pending * 10 / wire.BAUD + 0.01)
        found = self.decoder.feed(self.uno.serial.read())
        return [decode(frame.type_code, frame.payload) for frame in found if isinstance(frame, Frame)]

    def moving_edges(self):
        return sum(len(self.uno.edges(pin)) for pin in (*wire.STEP_PINS, *wire.DIR_PINS))


def silent(board):
    """Nothing was said yet; the board knows no session."""


def idle(board):
    board.send(wire.Hello(wire.PROTOCOL_VERSION, 1))


def loaded(board):
    """Drivers enabled and a motion queued: START is one good frame away."""
    idle(board)
    board.send(wire.Enable(1))
    status = board.send(MOTION)[-1]
    assert status.state is wire.State.READY


def faulted(board):
    loaded(board)
    status = board.send(MOTION)[-1]
    assert status.fault is wire.Fault.QUEUE_MISUSE


def random_bytes(dice, board):
    return dice.randbytes(BYTES_A_ROUND)


def frames_to_damage(board):
    """Frames that would move the arm if they arrived whole, with the numbers that the board waits for."""
    wanted = [wire.Enable(1), MOTION, wire.Start(wire.MIN_LEAD_TICKS)]
    return [encode_frame((board.seq + ahead) % 256, *encode(m)) for ahead in range(2) for m in wanted]


def truncated_frames(dice, board):
    frames, sent = frames_to_damage(board), b""
    while len(sent) < BYTES_A_ROUND:
        frame = dice.choice(frames)
        sent += frame[: dice.randrange(1, len(frame) - 1)] + bytes([wire.DELIMITER])
    return sent


def flipped_frames(dice, board):
    frames, sent = frames_to_damage(board), b""
    while len(sent) < BYTES_A_ROUND:
        frame = bytearray(dice.choice(frames))
        for _ in range(dice.randrange(1, 4)):
            frame[dice.randrange(len(frame) - 1)] ^= 1 << dice.randrange(8)
        if bytes(frame) not in frames:
            sent += bytes(frame)
    return sent


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("hostile", [random_bytes, truncated_frames, flipped_frames])
@pytest.mark.parametrize("state", [silent, idle, loaded, faulted])
def test_nothing_moves_and_the_next_good_frame_is_answered(state, hostile, seed):
    board = Board()
    state(board)
    before = board.moving_edges()
    state_before = board.send(wire.Query())[-1] if state is not silent else None
    board.uno.serial.write(hostile(random.Random(seed), board))
    board.replies()
    after = board.send(wire.Query(), count=False)[-1]
    assert board.moving_edges() == before == 0
    assert after.crc_errors > 0
    if state_before is not None:
        assert (after.state, after.fault) == (state_before.state, state_before.fault), "the latched state is told"
        assert after.free_bytes == state_before.free_bytes
        assert after.ledger == state_before.ledger


def test_the_same_motion_undamaged_does_move():
    """The damaged frames above are near misses of this."""
    board = Board()
    loaded(board)
    board.send(wire.Start(wire.MIN_LEAD_TICKS))
    board.uno.run(seconds=0.1)
    assert [int((board.uno.edges(pin)["level"] == 1).sum()) for pin in wire.STEP_PINS] == [40, 40]


FRAMES_A_ROUND = 250


def mutated(frame, dice):
    """Return a frame with one to three bytes changed, left out, put in or doubled."""
    data = bytearray(frame)
    for _ in range(dice.randint(1, 3)):
        at = dice.randrange(len(data))
        match dice.randrange(4):
            case 0:
                data[at] ^= 1 << dice.randrange(8)
            case 1:
                del data[at]
            case 2:
                data.insert(at, dice.randrange(256))
            case _:
                data.insert(at, data[at])
        if not data:
            break
    return bytes(data) + bytes([wire.DELIMITER])


def mutants(frames, count, dice):
    """Return mutated frames, one after the other, of which the reference receiver takes none."""
    sent = b""
    while count:
        one = mutated(dice.choice(frames), dice)
        if not any(isinstance(found, Frame) for found in FrameDecoder().feed(one)):
            sent += one
            count -= 1
    return sent


def test_mutated_frames_move_no_pin_and_the_next_good_one_is_answered(sized):
    """All are near misses of ENABLE, SEGMENTS and START in the state in which START would move the arm."""
    board = Board()
    loaded(board)
    status = board.send(wire.Query())[-1]
    for seed in range(sized(8, 1_000_000 // FRAMES_A_ROUND)):
        board.uno.serial.write(mutants(frames_to_damage(board), FRAMES_A_ROUND, random.Random(seed)))
        board.replies()
        answered = board.send(wire.Query())
        assert answered, f"seed {seed}"
        told = answered[-1]
        assert (told.state, told.fault) == (wire.State.READY, wire.Fault.NONE), f"seed {seed}"
        assert (told.free_bytes, told.ledger) == (status.free_bytes, status.ledger), f"seed {seed}"
        assert board.moving_edges() == 0, f"seed {seed}"
