"""Rows of short segments with refused frames between: boards keep the pace that the certificate asks for."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from firmware_board import LEAD_TICKS, Board, EmulatedFirmware, Schedule, end_motion, run_of, segment_of
from planarm_wire.board_budget import LINE_LOAD, STEP_INTERRUPT_TICKS, work_ticks
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import (
    BOARDS,
    MAX_PAYLOAD_BYTES,
    QUEUE_FRAME_BYTES,
    Fault,
    Override,
    Result,
    Segment,
    Segments,
    Start,
    Status,
)

RELEASE = Path(__file__).parents[2] / "firmware" / "release"
STEPS = 5
HEAD_BYTES = 3


def row(name: str, duration: int, joints: int) -> list[Segment]:
    """As many alike segments as the queue holds, some of its joints moving."""
    wiring = BOARDS[name]
    interval = duration // STEPS
    one = segment_of(duration, *[run_of(STEPS, first=100, interval=interval)] * joints, joints=wiring.joints)
    together = (MAX_PAYLOAD_BYTES - HEAD_BYTES) // encoded_bytes(one)
    frames = wiring.queue_bytes // (HEAD_BYTES + together * encoded_bytes(one) + QUEUE_FRAME_BYTES)
    return end_motion([one] * (together * frames))


def play_among_refusals(name: str, motion: list[Segment], seed: int) -> tuple[Board, Status]:
    """Play a motion that the queue holds, with frames that are refused all the while."""
    chance = random.Random(seed)
    board = Board(EmulatedFirmware(RELEASE / f"{name}.hex", BOARDS[name]))
    board.get_ready()
    together = (MAX_PAYLOAD_BYTES - HEAD_BYTES) // encoded_bytes(motion[0])
    for at in range(0, len(motion), together):
        status = board.ask(Segments(0, 0, 0, tuple(motion[at : at + together])))
        assert status.refusal is Result.OK
    board.ask(Start(LEAD_TICKS))
    end = board.now + LEAD_TICKS + sum(segment.duration_flags >> 1 for segment in motion) + 50_000
    while board.now < end:
        board.send(Override(0))
        board.run(chance.randrange(6_000, 9_000))
    return board, board.ask()


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("name", "joints"),
    [
        ("uno", 1),
        ("uno", 2),
        ("uno_slow", 1),
        ("uno_slow", 2),
        ("cnc_shield", 2),
        *(("uno_four", n) for n in (1, 2, 3, 4)),
    ],
)
def test_the_pace_of_the_certificate_is_kept_among_refused_frames(name: str, joints: int, seed: int) -> None:
    work = work_ticks(joints, 0)
    load = LINE_LOAD + sum(STEP_INTERRUPT_TICKS[name][:joints]) * STEPS / work
    motion = row(name, int(work / (1.0 - load)), joints)
    board, status = play_among_refusals(name, motion, seed)
    assert status.fault is Fault.NONE
    assert status.ledger.position_usteps == Schedule.of(motion).positions()
    assert [len(board.rises(joint)) for joint in range(joints)] == [STEPS * len(motion)] * joints


def test_a_row_that_is_too_quick_ends_in_a_fault_and_no_wrong_step() -> None:
    # One joint, 6,000 ticks: a board needs 7,500 without a line, 11,000 with one that is busy.
    motion = row("uno", 6_000, 1)
    board, status = play_among_refusals("uno", motion, 1)
    assert status.fault is Fault.MISSED_DEADLINE
    made = board.rises(0)
    planned = [tick for tick, _ in Schedule.of(motion).steps[0]]
    assert [tick - made[0] for tick in made] == [tick - planned[0] for tick in planned[: len(made)]]
    assert status.ledger.position_usteps == (len(made), 0)


@pytest.mark.parametrize("later_ticks", range(0, 2000, 400))
def test_four_joints_whose_steps_all_fall_on_the_slices_ends(later_ticks: int) -> None:
    # Every run's last step is a tick before its slice's end, so its room is free as late as can be.
    steps, interval = 60, 2000
    segment = segment_of(steps * interval, *[run_of(steps, first=interval - 1, interval=interval)] * 4, joints=4)
    board = Board(EmulatedFirmware(RELEASE / "uno_four.hex", BOARDS["uno_four"]))
    board.get_ready()
    for one in end_motion([segment] * 4):
        board.ask(Segments(0, 0, 0, (one,)))
    board.send(Start(LEAD_TICKS + later_ticks))
    board.run(LEAD_TICKS + 5 * steps * interval)
    status = board.ask()
    assert status.fault is Fault.NONE
    assert status.ledger.position_usteps == (4 * steps,) * 4
