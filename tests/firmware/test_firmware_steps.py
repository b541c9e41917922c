"""Every step comes on its tick: the pins of the core, on a simulated Timer1, against the closed form of the wire."""

from __future__ import annotations

import bisect
import itertools
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_board import (
    LEAD_TICKS,
    REST,
    Board,
    Delays,
    Firmware,
    NativeFirmware,
    Schedule,
    end_motion,
    run_of,
    segment_of,
)
from planarm_wire.messages import (
    DIR_PINS,
    JOINTS,
    MAX_COARSE_STEPS,
    MAX_SEGMENT_TICKS,
    MIN_DIR_SETUP_TICKS,
    MIN_INTERVAL_TICKS,
    MIN_SLOW_INTERVAL_TICKS,
    MIN_STEP_HIGH_TICKS,
    MIN_STEP_LOW_TICKS,
    SLOW_INTERVAL_TICKS,
    STEP_PINS,
    Fault,
    Move,
    Query,
    Segment,
    Segments,
    Start,
    State,
    Status,
)
from planarm_wire.steps import step_ticks

MIN_REVERSAL_TICKS = MIN_INTERVAL_TICKS + MIN_DIR_SETUP_TICKS
LONGEST_SLOW_TICKS = 300_000  # of the moves here
SHORTEST_SEGMENT_TICKS = 6000  # what the simulated main program, at 600 ticks a pass, prepares in time with ease


@st.composite
def moves(draw: st.DrawFn, rest_ticks: int, was_positive: bool) -> Move:
    """A move that keeps all limits after a rest that followed a step in the direction told."""
    steps = draw(st.one_of(st.just(0), st.just(1), st.integers(2, 40), st.integers(126, 131)))
    if steps == 0:
        return REST
    positive = draw(st.booleans())
    least = MIN_INTERVAL_TICKS if positive is was_positive else MIN_REVERSAL_TICKS
    first = max(0, least - rest_ticks) + draw(st.one_of(st.just(0), st.integers(0, 3000), st.integers(0, 200_000)))
    if steps == 1:
        return Move(2 + positive, first)
    if steps <= MAX_COARSE_STEPS and draw(st.integers(0, 3)) == 0:
        least, most = MIN_SLOW_INTERVAL_TICKS << 8, LONGEST_SLOW_TICKS << 8
        interval = draw(st.integers(SLOW_INTERVAL_TICKS << 8, most))
    else:
        least, most = MIN_INTERVAL_TICKS << 8, (SLOW_INTERVAL_TICKS << 8) - 1
        interval = draw(st.one_of(st.integers(least, least << 2), st.integers(least, most)))
    unit = 1 if steps <= MAX_COARSE_STEPS else 256
    room = (unit * (least - interval), unit * (most - interval)) if steps > 2 else (-(2**31), 2**31 - 1)
    share = max(steps - 2, 1)
    add = draw(st.integers(-(-room[0] // share), room[1] // share))
    bits = 31 if steps > MAX_COARSE_STEPS or interval >= SLOW_INTERVAL_TICKS << 8 else 23
    return Move(2 * steps + positive, first, interval, max(-(2**bits), min(add, 2**bits - 1)))


@st.composite
def motions(draw: st.DrawFn) -> list[Segment]:
    """A few segments that keep all limits, boundaries included."""
    rests = [10**9] * JOINTS
    turned = [False] * JOINTS
    segments = []
    for _ in range(draw(st.integers(1, 8))):
        joints = [draw(moves(*before)) for before in zip(rests, turned, strict=True)]
        last = [step_ticks(move)[-1] if move.steps_dir > 1 else -1 for move in joints]
        duration = max(SHORTEST_SEGMENT_TICKS, max(last) + 1 + draw(st.integers(0, 2000)))
        rests = [duration - tick if tick >= 0 else rest + duration for tick, rest in zip(last, rests, strict=True)]
        turned = [
            bool(move.steps_dir & 1) if move.steps_dir > 1 else was for move, was in zip(joints, turned, strict=True)
        ]
        segments.append(segment_of(duration, *joints))
    return end_motion(segments)


def assert_on_schedule(
    board: Board, segments: Sequence[Segment], status: Status, before: Sequence[int] = (0, 0)
) -> int:
    """Check every edge of a finished motion; return the tick at which it began."""
    assert (status.state, status.fault) == (State.READY, Fault.NONE)
    schedule = Schedule.of(segments)
    begin = None
    for joint, expected in enumerate(schedule.steps):
        rises = board.rises(joint)
        assert len(rises) == len(expected)
        if not expected:
            continue
        begin = rises[0] - expected[0][0] if begin is None else begin
        assert rises == [begin + tick for tick, _ in expected]
        for tick, sign in expected:
            assert board.position_at(joint, begin + tick) - board.position_at(joint, begin + tick - 1) == sign
        assert_pulse_times(board, joint)
    assert status.ledger.position_usteps == tuple(b + p for b, p in zip(before, schedule.positions(), strict=True))
    return 0 if begin is None else begin


def assert_pulse_times(board: Board, joint: int) -> None:
    """The driver's timing rules: high, low, and DIR before the rise."""
    edges = [edge for edge in board.edges if edge.pin == STEP_PINS[joint]]
    assert [edge.level for edge in edges] == [1, 0] * (len(edges) // 2)
    for earlier, later in itertools.pairwise(edges):
        assert later.tick - earlier.tick >= (MIN_STEP_HIGH_TICKS if earlier.level else MIN_STEP_LOW_TICKS)
    rises = board.rises(joint)
    falls = [edge.tick for edge in edges if not edge.level]
    for turn in (edge.tick for edge in board.edges if edge.pin == DIR_PINS[joint]):
        following = bisect.bisect_right(rises, turn)
        if following < len(rises):
            assert rises[following] - turn >= MIN_DIR_SETUP_TICKS
        if following:
            assert falls[following - 1] <= turn  # never while STEP is high


@settings(max_examples=60, deadline=None)
@given(motions(), st.integers(0, 2**32 - 1), st.integers(300, 900), st.integers(MIN_STEP_HIGH_TICKS, 64))
def test_every_step_is_on_its_tick(
    native_firmware: NativeFirmware, motion: list[Segment], tick: int, pass_ticks: int, entry_ticks: int
) -> None:
    board = Board(native_firmware, tick=tick, delays=Delays(pass_ticks=pass_ticks, entry_ticks=entry_ticks))
    board.get_ready()
    sent_at = board.now
    status = board.stream(motion)
    begin = assert_on_schedule(board, motion, status)
    if begin:
        assert begin >= sent_at + LEAD_TICKS
    assert status.ledger.executed_segments == len(motion)


@pytest.mark.parametrize("name", ["up", "down"])
def test_ramp_with_fractions(firmware: Firmware, name: str) -> None:
    # A change of an eighth of a tick a step: the fraction must be carried over 1000 steps.
    add = 8192 if name == "up" else -8192
    interval = (1000 << 8) + 48 if name == "up" else (1200 << 8) + 48
    move = Move(2 * 1000 + 1, 77, interval, add)
    motion = [segment_of(step_ticks(move)[-1] + 1, move, run_of(20, interval=50_000), last=True)]
    board = Board(firmware)
    board.get_ready()
    assert_on_schedule(board, motion, board.stream(motion))


@pytest.mark.parametrize("gap", [59_999, 60_000, 60_001, 65_535, 65_536, 65_537, 131_072, 1_000_000, 40_000_000])
def test_gap_between_runs(firmware: Firmware, gap: int) -> None:
    # Around the reach of the 16-bit timer the joint goes idle and is started again.
    first = segment_of(4 * 1000 + 1, run_of(4, interval=1000))
    second = segment_of(gap + 10_000, run_of(3, first=gap - 1, interval=900, positive=False))
    motion = end_motion([first, second])
    board = Board(firmware)
    board.get_ready()
    status = board.stream(motion, slice_ticks=20_000)
    assert_on_schedule(board, motion, status)
    rises = board.rises(0)
    assert rises[4] - rises[3] == gap


def test_reversal_at_the_least_interval(firmware: Firmware) -> None:
    there_and_back = [
        segment_of(
            199 * MIN_INTERVAL_TICKS + MIN_REVERSAL_TICKS,
            *[run_of(200, first=0, interval=MIN_INTERVAL_TICKS, positive=i % 2 == 0)] * 2,
        )
        for i in range(12)
    ]
    motion = end_motion(there_and_back)
    board = Board(firmware)
    board.get_ready()
    assert_on_schedule(board, motion, board.stream(motion, slice_ticks=40_000))


def test_two_motions_add_up(firmware: Firmware) -> None:
    motion = end_motion([segment_of(30_000, run_of(10), run_of(5, positive=False))])
    board = Board(firmware)
    board.get_ready()
    first = board.stream(motion)
    board.edges = [edge for edge in board.edges if edge.pin in DIR_PINS]
    assert_on_schedule(board, motion, board.stream(motion), before=first.ledger.position_usteps)


def test_motion_longer_than_the_clock(native_firmware: NativeFirmware) -> None:
    # 5 minutes of longest segments: the 32-bit clock goes round, and far starts must not be taken for past ones.
    longest = segment_of(MAX_SEGMENT_TICKS, run_of(2, first=1000), run_of(1, first=MAX_SEGMENT_TICKS - 1))
    motion = end_motion([longest] * 5)
    board = Board(native_firmware, delays=Delays(pass_ticks=20_000))
    board.get_ready()
    status = board.stream(motion, lead_ticks=MAX_SEGMENT_TICKS, slice_ticks=100_000_000)
    assert_on_schedule(board, motion, status)


def test_clock_wraps_inside_a_motion(native_firmware: NativeFirmware) -> None:
    motion = end_motion([segment_of(100_000, run_of(90), run_of(50, interval=1900))] * 4)
    board = Board(native_firmware, tick=2**32 - 500_000)
    board.get_ready()
    status = board.stream(motion)
    assert_on_schedule(board, motion, status)
    assert status.mcu_ticks < 2**31  # it has wrapped


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 9000), min_size=20, max_size=40), st.integers(300, 2000))
def test_ledger_is_exact_at_any_instant(native_firmware: NativeFirmware, waits: list[int], pass_ticks: int) -> None:
    turns = [
        segment_of(
            9000, run_of(9, interval=810 + i, positive=i % 3 != 0), run_of(4, interval=2000, positive=i % 2 == 0)
        )
        for i in range(24)
    ]
    motion = end_motion(turns)
    ends = Schedule.of(motion).ends
    board = Board(native_firmware, delays=Delays(pass_ticks=pass_ticks))
    board.get_ready()
    for segment in motion:
        board.send(Segments(0, 0, 0, (segment,)))
        board.run(10 * pass_ticks + 8000)
    started_at = board.now
    board.send(Start(LEAD_TICKS))
    board.run(pass_ticks * 8 + 30_000)
    replies = [reply for _, reply in board.replies]
    for wait in waits:
        board.replies.clear()
        board.send(Query())
        board.run(wait)
        replies += [reply for _, reply in board.replies]
    board.run(400_000)
    begin = board.rises(0)[0] - Schedule.of(motion).steps[0][0][0]
    moving = [reply for reply in replies if isinstance(reply, Status) and reply.mcu_ticks > started_at]
    assert moving
    for reply in moving:
        told = reply.ledger
        assert told.position_usteps == tuple(board.position_at(joint, reply.mcu_ticks) for joint in range(JOINTS))
        assert told.executed_segments == sum(begin + end <= reply.mcu_ticks for end in ends)
