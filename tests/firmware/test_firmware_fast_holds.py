"""Holds of fast joints: the released images slow down, rest and go on, at every moment and with a busy line.

A slice that is slowed down takes the main program several times as long as one that is made as planned. The rates here
are those that the certificate still lets pass (`planarm_wire.board_budget`, MOST_SLOWED_TICKS): what is faster is
refused, since a hold in it could end in a missed step, a dead stop at full speed.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_board import LEAD_TICKS, Board, EmulatedFirmware, end_motion, run_of, segment_of
from firmware_motions import steady
from planarm_wire.board_budget import (
    LINE_LOAD,
    MOST_SLOWED_TICKS,
    SLOWED_JOINT_TICKS,
    SLOWED_TICKS,
    STEP_INTERRUPT_TICKS,
)
from planarm_wire.codec import encode
from planarm_wire.framing import encode_frame
from planarm_wire.messages import (
    BOARDS,
    DELIMITER,
    HOLD_CODE,
    HOST_WINDOW_BYTES,
    SLICE_TICKS,
    TICKS_HZ,
    Fault,
    Override,
    Query,
    Resume,
    Segment,
    Segments,
    Start,
    State,
)

RELEASE = Path(__file__).parents[2] / "firmware" / "release"
INTERVALS = {"uno": 265, "uno_slow": 450, "cnc_shield": 320, "uno_four": 1600, "cnc_shield_four": 1600}
SEGMENT_TICKS = 4 * SLICE_TICKS
QUEUED = {2: 20, 4: 11}
GENTLE, QUICK = 140, 175  # codes of the rates that the segments allow


def allowed_interval(name: str) -> float:
    """The least interval, of all joints alike, that the certificate lets pass."""
    share = 1.0 - (SLOWED_TICKS + SLOWED_JOINT_TICKS * BOARDS[name].joints) / MOST_SLOWED_TICKS
    return sum(STEP_INTERRUPT_TICKS[name]) / (share - LINE_LOAD)


@pytest.mark.parametrize("name", INTERVALS)
def test_the_rates_here_are_those_that_the_certificate_allows(name: str) -> None:
    allowed = max(allowed_interval(name), BOARDS[name].min_interval_ticks)
    assert 0.95 * allowed <= INTERVALS[name] <= 1.05 * allowed


class Held:
    """A board in the middle of a fast motion, with its line silent or full, put back there for every moment."""

    def __init__(self, name: str, segments: list[Segment], code: int, line: str) -> None:
        self.firmware = EmulatedFirmware(RELEASE / f"{name}.hex", BOARDS[name])
        self.board = Board(self.firmware)
        self.board.get_ready()
        for segment in segments:
            self.board.ask(Segments(code, code, 0, (segment,)))
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
        for _ in range(100):
            self.firmware.uno.run(cycles=50_000)
            if not serial.read():
                break
        self.filling = filling
        self.board.edges.extend(self.firmware.take_edges())
        self.board.forget_replies()


@pytest.mark.parametrize("line", ["silent", "queries", "segments"])
@pytest.mark.parametrize("code", [GENTLE, QUICK], ids=["gentle", "quick"])
@pytest.mark.parametrize("name", INTERVALS)
def test_fast_joints_are_held_and_go_on(name: str, code: int, line: str, sized: Callable[[int, int], int]) -> None:
    joints = BOARDS[name].joints
    queued = QUEUED[joints] * SEGMENT_TICKS
    segments = steady(name, INTERVALS[name], queued / TICKS_HZ, SEGMENT_TICKS)
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


@pytest.mark.parametrize("percent", [99, 60])
@pytest.mark.parametrize("name", INTERVALS)
def test_fast_joints_take_an_override_on_a_busy_line(name: str, percent: int) -> None:
    queued = QUEUED[BOARDS[name].joints] * SEGMENT_TICKS
    held = Held(name, steady(name, INTERVALS[name], queued / TICKS_HZ, SEGMENT_TICKS), GENTLE, "queries")
    held.back(20_000)
    held.board.send(Override(percent))
    held.pump(1_500_000)
    held.quiet()
    assert held.board.ask().fault is Fault.NONE


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
