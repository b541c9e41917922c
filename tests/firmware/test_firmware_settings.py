"""What CONFIG and SOFT_LIMITS set: levels, drivers that are released and awake, limits, the told position."""

from __future__ import annotations

from dataclasses import replace

import pytest

from firmware_board import (
    LEAD_TICKS,
    REST,
    Board,
    Firmware,
    NativeFirmware,
    end_motion,
    run_of,
    segment_of,
)
from firmware_configured import (
    ACTIVE_HIGH,
    WIRING,
    configured,
)
from planarm_wire.messages import (
    ENABLE_PIN,
    JOINTS,
    Enable,
    Fault,
    Result,
    Segments,
    SetPosition,
    SoftLimits,
    Start,
    State,
)


def test_active_high_enable_and_inverted_dir(native_firmware: NativeFirmware) -> None:
    board = configured(native_firmware, options=ACTIVE_HIGH, dir_inverted=0b01)
    board.edges.clear()
    status = board.stream(end_motion([segment_of(30_000, run_of(5), run_of(5))]))
    assert status.ledger.position_usteps == (5, 5)
    assert [(e.pin, e.level) for e in board.edges if e.pin == "D5"] == [("D5", 1)]
    assert [e for e in board.edges if e.pin == "D4"] == [], "low is the positive direction of joint 1"
    assert board.ask(Enable(0)).state is State.IDLE
    assert [e.level for e in board.edges if e.pin == ENABLE_PIN] == [0]


def test_segments_outside_the_soft_limits_are_a_fault_that_says_which(firmware: Firmware) -> None:
    board = configured(firmware)
    board.ask(SoftLimits((-100, -5), (100, 5)))
    assert board.ask(Segments(0, 0, 0, (segment_of(30_000, run_of(9), run_of(5)),))).fault is Fault.NONE
    assert board.ask(SoftLimits((-9, -9), (9, 9))).refusal is Result.WRONG_STATE, "what is queued kept the others"
    status = board.ask(Segments(0, 0, 0, (segment_of(30_000, run_of(9), run_of(1)),)))
    assert (status.state, status.fault, status.detail) == (State.FAULT, Fault.SOFT_LIMIT, 1)
    assert board.motion_edges() == []


@pytest.mark.parametrize("joint", range(JOINTS))
@pytest.mark.parametrize("sign", [1, -1])
def test_each_side_of_the_soft_limits_is_kept(firmware: Firmware, joint: int, sign: int) -> None:
    # The other side is as far away as can be.
    far = 2**31 - 1
    sides = [[-far, -far], [far, far]]
    sides[sign > 0][joint] = sign * 9
    for steps, fault in ((9, Fault.NONE), (10, Fault.SOFT_LIMIT)):
        board = configured(firmware)
        assert board.ask(SoftLimits(tuple(sides[0]), tuple(sides[1]))).refusal is Result.OK
        moves = [REST, REST]
        moves[joint] = run_of(steps, positive=sign > 0)
        status = board.ask(Segments(0, 0, 0, (segment_of(30_000, *moves),)))
        assert (status.fault, status.detail) == (fault, joint if fault else 0), steps


def test_the_position_is_told_at_rest_only(firmware: Firmware) -> None:
    board = configured(firmware)
    assert board.ask(SetPosition((-70_000, 12))).ledger.position_usteps == (-70_000, 12)
    board.ask(Segments(0, 0, 0, (segment_of(30_000, run_of(9)),)))
    assert board.ask(SetPosition((0, 0))).refusal is Result.WRONG_STATE


def test_idle_drivers_are_released(native_firmware: NativeFirmware) -> None:
    board = configured(native_firmware, idle_ms=100)
    board.run(16_000 * 50)
    assert board.ask().state is State.READY
    board.run(16_000 * 80)
    assert board.ask().state is State.IDLE


def test_the_first_step_waits_until_the_drivers_are_awake(native_firmware: NativeFirmware) -> None:
    board = Board(native_firmware)
    board.hello()
    board.ask(replace(WIRING, wake_ticks=2_000_000))
    board.ask(Enable(1))
    energised = board.edges[-1].tick
    board.ask(Segments(0, 0, 0, (segment_of(30_000, run_of(5), last=True),)))
    board.ask(Start(LEAD_TICKS))
    board.run(3_000_000)
    assert board.rises(0)[0] >= energised + 2_000_000
