"""Hold, resume, override and starvation: every edge where the stretched path clock puts it, and not a step lost.

The model of tests/stretch_motion.py predicts all edges. The firmware fits each slice's steps by a quadratic, so an edge
may be off by a small share of the interval around it; the issue allows one micro-step.
"""

from __future__ import annotations

import random
from collections import deque
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_board import (
    LEAD_TICKS,
    WAKE_TICKS,
    Board,
    EmulatedFirmware,
    Firmware,
    NativeFirmware,
    Schedule,
    end_motion,
    run_of,
    segment_of,
)
from firmware_motions import fast
from firmware_player import FAST, Player
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import (
    HOLD_CODE,
    JOINTS,
    MIN_INTERVAL_TICKS,
    NEED_UNIT_TICKS,
    QUEUE_FRAME_BYTES,
    STARVING_TICKS,
    Config,
    Enable,
    Fault,
    Move,
    Override,
    PinMap,
    Resume,
    Segment,
    Segments,
    Start,
    State,
    Status,
    Stop,
)
from planarm_wire.rates import rate_value
from stretch_motion import (
    ONE,
    SEGMENT_TICKS,
    HoldableMotion,
    Profile,
    largest_accelerations,
    stretched_slices,
    stretched_steps,
)

UNEQUAL = Profile((20_000.0, 12_361.0 / 9), (400_000.0, 30_000.0), 0.8, 30).motion()
SHARE_OF_INTERVAL = 0.15
TICKS_OFF = 4
HOLD_LATENCY_TICKS = SEGMENT_TICKS + 64_000  # one segment and 4 ms


def assert_predicted(found: list[int], predicted: list[float]) -> None:
    """Each edge within a share of the shorter interval around it."""
    assert len(found) == len(predicted)
    for i, (tick, model) in enumerate(zip(found, predicted, strict=True)):
        around = min((predicted[j + 1] - predicted[j] for j in (i - 1, i) if 0 <= j < len(predicted) - 1), default=1e9)
        assert abs(tick - model) <= SHARE_OF_INTERVAL * around + TICKS_OFF, (i, tick, model)


def begin_of(player: Player) -> int:
    first = Schedule.of(player.motion.segments).steps[0][0][0]
    return player.board.rises(0)[0] - first


def held_at(player: Player, hold_tick: int) -> tuple[int, list[int]]:
    """The slice from which a hold slowed the clock, found by its prediction, and the steps made until the rest."""
    begin = begin_of(player)
    made = [len(player.board.rises(joint)) for joint in range(JOINTS)]
    earliest = max(0, (hold_tick - begin) // SEGMENT_TICKS)
    for k in range(earliest, earliest + 4):
        slices = stretched_slices(player.motion, hold=k)
        try:
            for joint in range(JOINTS):
                predicted = stretched_steps(player.motion.segments, slices, joint)[: made[joint]]
                assert_predicted([tick - begin for tick in player.board.rises(joint)], predicted)
        except AssertionError:
            continue
        assert begin + k * SEGMENT_TICKS - hold_tick <= HOLD_LATENCY_TICKS
        assert max(largest_accelerations(player.motion, slices)) <= 1.02
        return k, made
    raise AssertionError(f"no slice from {earliest} on explains the edges")


@pytest.mark.parametrize("motion", [FAST, UNEQUAL], ids=["20 k and 12.4 k", "20 k and 1.4 k"])
@pytest.mark.parametrize("share", [0.1, 0.35, 0.5, 0.7])
def test_hold_and_resume_as_the_model_says(
    native_firmware: NativeFirmware, motion: HoldableMotion, share: float
) -> None:
    player = Player(native_firmware, motion)
    player.start()
    begun = player.board.now + LEAD_TICKS
    player.play_until(begun + int(share * len(motion.segments) * SEGMENT_TICKS))
    hold_tick = player.board.now
    player.board.receive(bytes([HOLD_CODE]))
    player.play_until(hold_tick + 10**8, State.HELD)
    hold, made = held_at(player, hold_tick)
    player.board.run(3_000_000)
    assert [len(player.board.rises(joint)) for joint in range(JOINTS)] == made, "held is at rest"
    player.board.send(Resume())
    player.assert_all_steps_made()
    assert_resumed_as_predicted(player, hold, made)


def assert_resumed_as_predicted(player: Player, hold: int, made: list[int]) -> None:
    """After a rest in some slice the edges are those of the model, all later by the same time."""
    begin = begin_of(player)
    causes = []
    for rest in range(hold, len(stretched_slices(player.motion, hold=hold))):
        slices = stretched_slices(player.motion, hold=hold, rest=rest)
        predicted = [stretched_steps(player.motion.segments, slices, joint) for joint in range(JOINTS)]
        moving = [joint for joint in range(JOINTS) if made[joint] < len(predicted[joint])]
        later = {j: player.board.rises(j)[made[j]] - begin - predicted[j][made[j]] for j in moving}
        try:
            apart = max(later.values()) - min(later.values())
            assert apart < 0.2 * max(player.motion.start_stop_ticks), "both joints by the same time"
            for joint in moving:
                found = [tick - begin - later[joint] for tick in player.board.rises(joint)[made[joint] :]]
                assert_predicted_after(found, predicted[joint][made[joint] :])
        except AssertionError as cause:
            causes.append(str(cause))
            continue
        assert max(largest_accelerations(player.motion, slices)) <= 1.02
        return
    raise AssertionError(f"no rest explains the edges: {causes[:3]}")


def assert_predicted_after(found: list[float], predicted: list[float]) -> None:
    assert_predicted([round(tick) for tick in found], predicted)


def test_the_devices_clock_goes_on_while_the_motions_stands(firmware: Firmware) -> None:
    player = Player(firmware, FAST)
    player.start()
    player.play_until(player.board.now + 12 * SEGMENT_TICKS)
    before, begin = player.board.ask(), player.board.now
    for rest_ticks in (100_000, 5_000_000):
        player.board.receive(bytes([HOLD_CODE]))
        player.play_until(player.board.now + 10**8, State.HELD)
        player.board.run(rest_ticks)
        player.board.ask(Resume())
        status = player.play_until(player.board.now + 5 * SEGMENT_TICKS)
        assert (status.mcu_ticks - before.mcu_ticks) % 2**32 == pytest.approx(player.board.now - begin, abs=60_000)
    player.assert_all_steps_made()


@settings(max_examples=15, deadline=None)
@given(st.lists(st.integers(200_000, 4_000_000), min_size=1, max_size=6), st.integers(0, 3_000_000))
def test_any_number_of_holds_loses_no_step(native_firmware: NativeFirmware, waits: list[int], pause: int) -> None:
    player = Player(native_firmware, UNEQUAL)
    player.start()
    player.hold_and_resume(waits, pause)
    player.assert_all_steps_made()
    for joint in range(JOINTS):
        signs = [sign for _, sign in Schedule.of(UNEQUAL.segments).steps[joint]]
        assert len(player.board.rises(joint)) == len(signs)


@pytest.mark.parametrize("percent", [1, 7, 50, 99])
@pytest.mark.parametrize("motion", [FAST, UNEQUAL], ids=["20 k and 12.4 k", "20 k and 1.4 k"])
def test_override_from_the_start(native_firmware: NativeFirmware, motion: HoldableMotion, percent: int) -> None:
    # At 1 % the stretched intervals are far beyond 65,535 ticks.
    player = Player(native_firmware, motion)
    assert player.board.ask(Override(percent)).override_percent == percent
    player.start()
    player.assert_all_steps_made()
    stretch = 100 * ONE // percent
    slices = stretched_slices(motion, target=stretch)
    predicted = [stretched_steps(motion.segments, slices, joint) for joint in range(JOINTS)]
    begin = round(player.board.rises(0)[0] - predicted[0][0])
    for joint in range(JOINTS):
        assert_predicted([tick - begin for tick in player.board.rises(joint)], predicted[joint])


def slow_motion() -> HoldableMotion:
    """Joint 2 makes slow moves, with some 80 to 230 steps/s, in segments of many slices; joint 1 5,300 steps/s."""
    segments = []
    for k in range(12):
        slower = Move(2 * 7 + (k % 3 != 0), 400, (70_000 << 8) + 77, (5_000 << 8) + 3)
        faster = Move(2 * 6 + (k % 3 != 0), 500, (195_000 << 8) + 1, -(40_500 << 8) - 1)
        segments.append(segment_of(600_000, run_of(199, first=600, interval=3000), faster if k % 2 else slower))
    heads = [(150, 150, 0)] * len(segments)
    return HoldableMotion(end_motion(segments), heads, (0.0, 0.0), (40_000, 160_000))


@pytest.mark.parametrize("percent", [1, 7, 50, 99])
def test_slow_moves_under_an_override(native_firmware: NativeFirmware, percent: int) -> None:
    motion = slow_motion()
    player = Player(native_firmware, motion)
    player.board.ask(Override(percent))
    player.start()
    player.assert_all_steps_made()
    slices = stretched_slices(motion, target=100 * ONE // percent)
    for joint in range(JOINTS):
        predicted = stretched_steps(motion.segments, slices, joint)
        # A slice's length in ticks is rounded down, some ten a segment.
        begin = round(player.board.rises(0)[0] - stretched_steps(motion.segments, slices, 0)[0])
        off = (0.15 * 3000, 0.0)[joint]
        for tick, model in zip(player.board.rises(joint), predicted, strict=True):
            assert -11 * (1 + model // 600_000) - TICKS_OFF <= tick - begin - model <= TICKS_OFF + off


@pytest.mark.parametrize("wait", range(500_000, 900_000, 60_000))
def test_a_slow_move_below_the_start_stop_speed_rests_at_once(firmware: Firmware, wait: int) -> None:
    # Nearly every slice has a step; 60,000 ticks is the interval at the start-stop speed.
    segment = segment_of(2_000_000, Move(2 * 29 + 1, 500, 65_600 << 8, 10 << 8))
    head = (150, 150, 0)
    player = Player(firmware, HoldableMotion(end_motion([segment] * 4), [head] * 4, (0.0,), (60_000, 60_000)))
    player.start()
    player.play_until(player.board.now + wait)
    player.board.receive(bytes([HOLD_CODE]))
    hold = player.board.now
    player.play_until(player.board.now + 10**9, State.HELD)
    assert player.board.now - hold < 80_000


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(0, 1_500_000), min_size=1, max_size=4), st.integers(0, 300_000))
def test_slow_moves_lose_no_step_when_held(native_firmware: NativeFirmware, waits: list[int], pause: int) -> None:
    player = Player(native_firmware, slow_motion())
    player.start()
    player.hold_and_resume(waits, pause)
    player.assert_all_steps_made()
    for joint in range(JOINTS):
        rises = player.board.rises(joint)
        planned = [tick for tick, _ in Schedule.of(player.motion.segments).steps[joint]]
        assert len(rises) == len(planned)
        # Slower than planned at times, never faster.
        assert all(b - a >= q - p - 1 for (a, b), (p, q) in zip(pairwise(rises), pairwise(planned), strict=True))


@pytest.mark.parametrize("percent", [60, 7, 1])
def test_the_rate_that_is_told_is_that_of_the_steps(firmware: Firmware, percent: int) -> None:
    # In mid-motion, where joint 1 makes a step each 800 ticks: down to the override without a way back, and up again.
    player = Player(firmware, Profile((20_000.0, 12_360.0), (400_000.0, 400_000.0), 0.8, 90).motion())
    player.start()
    player.play_until(player.board.now + 20 * SEGMENT_TICKS)
    for asked, sign in ((percent, -1), (100, 1)):
        player.board.send(Override(asked))
        rates = [player.fill().rate_percent]
        while rates[-1] != asked:
            player.board.run(4000)
            rates.append(player.fill().rate_percent)
            assert len(rates) < 1000, rates[-1]
        assert rates == sorted(rates, reverse=sign < 0)
        assert len(set(rates)) > 4, "it changes little by little"
        player.board.run(2 * SEGMENT_TICKS * 100 // asked)
        interval = player.board.rises(0)[-1] - player.board.rises(0)[-2]
        assert interval == pytest.approx(800 * 100 / asked, abs=TICKS_OFF)
        assert player.board.ask_now().rate_percent == asked
    player.assert_all_steps_made()


def test_at_full_rate_the_schedule_is_the_plan_bit_by_bit(firmware: Firmware) -> None:
    player = Player(firmware, FAST)
    player.board.ask(Override(37))
    assert player.board.ask(Override(100)).override_percent == 100
    player.start()
    player.assert_all_steps_made()
    begin = begin_of(player)
    for joint in range(JOINTS):
        planned = [begin + tick for tick, _ in Schedule.of(FAST.segments).steps[joint]]
        assert player.board.rises(joint) == planned


def test_a_motion_does_not_starve_by_the_need_of_the_one_before(firmware: Firmware) -> None:
    # Stopped at full rate, the arm goes on from rest with less road than it needed then, and more than it needs now.
    player = Player(firmware, FAST)
    player.start()
    player.play_until(player.board.now + 14 * SEGMENT_TICKS)
    needed = max(head[2] for head in FAST.heads[:14]) * NEED_UNIT_TICKS
    player.board.send(Stop(1))
    player.play_until(player.board.now + 10**8, State.READY, feed=False)
    road, read_ahead = 12, 4
    needs_now = FAST.heads[read_ahead][2] * NEED_UNIT_TICKS + STARVING_TICKS
    assert needs_now < (road - read_ahead) * SEGMENT_TICKS < road * SEGMENT_TICKS < needed + STARVING_TICKS
    for segment, head in zip(FAST.segments[:road], FAST.heads, strict=False):
        player.board.send(Segments(*head, (segment,)))
        player.board.run(6000)
    player.board.send(Start(LEAD_TICKS))
    player.board.run(LEAD_TICKS + SEGMENT_TICKS + 20_000)
    status = player.board.ask_now()
    assert status.state is State.RUNNING


def test_a_silent_host_brings_the_arm_to_rest_on_the_path(firmware: Firmware) -> None:
    # Nothing more comes: the arm slows down and rests before the road ends; then the host comes back.
    player = Player(firmware, FAST)
    player.start()
    player.play_until(player.board.now + 12 * SEGMENT_TICKS)
    sent = len(FAST.segments) - len(player.waiting)
    assert player.waiting
    status = player.play_until(player.board.now + 10**8, State.STARVED, State.FAULT, feed=False)
    assert status.state is State.STARVED
    assert status.ledger.executed_segments < sent
    made = [len(player.board.rises(joint)) for joint in range(JOINTS)]
    player.board.run(5_000_000)
    assert [len(player.board.rises(joint)) for joint in range(JOINTS)] == made
    player.assert_all_steps_made()


def test_a_quick_stop_takes_less_way_and_less_time(native_firmware: NativeFirmware) -> None:
    """At most twice what continuous time would take with all of the allowance, or half of it: u' = -rate."""

    def stopped(quick: int) -> tuple[int, int]:
        player = Player(native_firmware, FAST)
        player.start()
        player.play_until(player.board.now + 25 * SEGMENT_TICKS)
        asked, before = player.board.now, len(player.board.rises(0))
        player.board.send(Stop(quick))
        player.play_until(asked + 10**8, State.READY, feed=False)
        rises = player.board.rises(0)
        return len(rises) - before, rises[-1] - asked

    (way, ticks), (quick_way, quick_ticks) = stopped(0), stopped(1)
    latest = 2 * SEGMENT_TICKS  # what is prepared, and the slice in which the clock comes to rest
    rate = rate_value(FAST.heads[25][0]) / 2**32
    calm = 800 / FAST.start_stop_ticks[0]
    assert quick_ticks <= 2 * (1 - calm) / rate + latest
    assert ticks <= 4 * (1 - calm) / rate + latest
    assert quick_way < way
    assert quick_ticks < ticks


@pytest.mark.parametrize("quick", [0, 1])
def test_stop_drops_the_rest_and_keeps_the_position(firmware: Firmware, quick: int) -> None:
    player = Player(firmware, FAST)
    player.start()
    player.play_until(player.board.now + 25 * SEGMENT_TICKS)
    player.board.send(Stop(quick))
    status = player.play_until(player.board.now + 10**8, State.READY, feed=False)
    assert status.fault is Fault.NONE
    made = tuple(player.board.position_at(joint, player.board.now) for joint in range(JOINTS))
    assert status.ledger.position_usteps == made
    assert 0 < abs(made[0]) < abs(Schedule.of(FAST.segments).positions()[0])
    player.board.run(2_000_000)
    assert tuple(player.board.position_at(joint, player.board.now) for joint in range(JOINTS)) == made
    assert player.board.ask(Start(LEAD_TICKS)).state is State.READY, "nothing is queued any more"


@pytest.mark.parametrize("phase", range(0, 60_000, 15_000))
@pytest.mark.parametrize(
    ("first", "add", "steps"), [(1000, 2142, 8), (300, 60, 40), (6000, 1800, 6), (16_000, -2000, 5)]
)
def test_a_hold_where_intervals_change_much(
    native_firmware: NativeFirmware, first: int, add: int, steps: int, phase: int
) -> None:
    # The stretch doubles from slice to slice: of growing intervals the first would be fitted below nothing, of
    # shrinking ones the mean above both ends. The hold rests, and RESUME makes every step.
    board = Board(native_firmware)
    board.hello()
    board.ask(Config(PinMap.OWN, JOINTS, 0, 0, 0, 160_000, 0, (160_000, 160_000)))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    motion = end_motion([segment_of(62_500, run_of(steps, first=0, interval=first, add=add))] * 20)
    for segment in motion:
        board.ask(Segments(0xFF, 0xFF, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 300_000 + phase)
    board.receive(bytes([HOLD_CODE]))
    board.run(200_000_000)
    status = board.ask()
    assert (status.state, status.fault) == (State.HELD, Fault.NONE)
    assert status.ledger.position_usteps[0] == len(board.rises(0)) < 20 * steps
    board.send(Resume())
    board.run(400_000_000)
    status = board.ask()
    assert (status.state, status.fault) == (State.READY, Fault.NONE)
    assert status.ledger.position_usteps[0] == len(board.rises(0)) == 20 * steps


def test_hold_on_the_emulated_chip(emulated_firmware: EmulatedFirmware) -> None:
    player = Player(emulated_firmware, FAST)
    player.start()
    player.play_until(player.board.now + 25 * SEGMENT_TICKS)
    hold_tick = player.board.now
    player.board.receive(bytes([HOLD_CODE]))
    player.play_until(hold_tick + 10**8, State.HELD)
    hold, made = held_at(player, hold_tick)
    player.board.send(Resume())
    player.assert_all_steps_made()
    assert_resumed_as_predicted(player, hold, made)


def fill(board: Board, waiting: deque[Segment]) -> Status:
    """Send what the queue takes of segments without a need."""
    status = board.ask_now()
    free = status.free_bytes
    while waiting and free >= encoded_bytes(message := Segments(160, 160, 0, (waiting[0],))):
        free -= encoded_bytes(message) + QUEUE_FRAME_BYTES
        board.send(message)
        waiting.popleft()
        board.run(6000)
    return status


@pytest.mark.parametrize("seed", [2, 3, 4, 6])
def test_no_step_comes_before_the_least_interval(native_firmware: NativeFirmware, seed: int) -> None:
    # Joint 1 at its top rate; overrides little below 100 %, holds and resumes as chance has them.
    chance = random.Random(seed)
    board = Board(native_firmware)
    board.get_ready()
    waiting = deque(end_motion(fast(MIN_INTERVAL_TICKS, 1.7, SEGMENT_TICKS, 40)))
    while waiting and fill(board, waiting).free_bytes > 60:
        pass
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS)
    while (status := fill(board, waiting)).state not in (State.READY, State.FAULT):
        if status.state is State.HELD:
            board.send(Resume())
        elif chance.random() < 0.05:
            board.receive(bytes([HOLD_CODE]))
        elif chance.random() < 0.5:
            board.send(Override(chance.choice([100, 100, 99, 98, 95, 70])))
        board.run(chance.randrange(20_000, 60_000))
    assert (status.state, status.fault) == (State.READY, Fault.NONE)
    rises = board.rises(0)
    assert min(later - tick for tick, later in pairwise(rises)) == MIN_INTERVAL_TICKS


def test_no_step_comes_before_the_least_interval_where_the_stretch_begins_and_ends(firmware: Firmware) -> None:
    # Steps in all phases of slices whose stretch is 1 and a little.
    board = Board(firmware)
    board.get_ready()
    waiting = deque(end_motion(fast(MIN_INTERVAL_TICKS, 2.0, 4 * SEGMENT_TICKS - 30, 30)))
    while waiting and fill(board, waiting).free_bytes > 60:
        pass
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 100_000)
    percent = 99
    while fill(board, waiting).state is State.RUNNING:
        board.send(Override(percent))
        percent = 199 - percent
        board.run(120_000)
    status = board.ask()
    assert (status.state, status.fault) == (State.READY, Fault.NONE)
    rises = board.rises(0)
    assert min(later - tick for tick, later in pairwise(rises)) == MIN_INTERVAL_TICKS
