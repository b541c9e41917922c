"""Holds of fast joints: the released images slow down, rest and go on, at every moment and with a busy line.

A slice that is slowed down takes the main program several times as long as one that is made as planned. The rates here
are no lower than those that the certificate lets pass (`planarm_wire.board_budget`, SLOWED_TICKS): what is faster is
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
    LINE_PASS_TICKS,
    READ_SLOWED_JOINT_TICKS,
    READ_SLOWED_TICKS,
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
    MIN_LEAD_TICKS,
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
SEGMENT_TICKS = 4 * SLICE_TICKS
QUEUED = {2: 20, 4: 11}
MORE_QUEUED = {2: 30, 4: 15}
GENTLE, SHORT, QUICK = 140, 150, 175  # codes of the rates that the segments allow


def allowed_interval(name: str, segment_ticks: int) -> int:
    """The least interval, of all joints alike, that the certificate lets pass with segments of one length."""
    joints = BOARDS[name].joints
    slices = -(-segment_ticks // SLICE_TICKS)
    each = SLOWED_TICKS + SLOWED_JOINT_TICKS * joints
    whole = slices * each + READ_SLOWED_TICKS + READ_SLOWED_JOINT_TICKS * joints
    share = max(each / (MIN_LEAD_TICKS - LINE_PASS_TICKS), whole / segment_ticks)
    return max(round(1.01 * sum(STEP_INTERRUPT_TICKS[name]) / (1 - share - LINE_LOAD)), BOARDS[name].min_interval_ticks)


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


@pytest.mark.parametrize(
    ("line", "segment_ticks", "code"),
    [
        ("silent", SEGMENT_TICKS, GENTLE),
        ("queries", SEGMENT_TICKS, GENTLE),
        ("queries", SEGMENT_TICKS, QUICK),
        ("segments", SEGMENT_TICKS, GENTLE),
        ("segments", SEGMENT_TICKS, QUICK),
        ("silent", 115_000, SHORT),  # three slices, of which two are half as long
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
    status = held.board.ask()
    assert (status.fault, status.override_percent) == (Fault.NONE, percent)
    assert status.rate_percent <= percent


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
