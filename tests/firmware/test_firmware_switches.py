"""Limit switches and homing: each with its stated outcome, on the pins."""

from __future__ import annotations

from dataclasses import replace

import pytest

from firmware_board import (
    WAKE_TICKS,
    Board,
    Firmware,
)
from firmware_configured import (
    LIMITS,
    MOST_DEBOUNCE_TICKS,
    WIRING,
    Switches,
    moving,
)
from planarm_wire.messages import (
    DEBOUNCE_TICKS,
    MIN_HOMING_TICKS,
    Clear,
    Enable,
    Fault,
    Home,
    Result,
    State,
)


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
    switches.set(hit=0b10)
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
