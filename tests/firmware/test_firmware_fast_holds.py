"""Holds of fast joints: the released images slow down, rest and go on, at every moment and with a busy line.

A slice that is slowed down takes the main program several times as long as one that is made as planned. The rates here
are no lower than those that the certificate lets pass (`planarm_wire.board_budget`, SLOWED_TICKS): what is faster is
refused, since a hold in it could end in a missed step, a dead stop at full speed.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from firmware_board import LEAD_TICKS, WAKE_TICKS, Board, EmulatedFirmware, end_motion, run_of, segment_of
from firmware_motions import steady
from planarm_wire.board_budget import (
    LINE_PASS_TICKS,
    PREPARED_SLICES,
    READ_SLOWED_JOINT_TICKS,
    READ_SLOWED_TICKS,
    SLOWED_ANEW_TICKS,
    SLOWED_JOINT_TICKS,
    SLOWED_SPARE_TICKS,
    SLOWED_TICKS,
    STEP_INTERRUPT_TICKS,
    UNSEEN_SLICES,
    WAITING_LINE_LOAD,
)
from planarm_wire.codec import encode
from planarm_wire.framing import encode_frame
from planarm_wire.messages import (
    BAUD,
    BOARDS,
    DELIMITER,
    HOLD_CODE,
    HOST_WINDOW_BYTES,
    MIN_LEAD_TICKS,
    SLICE_TICKS,
    TICKS_HZ,
    Config,
    Enable,
    Fault,
    Override,
    PinMap,
    Query,
    Resume,
    Segment,
    Segments,
    Start,
    State,
)

RELEASE = Path(__file__).parents[2] / "firmware" / "release"
SEGMENT_TICKS = 4 * SLICE_TICKS
BYTE_TICKS = 10 * TICKS_HZ // BAUD
QUEUED = {2: 20, 4: 11}
MORE_QUEUED = {2: 30, 4: 15}
GENTLE, SHORT, QUICK = 140, 150, 175  # codes of the rates that the segments allow


def is_ready_in_time(name: str, segment_ticks: int, interval: int) -> bool:
    """Whether the board has time to slow down all joints, each at one interval, slice by slice (check C36)."""
    joints = BOARDS[name].joints
    left, lengths = segment_ticks, []
    while left:
        lengths.append(left if left <= SLICE_TICKS else min(SLICE_TICKS, (left + 1) // 2))
        left -= lengths[-1]
    share = 1 - WAITING_LINE_LOAD - sum(STEP_INTERRUPT_TICKS[name]) / interval
    starts, ready = [0.0], -float("inf")
    for k in range(60 * len(lengths)):
        slice_ticks, before = lengths[k % len(lengths)], lengths[(k - 1) % len(lengths)]
        work = SLOWED_TICKS + joints * (SLOWED_JOINT_TICKS + (SLOWED_ANEW_TICKS if k and slice_ticks != before else 0))
        work += (READ_SLOWED_TICKS + joints * READ_SLOWED_JOINT_TICKS) / len(lengths)
        if (k + 1) % len(lengths):
            work += LINE_PASS_TICKS / UNSEEN_SLICES
        room = starts[-PREPARED_SLICES] if len(starts) >= PREPARED_SLICES else -MIN_LEAD_TICKS
        ready = max(ready, starts[-1] - MIN_LEAD_TICKS, room) + work / share
        if starts[-1] - ready < SLOWED_SPARE_TICKS:
            return False
        starts.append(starts[-1] + slice_ticks)
    return True


def allowed_interval(name: str, segment_ticks: int) -> int:
    """The least interval, of all joints alike, that the certificate lets pass with segments of one length."""
    intervals = range(BOARDS[name].min_interval_ticks, 20_000)
    return intervals[bisect_left(intervals, 1, key=lambda interval: is_ready_in_time(name, segment_ticks, interval))]


class Held:
    """A board in the middle of a fast motion, with its line silent or full, put back there for every moment."""

    def __init__(
        self, name: str, segments: list[Segment], code: int, line: str, start_stop_ticks: int = 0, need: int = 0
    ) -> None:
        self.firmware = EmulatedFirmware(RELEASE / f"{name}.hex", BOARDS[name])
        self.board = Board(self.firmware)
        self.board.hello()
        if start_stop_ticks:
            joints = BOARDS[name].joints
            pins = PinMap[BOARDS[name].pin_map.upper()]
            self.board.ask(Config(pins, joints, 0, 0, 0, 0, 0, (start_stop_ticks,) * joints))
        self.board.ask(Enable(1))
        self.board.run(WAKE_TICKS)
        for segment in segments:
            self.board.ask(Segments(code, code, need, (segment,)))
        self.board.ask(Start(LEAD_TICKS))
        repeated = Query() if line == "queries" else Segments(code, code, 0, (segments[0],))
        self.filling = b"" if line == "silent" else encode_frame(self.board.seq - 1, *encode(repeated))
        self.pump(300_000)
        self.seq, self.edges = self.board.seq, list(self.board.edges)
        self.moving = self.firmware.uno.snapshot()

    def pump(self, ticks: int) -> None:
        """Run with the host's window full of frames, all of them the same; what the board says is not read."""
        uno, end = self.firmware.uno, self.board.now + ticks
        while self.board.now < end:
            while self.filling and uno.serial.pending + len(self.filling) <= HOST_WINDOW_BYTES:
                uno.serial.write(self.filling)
            uno.run(cycles=min(4000, end - self.board.now))
        uno.serial.read()
        self.board.edges.extend(self.firmware.take_edges())

    def back(self, later_ticks: int) -> None:
        """To the middle of the motion, and so much further."""
        self.firmware.uno.restore(self.moving)
        self.firmware.take_edges()
        self.board.edges[:] = self.edges
        self.board.seq = self.seq
        self.pump(later_ticks)

    def quiet(self) -> None:
        """Let the line become silent; a frame that was cut off ends."""
        serial, (self.filling, filling) = self.firmware.uno.serial, (b"", self.filling)
        self.pump(200_000)
        serial.write(bytes([DELIMITER]))
        self.pump(50_000)
        for _ in range(20):
            self.firmware.uno.run(cycles=400_000)  # the board may look at its line every fourth slice only
            if not serial.read():
                break
        self.filling = filling
        self.board.edges.extend(self.firmware.take_edges())
        self.board.forget_replies()


@pytest.mark.parametrize(
    ("line", "segment_ticks", "code"),
    [
        ("silent", SEGMENT_TICKS, GENTLE),
        ("queries", SEGMENT_TICKS, GENTLE),
        ("queries", SEGMENT_TICKS, QUICK),
        ("segments", SEGMENT_TICKS, GENTLE),
        ("segments", SEGMENT_TICKS, QUICK),
        ("queries", 115_000, SHORT),  # three slices, of which two are half as long
        ("segments", 115_000, SHORT),
    ],
)
@pytest.mark.parametrize("name", BOARDS)
def test_fast_joints_are_held_and_go_on(
    name: str, line: str, segment_ticks: int, code: int, sized: Callable[[int, int], int]
) -> None:
    joints = BOARDS[name].joints
    count = QUEUED[joints] if segment_ticks == SEGMENT_TICKS else MORE_QUEUED[joints]
    queued = count * segment_ticks
    segments = steady(name, allowed_interval(name, segment_ticks), queued / TICKS_HZ, segment_ticks)
    held = Held(name, segments, code, line)
    board, moments = held.board, sized(3, 15)
    for moment in range(moments):
        held.back(moment * SLICE_TICKS // moments)
        board.receive(bytes([HOLD_CODE]))
        held.pump(1_000_000)
        held.quiet()
        status = board.ask()
        assert status.fault is Fault.NONE, moment
        board.run(8_000_000)
        assert board.ask().state is State.HELD, moment
        board.ask(Resume())
        board.run(2 * queued + 16_000_000)
        status = board.ask()
        assert (status.state, status.fault) == (State.READY, Fault.NONE), moment
        made = tuple(len(board.rises(joint)) for joint in range(joints))
        assert status.ledger.position_usteps[:joints] == made, moment
        assert made == tuple(
            sum(segment.moves[joint].steps_dir >> 1 for segment in segments) for joint in range(joints)
        )


@pytest.mark.parametrize("code", [60, 100])
@pytest.mark.parametrize("line", ["queries", "segments"])
@pytest.mark.parametrize("name", BOARDS)
def test_fast_joints_slow_down_for_long_on_a_busy_line(
    name: str, line: str, code: int, sized: Callable[[int, int], int]
) -> None:
    """By rates so gentle that time stays short, as long as the queue lasts."""
    queued = QUEUED[BOARDS[name].joints] * SEGMENT_TICKS
    interval = allowed_interval(name, SEGMENT_TICKS)
    held = Held(name, steady(name, interval, queued / TICKS_HZ, SEGMENT_TICKS), code, line)
    moments = sized(2, 15)
    for moment in range(moments):
        held.back(moment * SLICE_TICKS // moments)
        held.board.receive(bytes([HOLD_CODE]))
        held.pump(queued - 1_000_000)
        held.quiet()
        held.board.run(4_000_000)  # the line waits, too: an answer may come late
        assert held.board.ask().fault is Fault.NONE, moment


@pytest.mark.parametrize("percent", [99, 60])
@pytest.mark.parametrize("name", BOARDS)
def test_fast_joints_take_an_override_on_a_busy_line(name: str, percent: int) -> None:
    queued = QUEUED[BOARDS[name].joints] * SEGMENT_TICKS
    held = Held(
        name, steady(name, allowed_interval(name, SEGMENT_TICKS), queued / TICKS_HZ, SEGMENT_TICKS), GENTLE, "queries"
    )
    held.back(20_000)
    held.quiet()  # a full line may cost the frame
    held.board.send(Override(percent))
    held.board.run(20_000)
    held.pump(1_200_000)
    held.quiet()
    status = held.board.ask_now()  # the line waits, too
    assert (status.fault, status.override_percent) == (Fault.NONE, percent)
    assert status.rate_percent <= percent


@pytest.mark.parametrize("name", ["uno", "uno_four"])
def test_fast_joints_rest_when_the_queue_runs_low_on_a_busy_line(name: str, sized: Callable[[int, int], int]) -> None:
    """What the line is full of are queries: nothing comes to go on with."""
    queued = QUEUED[BOARDS[name].joints] * SEGMENT_TICKS
    segments = steady(name, allowed_interval(name, SEGMENT_TICKS), queued / TICKS_HZ, SEGMENT_TICKS)[:-1]
    need = 40  # 82 ms: a rest takes that long at these rates
    held = Held(name, segments, 130, "queries", need=need)
    moments = sized(4, 24)
    for moment in range(moments):
        held.back(0)
        held.filling, filling = b"", held.filling
        held.pump(1 + moment * 40_000 // moments)  # another phase of the line
        held.filling = filling
        held.pump(3 * queued)
        held.quiet()
        status = held.board.ask()
        assert (status.state, status.fault) == (State.STARVED, Fault.NONE), moment
        assert status.rate_percent == 0


@pytest.mark.parametrize(("name", "interval"), [("uno_slow", 1_500), ("cnc_shield", 1_500), ("uno_four", 3_500)])
def test_joints_that_may_stop_dead_do_so_within_a_millisecond(
    name: str, interval: int, sized: Callable[[int, int], int]
) -> None:
    """Where some joint's step is mostly near and the line is full, too: a rest is tried until none is."""
    queued = QUEUED[BOARDS[name].joints] * SEGMENT_TICKS
    segments = steady(name, interval, queued / TICKS_HZ, SEGMENT_TICKS)
    held = Held(name, segments, GENTLE, "queries", interval * 9 // 10)
    moments = sized(20, 60)
    for moment in range(moments):
        held.back(moment * SLICE_TICKS // moments)
        serial = held.firmware.uno.serial
        came = held.board.now + (serial.pending + 1) * BYTE_TICKS
        serial.write(bytes([HOLD_CODE]))
        held.pump(came - held.board.now + 150_000)
        assert max(held.board.rises(0)) - came < TICKS_HZ // 1000, moment
        held.quiet()
        assert held.board.ask().state is State.HELD, moment


@pytest.mark.parametrize("segment_ticks", [14_000, 16_000, 20_000, 24_000])
def test_short_segments_are_held_in_time(segment_ticks: int) -> None:
    """Four of them are less than what a slice is prepared ahead elsewhere: none of their slices is late for that."""
    interval, start_stop_ticks, count = 2_000, 4_000, 30
    move = run_of(segment_ticks // interval, first=100, interval=interval)
    board = Board(EmulatedFirmware(RELEASE / "uno.hex", BOARDS["uno"]))
    board.hello()
    board.ask(Config(PinMap.OWN, 2, 0, 0, 0, 0, 0, (start_stop_ticks,) * 2))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    segments = end_motion([segment_of(segment_ticks, move, move)] * count)
    for segment in segments:
        board.ask(Segments(QUICK, QUICK, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 20_000)
    held = board.now
    board.receive(bytes([HOLD_CODE]))
    board.run(2_000_000)
    assert board.ask().state is State.HELD
    first = next(after for rise, after in pairwise(board.rises(0)) if after - rise > interval)
    assert first - held < segment_ticks + 4 * TICKS_HZ // 1000


def test_joints_of_one_speed_rest_at_any_moment_where_they_may_not_stop_until_they_are_slow() -> None:
    # Both step at 22,000 ticks before they may: runs of one step each, which the main program hands over one by one.
    move = run_of(SEGMENT_TICKS // 320 - 1, first=100, interval=320)
    held = Held("uno", end_motion([segment_of(SEGMENT_TICKS, move, move)] * QUEUED[2]), QUICK, "silent")
    board = held.board
    for moment in range(40):
        held.back(moment * 5700)
        board.receive(bytes([HOLD_CODE]))
        board.run(20_000_000)
        assert board.ask_now().state is State.HELD, moment
        board.send(Resume())
        board.run(4_000_000)
        assert board.ask_now().fault is Fault.NONE, moment
