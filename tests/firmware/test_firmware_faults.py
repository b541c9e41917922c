"""Faults of the firmware's core: each stops the pulses before a wrong one, and the ledger stays true."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_board import (
    LEAD_TICKS,
    Board,
    Delays,
    EmulatedFirmware,
    Firmware,
    NativeFirmware,
    Schedule,
    end_motion,
    room_after,
    run_of,
    segment_of,
)
from planarm_wire.codec import encode
from planarm_wire.framing import encode_frame
from planarm_wire.messages import (
    DELIMITER,
    JOINTS,
    MAX_COARSE_STEPS,
    MAX_INTERVAL_TICKS,
    MAX_SEGMENT_STEPS,
    MAX_SEGMENT_TICKS,
    MAX_SLOW_INTERVAL_TICKS,
    MIN_DIR_SETUP_TICKS,
    MIN_INTERVAL_TICKS,
    MIN_SLOW_INTERVAL_TICKS,
    SLOW_INTERVAL_TICKS,
    Fault,
    Hello,
    Move,
    Query,
    Result,
    Segment,
    Segments,
    Start,
    State,
    Status,
    Stop,
)

LEAST, MOST = MIN_INTERVAL_TICKS, MAX_INTERVAL_TICKS
SLOW, LEAST_SLOW, MOST_SLOW = SLOW_INTERVAL_TICKS, MIN_SLOW_INTERVAL_TICKS, MAX_SLOW_INTERVAL_TICKS
BACK = MIN_INTERVAL_TICKS + MIN_DIR_SETUP_TICKS
ONE = 1 << 16
Q8 = 1 << 8


@pytest.fixture
def board(firmware: Firmware) -> Board:
    board = Board(firmware)
    board.get_ready()
    return board


GOOD = {
    "shortest": segment_of(1),
    "longest": segment_of(MAX_SEGMENT_TICKS),
    "last step on the last tick": segment_of(3001, run_of(3, first=1000)),
    "most steps": segment_of(MAX_SEGMENT_STEPS * 800, Move(2 * MAX_SEGMENT_STEPS, 0, LEAST << 8, 0)),
    "least interval": segment_of(9000, run_of(9, interval=LEAST)),
    "largest interval": segment_of(10 * MOST, run_of(9, interval=MOST)),
    "down to the least interval": segment_of(20_000, run_of(12, interval=LEAST + 10, add=-1)),
    "up to the largest interval": segment_of(20 * MOST, run_of(12, interval=MOST - 10, add=1)),
    "change unused by two steps": segment_of(9000, run_of(2, interval=LEAST, add=-32768)),
    "just not slow": segment_of(30 * MOST, Move(2 * 12, 0, MOST * Q8 + 0xF5, 1)),
    "most coarse steps": segment_of(200 * LEAST, Move(2 * MAX_COARSE_STEPS, 0, LEAST * Q8, 0)),
    "an add of 2^24 units is none": segment_of(20 * LEAST, Move(2 * 9, 0, LEAST * Q8, 2**24)),
    "slow": segment_of(30 * MOST, Move(2 * 12, 0, SLOW * Q8, 23)),
    "slow down to the least": segment_of(30 * MOST, Move(2 * 12, 0, (LEAST_SLOW + 33_000) * Q8, -3300 * Q8)),
    "slow up to the largest": segment_of(2**28, Move(2 * 12, 0, MOST_SLOW * Q8, 23)),
    "most slow steps": segment_of(127 * SLOW + 1, Move(2 * MAX_COARSE_STEPS, 0, SLOW * Q8, 0)),
    "fraction carries into the last tick": segment_of(3001, Move(2 * 3, 1000, 1000 * Q8 - 1, 2)),
}
BAD = {
    "no duration": segment_of(0),
    "too long": segment_of(MAX_SEGMENT_TICKS + 1),
    "only step at the end": segment_of(1000, run_of(1, first=1000)),
    "last step at the end": segment_of(3000, run_of(3, first=1000)),
    "too many steps": segment_of(MAX_SEGMENT_TICKS, Move(2 * (MAX_SEGMENT_STEPS + 1), 0, LEAST << 8, 0)),
    "far too many steps": segment_of(MAX_SEGMENT_TICKS, Move(2**32 - 2, 0, LEAST << 8, 0)),
    "below the least interval": segment_of(9000, Move(2 * 9, 0, LEAST * Q8 - 1, 0)),
    "above the largest interval": segment_of(20 * MOST, Move(2 * 9, 0, MOST * Q8 + 0xF9, 1)),
    "falls below the least": segment_of(20_000, Move(2 * 12, 0, (LEAST + 10) * Q8, -Q8 - 1)),
    "rises above the largest": segment_of(20 * MOST, Move(2 * 12, 0, (MOST - 9) * Q8, Q8)),
    "falls below the least slow one": segment_of(
        30 * MOST, Move(2 * 12, 0, (LEAST_SLOW + 33_000) * Q8, -3300 * Q8 - 1)
    ),
    "rises above the largest slow one": segment_of(2**28, Move(2 * 12, 0, MOST_SLOW * Q8, 26)),
    "too many slow steps": segment_of(MAX_SEGMENT_TICKS, Move(2 * MAX_COARSE_STEPS + 2, 0, SLOW * Q8, 0)),
    "slow interval wraps downwards": segment_of(MAX_SEGMENT_TICKS, Move(2 * 18, 0, SLOW * Q8, -(2**30))),
    "slow last step at the end": segment_of(127 * SLOW, Move(2 * MAX_COARSE_STEPS, 0, SLOW * Q8, 0)),
    "longest slow run": segment_of(1000, Move(2 * MAX_COARSE_STEPS, 0, 2**32 - 1, 0)),
    "interval wraps round once": segment_of(MAX_SEGMENT_TICKS, Move(2 * 18, 0, 1000 * Q8, 2**20)),
    "interval wraps far": segment_of(MAX_SEGMENT_TICKS, Move(2 * MAX_SEGMENT_STEPS, 0, 1000 * Q8, 2**31 - 1)),
    "interval wraps downwards": segment_of(MAX_SEGMENT_TICKS, Move(2 * 18, 0, 50_000 * Q8, -(2**20))),
    "largest negative change": segment_of(MAX_SEGMENT_TICKS, Move(2 * 4, 0, 50_000 * Q8, -(2**23))),
    "run longer than 2^30 ticks": segment_of(1000, Move(2 * MAX_SEGMENT_STEPS, 0, MOST * Q8, 0)),
    "first step beyond 2^30": segment_of(1000, run_of(1, first=2**32 - 1)),
    "second joint bad": segment_of(9000, run_of(2), Move(2 * 9, 0, LEAST * Q8 - 1, 0)),
}


@pytest.mark.parametrize("name", GOOD)
def test_segments_at_their_limits_are_taken(board: Board, name: str) -> None:
    message = Segments(0, 0, 0, (GOOD[name],))
    status = board.ask(message)
    assert (status.state, status.fault, status.free_bytes) == (State.READY, Fault.NONE, room_after(message))


@pytest.mark.parametrize("name", BAD)
def test_segments_beyond_their_limits_are_faults(board: Board, name: str) -> None:
    status = board.ask(Segments(0, 0, 0, (GOOD["least interval"], BAD[name])))
    assert (status.state, status.fault, status.refusal) == (State.FAULT, Fault.BAD_SEGMENT, Result.OUT_OF_RANGE)
    assert board.motion_edges() == []


@settings(max_examples=300, deadline=None)
@given(
    steps=st.one_of(st.integers(1, 40), st.integers(1, MAX_SEGMENT_STEPS)),
    first=st.integers(0, 2**31),
    interval=st.one_of(st.integers(LEAST * Q8 - 3, LEAST * Q8 + 3), st.integers(0, 2**25), st.integers(0, 2**32 - 1)),
    add=st.one_of(st.integers(-3, 3), st.integers(-(2**31), 2**31 - 1)),
    aim=st.integers(-2, 2),
)
def test_verdict_on_any_move(
    native_firmware: NativeFirmware, steps: int, first: int, interval: int, add: int, aim: int
) -> None:
    # The rules of docs/protocol.md in plain integers; the duration is aimed at the last step's tick.
    move = Move(2 * steps, first) if steps == 1 else Move(2 * steps, first, interval, add)
    n = steps - 1
    slow = interval >= SLOW * Q8
    if steps <= MAX_COARSE_STEPS:
        add = add * 256 if slow else (add * 256 + 2**31) % 2**32 - 2**31
    last = first + ((256 * n * interval + n * (n - 1) // 2 * add) >> 16 if n else 0)
    duration = max(0, min(last + 1 + aim, 2**31 - 1))
    ends = (256 * interval, 256 * interval + (steps - 2) * add)
    good = 1 <= duration <= MAX_SEGMENT_TICKS and 0 <= last < duration
    if n:
        least, end = (LEAST_SLOW, MOST_SLOW + 1) if slow else (LEAST, MOST + 1)
        good &= least * ONE <= min(ends) and max(ends) < end * ONE and (steps <= MAX_COARSE_STEPS or not slow)
    board = Board(native_firmware)
    board.get_ready()
    status = board.ask(Segments(0, 0, 0, (segment_of(duration, move),)))
    assert (status.fault is Fault.NONE) == good


@pytest.mark.parametrize(("gap", "fault"), [(LEAST, Fault.NONE), (LEAST - 1, Fault.BAD_SEGMENT)])
@pytest.mark.parametrize("between", [0, 3])
@pytest.mark.parametrize("together", [True, False])
def test_least_interval_across_boundaries(board: Board, gap: int, fault: Fault, between: int, together: bool) -> None:
    # Also over segments in which the joint rests, in one frame or in several.
    rest = [segment_of(50)] * between
    segments = [segment_of(3001, run_of(3)), *rest, segment_of(5000, run_of(2, first=gap - 1 - 50 * between))]
    if together:
        status = board.ask(Segments(0, 0, 0, tuple(segments)))
    else:
        for segment in segments:
            status = board.ask(Segments(0, 0, 0, (segment,)))
    assert status.fault is fault


@pytest.mark.parametrize(("gap", "fault"), [(BACK, Fault.NONE), (BACK - 1, Fault.BAD_SEGMENT)])
@pytest.mark.parametrize("positive", [True, False])
def test_least_time_from_a_step_to_one_back(board: Board, gap: int, fault: Fault, positive: bool) -> None:
    # The direction is that of the joint's last step, whatever the other joint did and over a rest.
    there = segment_of(3001, run_of(3, positive=positive), run_of(2, positive=not positive))
    back = segment_of(5000, run_of(1, first=gap - 101, positive=not positive))
    assert board.ask(Segments(0, 0, 0, (there, segment_of(100), back))).fault is fault


def test_a_joint_that_has_not_moved_has_rested_for_ever(board: Board) -> None:
    message = Segments(0, 0, 0, (segment_of(500), segment_of(5000, run_of(2, first=0))))
    status = board.ask(message)
    assert (status.fault, status.free_bytes) == (Fault.NONE, room_after(message))


def test_bad_segment_in_motion_stops_the_steps(board: Board) -> None:
    board.ask(Segments(0, 0, 0, (segment_of(200_000, run_of(190), run_of(90, interval=2000, positive=False)),)))
    board.send(Start(LEAD_TICKS))
    board.run(100_000)
    board.send(Segments(0, 0, 0, (BAD["no duration"],)))
    board.run(400_000)
    status = board.ask()
    assert (status.state, status.fault) == (State.FAULT, Fault.BAD_SEGMENT)
    assert 0 < len(board.rises(0)) < 100
    assert status.ledger.position_usteps == (len(board.rises(0)), -len(board.rises(1)))
    assert status.ledger.executed_segments == 0
    levels = {edge.pin: edge.level for edge in board.motion_edges()}
    assert levels["D9"] == levels["D10"] == 0


@pytest.mark.parametrize("state", [State.READY, State.RUNNING])
def test_segments_after_the_last_are_misuse(board: Board, state: State) -> None:
    board.ask(Segments(0, 0, 0, (segment_of(1_000_000, run_of(3), last=True),)))
    if state is State.RUNNING:
        board.ask(Start(LEAD_TICKS))
    status = board.ask(Segments(0, 0, 0, (segment_of(1000),)))
    assert (status.state, status.fault) == (State.FAULT, Fault.QUEUE_MISUSE)


def test_segments_after_the_last_in_one_frame_are_misuse(board: Board) -> None:
    status = board.ask(Segments(0, 0, 0, (segment_of(1000, last=True), segment_of(1000))))
    assert status.fault is Fault.QUEUE_MISUSE


def test_the_first_fault_stays(board: Board) -> None:
    board.ask(Segments(0, 0, 0, (segment_of(1000, last=True), segment_of(1000))))
    assert board.ask(Segments(0, 0, 0, (BAD["no duration"],))).fault is Fault.QUEUE_MISUSE


@pytest.mark.parametrize("segments", [6, 8])
def test_underrun(board: Board, segments: int) -> None:
    motion = [segment_of(30_000, run_of(20), run_of(7, positive=False))] * segments
    for segment in motion:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 60_000 + 30_000 * segments)
    unasked = board.replies[-1][1]
    assert isinstance(unasked, Status)
    assert (unasked.state, unasked.fault) == (State.FAULT, Fault.UNDERRUN)
    assert unasked.ledger.position_usteps == Schedule.of(motion).positions()
    assert unasked.ledger.executed_segments == segments
    assert len(board.rises(0)) == 20 * segments
    status = board.recover()
    assert (status.state, status.fault) == (State.READY, Fault.NONE)
    assert status.ledger == unasked.ledger


def test_segments_that_come_just_before_the_end_are_in_time(board: Board) -> None:
    motion = end_motion([segment_of(60_000, run_of(20))] * 2)
    board.ask(Segments(0, 0, 0, motion[:1]))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 10_000)
    board.send(Segments(0, 0, 0, motion[1:]))
    board.run(160_000)
    assert board.ask().fault is Fault.NONE
    rises = board.rises(0)
    assert [tick - rises[0] for tick in rises] == [tick - 1000 for tick, _ in Schedule.of(motion).steps[0]]


def test_segments_behind_a_long_rest_are_not_late(board: Board) -> None:
    # The end of the queue is over 2^31 ticks away, which must not be taken for the past.
    rest = segment_of(MAX_SEGMENT_TICKS)
    board.ask(Segments(0, 0, 0, (rest, rest, rest)))
    board.ask(Start(LEAD_TICKS))
    board.run(100_000)
    status = board.ask(Segments(0, 0, 0, (rest,)))
    assert (status.refusal, status.free_bytes) == (
        Result.OK,
        room_after(Segments(0, 0, 0, (rest,) * 3), Segments(0, 0, 0, (rest,))),
    )


def test_segments_that_come_too_late_end_in_an_underrun_at_the_boundary(native_firmware: NativeFirmware) -> None:
    # 2000 ticks before the end there is no time left to prepare more: all that came in time is executed, and no more.
    board = Board(native_firmware)
    board.get_ready()
    motion = [segment_of(180_000, run_of(170))] * 2
    board.ask(Segments(0, 0, 0, tuple(motion[:1])))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 1500)
    while board.rises(0)[-1] - board.rises(0)[0] < 169_000:
        board.run(500)
    board.run(6500)
    board.send(Segments(0, 0, 0, tuple(motion[1:])))
    board.run(200_000)
    status = board.ask()
    assert (status.state, status.fault, status.refusal) == (State.FAULT, Fault.UNDERRUN, Result.WRONG_STATE)
    assert status.ledger.position_usteps == (170, 0)
    assert status.ledger.executed_segments == 1


@settings(max_examples=60, deadline=None)
@given(
    interval=st.integers(LEAST, 3000),
    other=st.integers(LEAST, 3000),
    late_every=st.integers(1, 60),
    lateness=st.integers(0, 8000),
)
def test_late_interrupts_never_give_a_wrong_step(
    native_firmware: NativeFirmware, interval: int, other: int, late_every: int, lateness: int
) -> None:
    # One interrupt in `late_every` starts late: every step comes on its tick, or the first that cannot stops both.
    motion = [
        segment_of(
            30 * interval,
            run_of(29, first=0, interval=interval),
            run_of(29 * interval // other, first=0, interval=other),
        )
    ] * 2
    delays = Delays(late_entry_ticks=60 + lateness, late_every=late_every)
    board = Board(native_firmware, delays=delays)
    board.get_ready()
    status = board.stream(end_motion(motion))
    schedule = Schedule.of(motion)
    rises = [board.rises(joint) for joint in range(JOINTS)]
    begin = rises[0][0] - schedule.steps[0][0][0]
    for joint in range(JOINTS):
        scheduled = [begin + tick for tick, _ in schedule.steps[joint]]
        assert rises[joint] == scheduled[: len(rises[joint])]
    assert status.ledger.position_usteps == (len(rises[0]), len(rises[1]))
    executed = Schedule.of(motion[: status.ledger.executed_segments])
    assert all(len(rises[joint]) >= len(executed.steps[joint]) for joint in range(JOINTS))
    if status.fault is Fault.NONE:
        assert rises == [[begin + tick for tick, _ in joint] for joint in schedule.steps]
    else:
        assert (status.state, status.fault) == (State.FAULT, Fault.MISSED_DEADLINE)


@pytest.mark.parametrize(
    ("lateness", "fault"), [(700, Fault.NONE), (970, Fault.MISSED_DEADLINE), (2500, Fault.MISSED_DEADLINE)]
)
def test_an_interrupt_later_than_the_next_step_is_noticed(
    native_firmware: NativeFirmware, lateness: int, fault: Fault
) -> None:
    # 970: the next step's tick is still to come, but the pin would be low for less than the least low time.
    delays = Delays(late_entry_ticks=lateness, late_every=7)
    board = Board(native_firmware, delays=delays)
    board.get_ready()
    status = board.stream(end_motion([segment_of(30_000, run_of(20, interval=1000))]))
    assert status.fault is fault
    assert len(board.rises(0)) == (20 if fault is Fault.NONE else 7)
    assert status.ledger.position_usteps == (len(board.rises(0)), 0)


def test_main_program_too_slow_for_the_segments(native_firmware: NativeFirmware) -> None:
    # Runs of one step every 900 ticks, with a main program that takes 2000 a pass: it cannot prepare them in time.
    motion = [segment_of(900, run_of(1, first=10))] * 24
    board = Board(native_firmware, delays=Delays(pass_ticks=2000))
    board.get_ready()
    for segment in end_motion(motion):
        board.send(Segments(0, 0, 0, (segment,)))
        board.run(20_000)
    board.send(Start(LEAD_TICKS))
    board.run(100_000)
    status = board.ask()
    assert (status.state, status.fault) == (State.FAULT, Fault.MISSED_DEADLINE)
    rises = board.rises(0)
    assert [tick - rises[0] for tick in rises] == [900 * i for i in range(len(rises))]
    assert status.ledger.position_usteps == (len(rises), 0)


def test_motion_after_a_fault_is_exact(board: Board) -> None:
    board.ask(Segments(0, 0, 0, (segment_of(30_000, run_of(20), run_of(5, positive=False)),)))
    board.send(Start(LEAD_TICKS))
    board.run(100_000)
    before = board.recover().ledger
    board.edges.clear()
    motion = end_motion([segment_of(40_000, run_of(20, positive=False), run_of(30))])
    status = board.stream(motion)
    rises = board.rises(1)
    assert [tick - rises[0] for tick in rises] == [tick - 1000 for tick, _ in Schedule.of(motion).steps[1]]
    assert status.ledger.position_usteps == (before.position_usteps[0] - 20, before.position_usteps[1] + 30)


class TestHostileStream:
    """Nothing but a whole, sound, expected frame moves STEP or DIR, and the next good frame is answered."""

    @staticmethod
    def frames() -> list[bytes]:
        seg = Segments(0, 0, 0, (segment_of(20_000, run_of(9, positive=True), run_of(9)),))
        return [encode_frame(seq, *encode(m)) for seq, m in enumerate((Query(), seg, Start(LEAD_TICKS), Hello(1, 7)))]

    @staticmethod
    def feed(board: Board, data: bytes) -> None:
        for at in range(0, len(data), 100):
            board.receive(data[at : at + 100])
            board.run(60_000)

    @settings(max_examples=100, deadline=None)
    @given(st.lists(st.binary(max_size=200), min_size=1, max_size=5))
    def test_random_bytes(self, native_firmware: NativeFirmware, chunks: list[bytes]) -> None:
        board = Board(native_firmware)
        board.get_ready()
        self.feed(board, bytes([DELIMITER]).join(chunks))
        board.receive(bytes([DELIMITER]))
        board.run(60_000)
        assert board.motion_edges() == []
        assert board.hello(nonce=9).host_nonce == 9

    @settings(max_examples=200, deadline=None)
    @given(st.data())
    def test_bits_flipped_and_ends_cut(self, native_firmware: NativeFirmware, data: st.DataObject) -> None:
        board = Board(native_firmware)
        board.get_ready()
        board.send(Segments(0, 0, 0, (replace_last(segment_of(30_000, run_of(3))),)))
        board.run(60_000)
        start = bytearray(encode_frame(board.seq, *encode(Start(LEAD_TICKS))))
        frames = [*self.frames(), bytes(start)]
        damaged = bytearray()
        for frame in data.draw(st.lists(st.sampled_from(frames), min_size=1, max_size=6)):
            body = bytearray(frame[:-1])
            if data.draw(st.booleans()):
                del body[data.draw(st.integers(0, len(body) - 1)) :]
            else:
                for bit in data.draw(st.sets(st.integers(0, 8 * len(body) - 1), min_size=1, max_size=3)):
                    body[bit // 8] ^= 1 << bit % 8
            damaged += body + bytes([DELIMITER])
        self.feed(board, bytes(damaged))
        assert board.motion_edges() == []
        board.receive(bytes([DELIMITER]))
        assert board.hello(nonce=3).host_nonce == 3

    def test_the_answer_tells_the_latched_fault(self, board: Board) -> None:
        board.ask(Segments(0, 0, 0, (BAD["no duration"],)))
        self.feed(board, bytes(range(256)) * 3 + bytes([DELIMITER]))
        status = board.ask()
        assert (status.state, status.fault) == (State.FAULT, Fault.BAD_SEGMENT)
        assert status.crc_errors > 0


def replace_last(segment: Segment) -> Segment:
    """The segment, marked as its motion's last."""
    return replace(segment, duration_flags=segment.duration_flags | 1)


def test_a_fault_in_motion_counts_the_segments_that_its_steps_are_of(emulated_firmware: EmulatedFirmware) -> None:
    # A pass may last longer than a step: what ended since it began is executed, too.
    steps, interval = 40, 400
    duration = steps * interval
    board = Board(emulated_firmware)
    board.get_ready()
    segment = segment_of(duration, run_of(steps, first=0, interval=interval))
    for _ in range(8):
        board.ask(Segments(0, 0, 0, (segment,) * 4))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 40_000)
    uno, seq = emulated_firmware.uno, board.seq
    moving = uno.snapshot()
    for phase in range(0, duration, 331):
        uno.restore(moving)
        board.forget_replies()
        board.seq = seq
        board.run(phase)
        board.send(Segments(0, 0, 0, (segment_of(0),)))
        board.run(50_000)
        status = board.ask()
        assert status.fault is Fault.BAD_SEGMENT
        made = status.ledger.position_usteps[0]
        # A segment is executed as soon as the next one's first step has risen, no sooner.
        assert status.ledger.executed_segments == (made - 1) // steps, f"{made} steps, {phase} ticks"


def test_a_fault_counts_a_segment_from_the_tick_on_that_its_steps_end(emulated_firmware: EmulatedFirmware) -> None:
    # The motion begins later and later, so that its steps end all around a segment's end, there at every tick.
    steps, interval = 41, 400
    board = Board(emulated_firmware)
    board.get_ready()
    segment = segment_of(steps * interval, run_of(steps, first=0, interval=interval))
    for _ in range(8):
        board.ask(Segments(0, 0, 0, (segment,) * 4))
    uno, seq = emulated_firmware.uno, board.seq
    queued = uno.snapshot()

    def check_fault_after(later_ticks: int) -> int:
        """Steps that were made when a fault came in a motion that began so much later."""
        uno.restore(queued)
        board.forget_replies()
        board.seq = seq
        board.send(Start(LEAD_TICKS + later_ticks))
        board.run(LEAD_TICKS + 40_000)
        board.send(Segments(0, 0, 0, (segment_of(0),)))
        board.run(20_000)
        status = board.ask()
        made = status.ledger.position_usteps[0]
        assert status.fault is Fault.BAD_SEGMENT
        assert status.ledger.executed_segments == (made - 1) // steps, f"{made} steps, {later_ticks} ticks later"
        return made

    end_ticks = check_fault_after(0) % steps * interval
    coarse_ticks = 20
    begins = range(end_ticks - 3_000, end_ticks + 3_000, coarse_ticks)
    parts = [check_fault_after(later_ticks) % steps for later_ticks in begins]
    ends = [at for at, pair in zip(begins, itertools.pairwise(parts), strict=False) if pair in {(0, 1), (1, 0)}]
    assert ends
    for at in ends:
        for later_ticks in range(at, at + coarse_ticks):
            check_fault_after(later_ticks)


@pytest.mark.parametrize("quick", [0, 1])
def test_a_stop_counts_a_segment_whose_end_is_just_past(emulated_firmware: EmulatedFirmware, quick: int) -> None:
    # Slower than the start-stop speed a stop ends the motion at once, wherever it is: here around a segment's end.
    duration = 170_000
    board = Board(emulated_firmware)
    board.get_ready()
    segment = segment_of(duration, run_of(1, first=0))
    board.ask(Segments(0, 0, 0, (segment,) * 6))
    uno, seq = emulated_firmware.uno, board.seq
    queued = uno.snapshot()
    seen = set()
    for later_ticks in range(0, 6_000, 20):
        uno.restore(queued)
        board.forget_replies()
        board.seq = seq
        board.send(Start(LEAD_TICKS + later_ticks))
        board.run(LEAD_TICKS + 2 * duration)
        board.send(Stop(quick))
        board.run(20_000)
        status = board.ask()
        made = status.ledger.position_usteps[0]
        assert status.state is State.READY
        assert status.ledger.executed_segments == made - 1, f"{made} steps, {later_ticks} ticks later"
        seen.add(made)
    assert seen == {2, 3}
