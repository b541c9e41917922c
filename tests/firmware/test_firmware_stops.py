"""Emergency stop, stop input, limit switches, soft limits, homing, power: each with its stated outcome, on the pins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from firmware_board import (
    LEAD_TICKS,
    REST,
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
from planarm_wire.codec import encode
from planarm_wire.framing import encode_frame
from planarm_wire.messages import (
    BAUD,
    DEBOUNCE_TICKS,
    EMERGENCY_CODE,
    EMERGENCY_REPEATS,
    ENABLE_PIN,
    HOLD_CODE,
    JOINTS,
    MIN_HOMING_TICKS,
    MIN_STEP_HIGH_TICKS,
    STEP_PINS,
    Clear,
    Config,
    Enable,
    Fault,
    Home,
    PinMap,
    Query,
    Result,
    Resume,
    Segments,
    SetPosition,
    SoftLimits,
    Start,
    State,
    Status,
)
from planarm_wire.rates import rate_code

BYTE_TICKS = 10 * 16_000_000 // BAUD
MOST_TICKS_AFTER_STOP = 480  # 30 us
MOST_DEBOUNCE_TICKS = DEBOUNCE_TICKS * 3 // 2 + 8000  # and a pass of the main program
ACTIVE_HIGH, RELEASES, STOP_INPUT, LIMITS, OPENS = 1, 2, 4, 8, 16
WIRING = Config(PinMap.OWN, JOINTS, 0, 0, 0, 160_000, 0, (160_000, 160_000))


def configured(firmware: Firmware, **changes: int) -> Board:
    board = Board(firmware)
    board.hello()
    status = board.ask(replace(WIRING, **changes))
    assert status.refusal is Result.OK
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    return board


def moving(board: Board) -> None:
    """Both joints at 50,000 and 31,000 steps/s for 60 ms."""
    motion = end_motion(
        [segment_of(96_000, run_of(299, first=0, interval=320), run_of(180, first=0, interval=520))] * 10
    )
    for segment in motion:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(300_000)
    assert board.rises(0)


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


class Switches:
    """The inputs of either board; by default nothing is hit and the stop circuit is closed."""

    def __init__(self, firmware: Firmware) -> None:
        self.firmware = firmware
        self.set()

    def set(self, hit: int = 0, stop_open: bool = False) -> None:
        if isinstance(self.firmware, NativeFirmware):
            self.firmware.set_inputs(hit | (0x80 if stop_open else 0))
            return
        assert isinstance(self.firmware, EmulatedFirmware)
        uno = self.firmware.uno
        uno.pin("A0").drive(1 if stop_open else 0)
        for joint, pin in enumerate(("A1", "A2")):
            uno.pin(pin).drive(0 if hit >> joint & 1 else 1)


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


def test_a_limit_hit_in_motion_is_a_fault_that_says_which_and_a_bounce_is_none(firmware: Firmware) -> None:
    board = Board(firmware)
    switches = Switches(firmware)
    board.hello()
    board.ask(replace(WIRING, options=LIMITS))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    moving(board)
    for _ in range(3):
        switches.set(hit=0b10)
        board.run(DEBOUNCE_TICKS // 4)
        switches.set()
        board.run(DEBOUNCE_TICKS // 4)
    assert board.ask_now().fault is Fault.NONE
    switches.set(hit=0b10)
    board.run(DEBOUNCE_TICKS + 60_000)
    status = board.ask()
    assert (status.fault, status.detail, status.inputs & 3) == (Fault.LIMIT_SWITCH, 1, 0b10)
    assert status.ledger.position_usteps[0] == board.position_at(0, board.now)


@pytest.mark.parametrize("half_ticks", [8000, 16_000, 32_000, 60_000, 78_000])
def test_a_contact_that_chatters_blinds_no_other(firmware: Firmware, half_ticks: int) -> None:
    board = Board(firmware)
    switches = Switches(firmware)
    board.hello()
    board.ask(replace(WIRING, options=LIMITS))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    moving(board)
    hit_at = board.now + 6 * half_ticks
    turn = 0
    while board.now < hit_at + MOST_DEBOUNCE_TICKS:
        switches.set(hit=(board.now >= hit_at) << 1 | turn % 2)
        board.run(half_ticks)
        turn += 1
    status = board.ask()
    assert (status.fault, status.detail, status.inputs & 3) == (Fault.LIMIT_SWITCH, 1, 0b10)


def test_a_switch_counts_once_it_has_been_hit_for_long_enough(firmware: Firmware) -> None:
    # At any moment against the board's own rhythm: what is shorter never counts, what is half as long more always.
    board = Board(firmware)
    switches = Switches(firmware)
    board.hello()
    board.ask(replace(WIRING, options=LIMITS))
    for phase in range(0, DEBOUNCE_TICKS // 2, 1900):
        for lasting, counts in ((DEBOUNCE_TICKS - 200, False), (MOST_DEBOUNCE_TICKS, True)):
            board.run(3 * DEBOUNCE_TICKS + phase)
            switches.set(hit=0b10)
            board.run(lasting)
            switches.set()
            assert bool(board.ask_now().inputs & 0b10) is counts, (phase, lasting)


def test_an_arm_leaves_a_switch_and_is_watched_again(firmware: Firmware) -> None:
    """As after homing: what is hit when a motion begins counts once it has been open."""
    board = Board(firmware)
    switches = Switches(firmware)
    board.hello()
    board.ask(replace(WIRING, options=LIMITS))
    board.ask(Enable(1))
    switches.set(hit=0b10)
    board.run(WAKE_TICKS + DEBOUNCE_TICKS)
    moving(board)
    board.run(3 * DEBOUNCE_TICKS)
    assert board.ask_now().state is State.RUNNING
    switches.set()
    board.run(DEBOUNCE_TICKS + 60_000)
    assert board.ask_now().state is State.RUNNING
    switches.set(hit=0b10)
    board.run(DEBOUNCE_TICKS + 60_000)
    status = board.ask()
    assert (status.fault, status.detail) == (Fault.LIMIT_SWITCH, 1)


@pytest.mark.parametrize("begins_on_the_switch", [False, True])
@pytest.mark.parametrize("bounces", [False, True])
def test_homing_ends_on_the_step_where_the_switch_closes(
    firmware: Firmware, begins_on_the_switch: bool, bounces: bool
) -> None:
    """The ledger counts on; the switch closes at `closes_at` usteps of joint 2."""
    closes_at = 5 if begins_on_the_switch else -40
    board = Board(firmware)
    switches = Switches(firmware)
    board.hello()
    board.ask(replace(WIRING, options=LIMITS))
    board.ask(Enable(1))
    switches.set(hit=0b10 if begins_on_the_switch else 0)
    board.run(WAKE_TICKS)
    assert board.ask(Home(1, 0, 20_000, 2 * DEBOUNCE_TICKS, 200, 100)).state is State.HOMING
    rest_ticks = 0
    for _ in range(20_000):
        board.run(2000)
        pressed = board.position_at(1, board.now) <= closes_at
        rest_ticks = rest_ticks + 2000 if pressed else 0
        open_again = bounces and 4000 < rest_ticks < 12_000  # for half a millisecond
        switches.set(hit=0b10 if pressed and not open_again else 0)
        if board.replies and board.replies[-1][1].state is not State.HOMING:  # type: ignore[union-attr]
            break
    status = board.ask()
    assert (status.state, status.fault) == (State.READY, Fault.NONE)
    assert status.ledger.position_usteps == (0, closes_at)


@pytest.mark.parametrize(
    ("fast_ticks", "slow_ticks"),
    [(MIN_HOMING_TICKS - 1, 2 * DEBOUNCE_TICKS), (MIN_HOMING_TICKS, 2 * DEBOUNCE_TICKS - 1)],
    ids=["its steps cannot be handed over in time", "its touch is too fast for the debouncing"],
)
def test_a_homing_that_is_too_fast_is_refused(firmware: Firmware, fast_ticks: int, slow_ticks: int) -> None:
    board = Board(firmware)
    board.hello()
    board.ask(replace(WIRING, options=LIMITS))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    assert board.ask(Home(1, 0, fast_ticks, slow_ticks, 200, 100)).refusal is Result.OUT_OF_RANGE
    board.ask(Clear())
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    assert board.ask(Home(1, 0, MIN_HOMING_TICKS, 2 * DEBOUNCE_TICKS, 200, 100)).state is State.HOMING


@pytest.mark.parametrize("begins_on_the_switch", [False, True])
def test_a_switch_that_does_not_open_again_is_a_fault(firmware: Firmware, begins_on_the_switch: bool) -> None:
    # Welded, or with a broken wire: the joint goes back as far as told and not a step farther.
    board = Board(firmware)
    switches = Switches(firmware)
    board.hello()
    board.ask(replace(WIRING, options=LIMITS))
    board.ask(Enable(1))
    switches.set(hit=0b10 if begins_on_the_switch else 0)
    board.run(WAKE_TICKS)
    assert board.ask(Home(1, 0, 20_000, 2 * DEBOUNCE_TICKS, 200, 25)).state is State.HOMING
    board.run(10 * 20_000)
    switches.set(hit=0b10)
    board.run(3_000_000 + 27 * 2 * DEBOUNCE_TICKS)
    status = board.ask()
    assert (status.state, status.fault, status.detail) == (State.FAULT, Fault.HOMING_FAILED, 1)
    towards = len(board.rises(1)) - 25
    assert towards == 0 if begins_on_the_switch else 10 <= towards <= 20
    assert status.ledger.position_usteps == (0, 25 - towards)


def test_a_homing_waits_until_the_drivers_are_awake(firmware: Firmware) -> None:
    board = Board(firmware)
    Switches(firmware)
    board.hello()
    board.ask(replace(WIRING, options=LIMITS, wake_ticks=2_000_000))
    board.edges.clear()
    board.ask(Enable(1))
    energised = board.edges[-1].tick
    assert board.ask(Home(0, 1, 20_000, 160_000, 30, 100)).state is State.HOMING
    board.run(3_000_000)
    assert 0 <= board.rises(0)[0] - (energised + 2_000_000) < 400_000  # the mark in EEPROM may come first


def test_homing_without_a_switch_fails_within_its_distance(firmware: Firmware) -> None:
    board = Board(firmware)
    switches = Switches(firmware)
    board.hello()
    board.ask(replace(WIRING, options=LIMITS))
    board.ask(Enable(1))
    switches.set()
    board.run(WAKE_TICKS)
    board.ask(Home(0, 1, 20_000, 160_000, 30, 100))
    board.run(30 * 20_000 + 200_000)
    status = board.ask()
    assert (status.state, status.fault, status.detail) == (State.FAULT, Fault.HOMING_FAILED, 0)
    assert status.ledger.position_usteps == (30, 0)


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
