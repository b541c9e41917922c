"""Emergency stop, stop input and hold: each ends all edges in its time and has its stated outcome, on the pins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from firmware_board import (
    LEAD_TICKS,
    WAKE_TICKS,
    Board,
    Delays,
    EmulatedFirmware,
    Firmware,
    NativeFirmware,
    end_motion,
    run_of,
    segment_of,
)
from firmware_configured import (
    BYTE_TICKS,
    MOST_TICKS_AFTER_STOP,
    RELEASES,
    STOP_INPUT,
    WIRING,
    Switches,
    configured,
    moving,
)
from planarm_wire.codec import encode
from planarm_wire.framing import encode_frame
from planarm_wire.messages import (
    EMERGENCY_CODE,
    EMERGENCY_REPEATS,
    ENABLE_PIN,
    HOLD_CODE,
    MIN_STEP_HIGH_TICKS,
    STEP_PINS,
    Clear,
    Enable,
    Fault,
    Query,
    Resume,
    Segments,
    Start,
    State,
    Status,
)
from planarm_wire.rates import rate_code

ALL_PHASES = range(0, 4160, 7)  # every tick of either joint's interval in moving(); after 4,160 both repeat


def assert_ends_in_every_phase(firmware: EmulatedFirmware, board: Board, stop: Callable[[], int]) -> None:
    """While both joints move `stop` ends all edges within 30 us of the tick that it returns, and cuts no pulse."""
    moving(board)
    uno, seq = firmware.uno, board.seq
    while any(uno.pin(pin).level for pin in STEP_PINS):  # from here on every pulse has both edges
        board.run(1)
    begun = uno.snapshot()
    stepping = set()
    for phase in ALL_PHASES:
        uno.restore(begun)
        board.edges.clear()
        board.forget_replies()
        board.seq = seq
        board.run(phase)
        stopped = stop()
        board.run(20_000)
        for pin in STEP_PINS:
            ticks = [edge.tick for edge in board.edges if edge.pin == pin]
            if ticks:
                stepping.add(pin)
                assert ticks[-1] <= stopped + MOST_TICKS_AFTER_STOP, phase
            highs = [fall - rise for rise, fall in zip(ticks[::2], ticks[1::2], strict=True)]
            assert all(high >= MIN_STEP_HIGH_TICKS for high in highs), phase
    assert stepping == set(STEP_PINS)


def test_three_emergency_bytes_end_all_edges_within_30_us_and_cut_no_pulse(
    emulated_firmware: EmulatedFirmware,
) -> None:
    board = configured(emulated_firmware)

    def stop() -> int:
        # The bytes follow each other without a gap from here on; the last stop bit ends three bytes later.
        board.receive(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
        return board.now + EMERGENCY_REPEATS * BYTE_TICKS

    assert_ends_in_every_phase(emulated_firmware, board, stop)
    status = board.ask()
    assert (status.state, status.fault) == (State.FAULT, Fault.EMERGENCY_STOP)
    assert all(edge.pin != ENABLE_PIN for edge in board.edges), "the drivers keep holding"


def test_two_emergency_bytes_and_another_do_nothing(firmware: Firmware) -> None:
    board = configured(firmware)
    moving(board)
    for _ in range(4):
        board.receive(bytes([EMERGENCY_CODE] * (EMERGENCY_REPEATS - 1)))
        board.send(Query())
        board.run(40_000)
    assert board.ask_now().fault is Fault.NONE


def test_an_emergency_in_the_middle_of_a_frame_and_with_a_full_ring(firmware: Firmware) -> None:
    board = configured(firmware)
    moving(board)
    board.receive(bytes(100) + bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
    board.run(200_000)
    made = len(board.rises(0))
    board.run(200_000)
    assert len(board.rises(0)) == made
    board.receive(bytes([0x7E]))
    board.run(100_000)
    assert board.ask().fault is Fault.EMERGENCY_STOP
    assert board.ask(Clear()).fault is Fault.NONE


def test_a_hold_in_the_middle_of_a_frame_acts_and_leaves_the_frame_whole(firmware: Firmware) -> None:
    board = configured(firmware)
    for segment in end_motion([segment_of(400_000, run_of(1))] * 8):
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    board.run(600_000)
    for at in range(1, len(encode_frame(0, *encode(Query())))):
        frame = encode_frame(board.seq, *encode(Query()))
        board.forget_replies()
        board.receive(frame[:at] + bytes([HOLD_CODE]) + frame[at:])
        board.run(60_000)
        assert board.seq in {seq for seq, _ in board.replies}, "the frame is answered"
        board.seq += 1
        status = board.ask()
        assert (status.state, status.crc_errors) == (State.HELD, 0), (at, status)
        assert board.ask(Resume()).state is State.RUNNING


@pytest.mark.parametrize("interval", [5000, 12_000])
def test_a_hold_below_the_start_stop_speeds_rests_within_a_millisecond(
    emulated_firmware: EmulatedFirmware, interval: int
) -> None:
    board = Board(emulated_firmware)
    board.hello()
    board.ask(replace(WIRING, start_stop_ticks=(4000, 4000)))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    steps = 240_000 // interval
    move = run_of(steps, first=0, interval=interval)
    for segment in end_motion([segment_of(240_000, move, move)] * 10):
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 300_000)
    uno, seq = emulated_firmware.uno, board.seq
    moving_on = uno.snapshot()
    for phase in range(0, interval, 250):
        uno.restore(moving_on)
        board.edges.clear()
        board.forget_replies()
        board.seq = seq
        board.run(phase)
        board.receive(bytes([HOLD_CODE]))
        told = board.now + BYTE_TICKS
        board.run(100_000)
        assert max(board.rises(0), default=0) <= told + 16_000, phase
        assert board.ask_now().state is State.HELD


def test_an_emergency_releases_the_drivers_when_told_to(firmware: Firmware) -> None:
    board = configured(firmware, options=RELEASES)
    moving(board)
    board.receive(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
    board.run(100_000)
    levels = [edge.level for edge in board.edges if edge.pin == ENABLE_PIN]
    assert levels == [0, 1]


def test_the_stop_input_ends_all_edges(firmware: Firmware) -> None:
    board = Board(firmware)
    switches = Switches(firmware)
    board.hello()
    board.ask(replace(WIRING, options=STOP_INPUT))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    moving(board)
    switches.set(stop_open=True)
    opened = board.now
    board.run(100_000)
    assert max(edge.tick for edge in board.edges if edge.pin in STEP_PINS) <= opened + MOST_TICKS_AFTER_STOP
    assert board.ask().fault is Fault.STOP_INPUT
    board.ask(Clear())
    assert board.ask(Enable(1)).fault is Fault.STOP_INPUT, "it is still open"
    switches.set()
    board.ask(Clear())
    assert board.ask(Enable(1)).state is State.READY


def test_the_stop_input_cuts_no_pulse(emulated_firmware: EmulatedFirmware) -> None:
    board = Board(emulated_firmware)
    switches = Switches(emulated_firmware)
    board.hello()
    board.ask(replace(WIRING, options=STOP_INPUT))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)

    def stop() -> int:
        switches.set(stop_open=True)
        return board.now

    assert_ends_in_every_phase(emulated_firmware, board, stop)
    assert board.ask().fault is Fault.STOP_INPUT


HALF_ROUND_TICKS = 2**31  # of the 32-bit clock: what is older seems to lie ahead


def start_long_motion(board: Board) -> int:
    """160 s of joint 1 at a thousand steps/s, ten times its start-stop speed. Returns the tick of START."""
    rate = rate_code(5.0)
    for segment in end_motion([segment_of(64_000_000, run_of(4000, first=0, interval=16_000))] * 40):
        board.send(Segments(rate, rate, 20, (segment,)))
        board.run(60_000)
    board.send(Start(LEAD_TICKS))
    return board.now


def test_a_hold_after_half_a_round_of_the_clock_slows_down(native_firmware: NativeFirmware) -> None:
    board = Board(native_firmware, delays=Delays(pass_ticks=4000))
    board.hello()
    board.ask(WIRING)
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    begin = start_long_motion(board)
    board.run(begin + HALF_ROUND_TICKS + 16_000_000 - board.now)
    board.edges.clear()
    board.receive(bytes([HOLD_CODE]))
    held = board.now
    board.run(16_000_000)
    assert board.ask().state is State.HELD
    assert board.rises(0)[-1] - held > 1_600_000, "0.1 s of slowing down"


def test_drivers_that_woke_long_ago_do_not_hold_up_the_next_start(native_firmware: NativeFirmware) -> None:
    board = Board(native_firmware, delays=Delays(pass_ticks=4000))
    board.hello()
    board.ask(WIRING)
    board.ask(Enable(1))
    begin = start_long_motion(board)  # while they wake
    board.run(begin + 161 * 16_000_000 - board.now)
    assert board.ask().state is State.READY
    board.edges.clear()
    for segment in end_motion([segment_of(160_000, run_of(10, first=0, interval=16_000))]):
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 400_000)
    assert len(board.rises(0)) == 10


@pytest.mark.parametrize("queries", [0, 1, 3])
@pytest.mark.parametrize("gap_bytes", [0, 1, 2, 3])
def test_an_emergency_stop_behind_a_clear_is_kept(
    emulated_firmware: EmulatedFirmware, queries: int, gap_bytes: int
) -> None:
    board = configured(emulated_firmware)
    board.receive(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
    board.run(100_000)
    assert board.ask().fault is Fault.EMERGENCY_STOP
    for message in (*[Query()] * queries, Clear()):
        board.send(message)
    board.run(gap_bytes * BYTE_TICKS)
    board.receive(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
    board.run(100_000)
    assert board.ask(Enable(1)).fault is Fault.EMERGENCY_STOP


def test_a_clear_takes_back_no_emergency_that_no_status_has_told(emulated_firmware: EmulatedFirmware) -> None:
    # The contact opens for an instant, at all moments about the one in which a STATUS is put together.
    board = Board(emulated_firmware)
    switches = Switches(emulated_firmware)
    board.hello()
    board.ask(replace(WIRING, options=STOP_INPUT))
    board.ask(Enable(1))
    uno, seq, quiet = emulated_firmware.uno, board.seq, emulated_firmware.uno.snapshot()
    frame_ticks = len(encode_frame(seq, *encode(Query()))) * BYTE_TICKS
    told = []
    for phase in range(0, 8000, 40):
        uno.restore(quiet)
        board.forget_replies()
        board.seq = seq
        board.send(Query())
        board.send(Clear())  # right behind it: what the answer to the first tells
        board.run(frame_ticks - 1000 + phase)
        switches.set(stop_open=True)
        board.run(60)
        switches.set()
        board.run(60_000)
        told.append(next(reply.fault for _, reply in board.replies if isinstance(reply, Status)))
        if told[-1] is Fault.NONE:
            assert board.ask().fault is Fault.STOP_INPUT, phase
    assert set(told) == {Fault.NONE, Fault.STOP_INPUT}


def test_an_emergency_beside_another_fault_is_told_as_what_loses_the_place(
    emulated_firmware: EmulatedFirmware,
) -> None:
    # It has ended the steps, uncounted, before the fault's own end looks at them: that fault keeps the position.
    board = Board(emulated_firmware)
    board.get_ready()
    runs = (run_of(299, first=0, interval=320), run_of(180, first=0, interval=520))
    for segment in end_motion([segment_of(96_000, *runs)] * 10):
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(300_000)
    uno, seq, edges = emulated_firmware.uno, board.seq, list(board.edges)
    snapshot = uno.snapshot()
    refused = Segments(0, 0, 0, (segment_of(0, run_of(1)),))
    frame_ticks = len(encode_frame(seq, *encode(refused))) * BYTE_TICKS
    for phase in range(0, 60_000, 5_001):
        for behind in (0, 2_560):
            uno.restore(snapshot)
            board.edges = list(edges)
            board.forget_replies()
            board.seq = seq
            board.run(phase)
            board.send(refused)
            if behind:
                board.run(frame_ticks + behind)
            board.receive(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
            board.run(60_000)
            assert board.ask().fault is Fault.EMERGENCY_STOP


def test_an_emergency_stop_takes_the_place_of_a_fault_that_keeps_the_position(firmware: Firmware) -> None:
    board = configured(firmware, options=RELEASES)
    assert board.ask(Segments(0, 0, 0, (segment_of(0, run_of(1)),))).fault is Fault.BAD_SEGMENT
    assert not [edge for edge in board.edges if edge.pin == ENABLE_PIN][-1].level, "on: active low"
    board.receive(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
    board.run(100_000)
    assert board.ask().fault is Fault.EMERGENCY_STOP
    assert [edge for edge in board.edges if edge.pin == ENABLE_PIN][-1].level, "released"
    status = board.ask(Clear())
    assert (status.state, status.fault) == (State.IDLE, Fault.NONE), "not ready with drivers that are off"
