"""The image for drivers that need long pulses, on the emulated Uno: a match makes either edge of every pulse."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_board import (
    LEAD_TICKS,
    WAKE_TICKS,
    Board,
    EmulatedFirmware,
    Schedule,
    end_motion,
    run_of,
    segment_of,
)
from firmware_motions import fast
from firmware_streamer import LedgerReader, Streamer
from firmware_tracer import RECEIVE, STEP_1, STEP_2, Tracer
from planarm_wire.messages import (
    BOARDS,
    EMERGENCY_CODE,
    HOLD_CODE,
    MIN_DIR_SETUP_TICKS,
    Config,
    Enable,
    Fault,
    PinMap,
    Resume,
    Segment,
    Segments,
    Start,
    State,
    Status,
    Stop,
)

IMAGE = Path(__file__).parents[2] / "firmware" / "release" / "uno_slow.hex"
UNO_SLOW = BOARDS["uno_slow"]
HIGH, LOW, LEAST = UNO_SLOW.min_step_high_ticks, UNO_SLOW.min_step_low_ticks, UNO_SLOW.min_interval_ticks
# firmware/hal/uno/second_match.h
RISEN_CYCLES, STEP_CYCLES, ONWARD_CYCLES, REVERSED_CYCLES, IDLE_CYCLES = 38, 90, 63, 69, 60


@pytest.fixture(scope="module")
def firmware() -> EmulatedFirmware:
    return EmulatedFirmware(IMAGE, UNO_SLOW)


def queue_up(board: Board, motion: list[Segment], *allowances: int) -> None:
    for segment in motion:
        board.ask(Segments(*(allowances or (0, 0, 0)), (segment,)))


def assert_pulses(board: Board, *, shortest_last: bool = False) -> None:
    """Every pulse is high for the very least time, the last one for that or more, and low for the least time."""
    for pin in UNO_SLOW.step_pins:
        edges = [edge for edge in board.edges if edge.pin == pin]
        highs = [fall.tick - rise.tick for rise, fall in zip(edges[::2], edges[1::2], strict=True)]
        lows = [rise.tick - fall.tick for fall, rise in zip(edges[1::2], edges[2::2], strict=False)]
        assert set(highs[: len(highs) - shortest_last]) <= {HIGH}, pin
        assert all(high >= HIGH for high in highs)
        assert all(low >= LOW for low in lows)
        (dir_pin,) = (direction for step, direction in UNO_SLOW.joint_pins if step == pin)
        turns = [edge.tick for edge in board.edges if edge.pin == dir_pin]
        for rise, turn in itertools.product(edges[::2], turns):
            assert turn > rise.tick + HIGH or rise.tick - turn >= MIN_DIR_SETUP_TICKS, "setup, and hold over the pulse"


def assert_on_schedule(board: Board, motion: list[Segment], status: Status) -> None:
    """No fault, every step on its tick, every pulse as long as the least, the ledger exact."""
    assert (status.fault, status.overruns) == (Fault.NONE, 0)
    schedule = Schedule.of(motion)
    begin = board.rises(0)[0] - schedule.steps[0][0][0]
    for joint in range(2):
        assert board.rises(joint) == [begin + tick for tick, _ in schedule.steps[joint]]
    assert status.ledger.position_usteps == schedule.positions()
    assert_pulses(board)


@pytest.mark.parametrize("joint", [0, 1])
def test_cycles_of_its_interrupts(joint: int) -> None:
    def segment(positive: bool) -> Segment:
        moves = [run_of(0), run_of(0)]
        moves[joint] = run_of(3, positive=positive, fraction=40_000, interval=1200)
        return segment_of(6000, *moves)

    tracer = Tracer(IMAGE, UNO_SLOW)
    board = Board(tracer)
    fast_run = super(Tracer, tracer).run
    tracer.run = fast_run  # type: ignore[method-assign]
    board.get_ready()
    queue_up(board, end_motion([segment(True), segment(True), segment(False)]))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS - 1000)
    del tracer.run
    board.run(LEAD_TICKS + 25_000)
    made = [RISEN_CYCLES, STEP_CYCLES] * 2 + [RISEN_CYCLES]
    wanted = [*made, ONWARD_CYCLES, *made, REVERSED_CYCLES, *made, IDLE_CYCLES]
    assert [cycles for number, cycles in tracer.done if number == (STEP_1, STEP_2)[joint]] == wanted
    assert_pulses(board)


@pytest.mark.parametrize("ratio", [1.0, 1.0037, 1.618], ids=["alike", "all phases", "apart"])
def test_its_least_interval_with_the_window_always_full(firmware: EmulatedFirmware, ratio: float) -> None:
    motion = end_motion(fast(LEAST, ratio, 228_000, 40))
    board = Board(firmware)
    board.get_ready()
    queue_up(board, motion[:16])
    board.ask(Start(LEAD_TICKS))
    status = Streamer(board, motion[16:], busy_line=True).run(len(motion), 20_000_000)
    assert (status.ring_full, status.crc_errors) == (0, 0)
    assert_on_schedule(board, motion, status)


def test_its_ledger_is_exact_at_its_tick(firmware: EmulatedFirmware) -> None:
    motion = end_motion(fast(LEAST, 1.0037, 250_000, 24))
    board = Board(firmware)
    board.get_ready()
    queue_up(board, motion[:12])
    board.ask(Start(LEAD_TICKS))
    reader = LedgerReader(board, motion[12:])
    reader.run(len(motion), 12_000_000)
    reader.assert_exact()


def test_a_fault_at_any_moment_of_a_pulse_counts_its_step(firmware: EmulatedFirmware) -> None:
    # A segment that breaks a limit ends all steps, at every tick of an interval: before, in and after a pulse.
    steps, interval = 41, LEAST
    board = Board(firmware)
    board.get_ready()
    moves = run_of(steps, first=0, interval=interval), run_of(steps, first=201, interval=interval)
    queue_up(board, [segment_of(steps * interval, *moves)] * 10)
    uno, seq = firmware.uno, board.seq
    queued = uno.snapshot()
    for later_ticks in range(0, 3 * LEAST, 3):
        uno.restore(queued)
        board.forget_replies()
        board.edges.clear()
        board.seq = seq
        board.send(Start(LEAD_TICKS + later_ticks))
        board.run(LEAD_TICKS + 40_000)
        board.send(Segments(0, 0, 0, (segment_of(0),)))
        board.run(20_000)
        status = board.ask()
        assert status.fault is Fault.BAD_SEGMENT
        made = len(board.rises(0)), len(board.rises(1))
        assert status.ledger.position_usteps == made, later_ticks
        assert status.ledger.executed_segments == (made[0] - 1) // steps, later_ticks
        assert_pulses(board, shortest_last=True)


def test_an_emergency_stop_at_any_moment_of_a_pulse(firmware: EmulatedFirmware) -> None:
    board = Board(firmware)
    board.get_ready()
    queue_up(board, [segment_of(41 * LEAST, run_of(41, first=0, interval=LEAST), run_of(20, interval=2 * LEAST))] * 10)
    board.ask(Start(LEAD_TICKS))
    board.run(LEAD_TICKS)
    uno, edges = firmware.uno, tuple(board.edges)
    moving = uno.snapshot()
    for phase in range(0, 2 * LEAST, 5):
        uno.restore(moving)
        board.edges[:] = edges
        board.run(phase)
        board.receive(bytes([EMERGENCY_CODE] * 3))
        stop_bit = board.now + 3 * 640
        board.run(30_000)
        assert max(edge.tick for edge in board.motion_edges()) <= stop_bit + 480, "30 us"
        assert_pulses(board, shortest_last=True)


def test_an_interrupt_that_comes_too_late_latches_a_fault_and_counts_every_step() -> None:
    tracer = Tracer(IMAGE, UNO_SLOW)
    board = Board(tracer)
    fast_run = super(Tracer, tracer).run
    tracer.run = fast_run  # type: ignore[method-assign]
    board.get_ready()
    queue_up(board, end_motion([segment_of(30_000, run_of(30, first=0, interval=1000), run_of(12, interval=2400))] * 8))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 30_000)
    uno, seq, edges = tracer.uno, board.seq, tuple(board.edges)
    moving = uno.snapshot()
    for phase in range(0, 2000, 50):
        uno.restore(moving)
        board.forget_replies()
        board.edges[:] = edges
        board.seq = seq
        board.run(phase)
        tracer.run_until(tracer.begins_pass)
        tracer.hold_interrupts(1100)
        board.run(30_000)
        status = board.ask()
        assert status.fault is Fault.MISSED_DEADLINE, phase
        assert status.ledger.position_usteps == tuple(len(board.rises(joint)) for joint in range(2)), phase
        assert_pulses(board, shortest_last=True)
        assert not any(uno.pin(pin).level for pin in UNO_SLOW.step_pins)


@pytest.mark.parametrize("quick", [None, 0, 1], ids=["hold", "stop", "quick stop"])
def test_holds_and_stops_lose_no_step_and_shorten_no_pulse(firmware: EmulatedFirmware, quick: int | None) -> None:
    chance = random.Random(3)
    board = Board(firmware)
    board.hello()
    board.ask(Config(PinMap.OWN_SLOW, 2, 0, 0, 0, 0, HIGH, (20_000, 20_000)))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    motion = fast(2000, 1.31, 120_000, 60)
    queue_up(board, motion[:20], 200, 200, 1)
    board.ask(Start(LEAD_TICKS))
    for _ in range(4):
        board.run(chance.randrange(100_000, 300_000))
        if quick is not None:
            break
        board.receive(bytes([HOLD_CODE]))
        board.run(2_000_000)
        assert board.ask_now().state is State.HELD
        board.send(Resume())
    if quick is not None:
        board.send(Stop(quick))
    board.run(8_000_000)  # to its end, or to a rest
    status = board.ask_now()
    assert status.ledger.position_usteps == tuple(len(board.rises(joint)) for joint in range(2))
    assert_pulses(board)


def test_a_turn_keeps_dir_from_the_pulse(firmware: EmulatedFirmware, sized: Callable[[int, int], int]) -> None:
    # Segments of 4.8 ms: of 3.4 ms, at this load and on a full line, the board reads fewer than it executes.
    steps = 170
    duration = steps * LEAST + MIN_DIR_SETUP_TICKS
    segments = []
    for i in range(sized(40, 400)):
        joints = (steps, 0), (steps - 1, 300)
        moves = [run_of(n, first=first, interval=LEAST, positive=i % 2 == 0) for n, first in joints]
        segments.append(segment_of(duration, *moves))
    board = Board(firmware)
    board.get_ready()
    motion = end_motion(segments)
    queue_up(board, motion[:16])
    board.ask(Start(LEAD_TICKS))
    status = Streamer(board, motion[16:], busy_line=False).run(len(motion), LEAD_TICKS + 2 * duration * len(motion))
    assert (status.ring_full, status.crc_errors) == (0, 0)
    assert_on_schedule(board, motion, status)


def test_its_receive_interrupt_is_the_same() -> None:
    tracer = Tracer(IMAGE, UNO_SLOW)
    Board(tracer).hello()
    assert tracer.taken(RECEIVE) == {36}
