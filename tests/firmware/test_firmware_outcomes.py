"""The supervisor's outcomes, row by row: what drivers, motion and homing do after every event in every state.

test_firmware_supervisor.py tries the table's states. Here each state is come to in earnest, by a motion that is held,
starved or stopped, and the outcome is seen on the pins and in what STATUS tells. A row that is not there
does nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto

import pytest

from firmware_board import SUPERVISOR_EVENTS, Edge, NativeFirmware, room_after
from firmware_player import FAST, Player
from planarm_wire.messages import (
    DEBOUNCE_TICKS,
    ENABLE_PIN,
    HOLD_CODE,
    Enable,
    Fault,
    Home,
    State,
    Status,
    Stop,
)
from stretch_motion import SEGMENT_TICKS

S = State
MS_TICKS = 16_000
AT_FULL_PACE = 25 * SEGMENT_TICKS
RELEASED_LEVEL = 1
HOMING_TICKS = 20_000
LIMIT_SWITCHES = 8  # a bit of CONFIG's options


class Outcome(Enum):
    """As in firmware/core/supervisor.h."""

    NONE = auto()
    ENERGISE = auto()
    RELEASE = auto()
    DROP = auto()
    GO = auto()
    REST = auto()
    REST_QUICKLY = auto()
    FORGET = auto()


NONE, DROP, FORGET, GO, RELEASE = Outcome.NONE, Outcome.DROP, Outcome.FORGET, Outcome.GO, Outcome.RELEASE
REST, REST_QUICKLY = Outcome.REST, Outcome.REST_QUICKLY
OUTCOMES: dict[State, dict[str, Outcome]] = {
    S.IDLE: {"enable": Outcome.ENERGISE, "release": NONE, "clear_kept": RELEASE},
    S.READY: {
        "enable": NONE,
        "release": RELEASE,
        "segments": NONE,
        "clear_kept": FORGET,
        "stop": DROP,
        "quick_stop": DROP,
        "soft_limits": NONE,
        "set_position": NONE,
        "home": DROP,
    },
    S.RUNNING: {
        "segments": NONE,
        "hold": REST,
        "stop": REST,
        "quick_stop": REST_QUICKLY,
        "starved": NONE,
        "done": NONE,
    },
    S.HOLDING: {
        "segments": NONE,
        "resume": GO,
        "stop": REST,
        "quick_stop": REST_QUICKLY,
        "at_rest": NONE,
        "done": NONE,
    },
    S.HELD: {
        "release": RELEASE,
        "segments": NONE,
        "clear_kept": FORGET,
        "resume": GO,
        "stop": DROP,
        "quick_stop": DROP,
    },
    S.STARVED: {
        "release": RELEASE,
        "segments": NONE,
        "clear_kept": FORGET,
        "hold": REST,
        "stop": DROP,
        "quick_stop": DROP,
        "fed": NONE,
    },
    S.STOPPING: {"stop": NONE, "quick_stop": REST_QUICKLY, "at_rest": DROP, "done": NONE},
    S.HOMING: {"hold": DROP, "stop": DROP, "quick_stop": DROP, "done": DROP},
    S.FAULT: {"clear": RELEASE, "clear_kept": FORGET},
}
"""START is GO, too: that a motion starts is shown everywhere."""


def run_up_to(player: Player, state: State) -> Status:
    """Come to a state of a motion at full pace, fed until then."""
    player.start()
    player.play_until(player.board.now + AT_FULL_PACE)
    if state in (S.HOLDING, S.HELD):
        player.board.receive(bytes([HOLD_CODE]))
    elif state is S.STOPPING:
        player.board.send(Stop(0))
    return player.play_until(player.board.now + 10**8, state, feed=False)


def come_to(firmware: NativeFirmware, state: State) -> Player:
    """A board in a state; where one has a motion, it is queued, and at its full pace before it slows down."""
    player = Player(firmware, FAST, options=LIMIT_SWITCHES)
    board = player.board
    if state is S.IDLE:
        board.ask(Enable(0))
    elif state is S.READY:
        player.fill()
    elif state is S.HOMING:
        board.ask(Home(0, 1, HOMING_TICKS, 2 * DEBOUNCE_TICKS, 1000, 100))
        board.run(10 * HOMING_TICKS)
    elif state is S.FAULT:
        firmware.latch(Fault.BAD_SEGMENT)
    else:
        run_up_to(player, state)
    assert firmware.state() is state
    board.edges.clear()
    return player


def signal(firmware: NativeFirmware, event: str) -> None:
    assert firmware.signal(SUPERVISOR_EVENTS.index(event))


def after(player: Player, ms: int) -> tuple[list[Edge], Status]:
    """All edges of some milliseconds, without a byte on the line, and what is told then."""
    player.board.run(ms * MS_TICKS)
    edges = list(player.board.edges)
    return edges, player.board.ask_now()


def motion_of(edges: list[Edge]) -> list[Edge]:
    return [edge for edge in edges if edge.pin != ENABLE_PIN]


def assert_nothing_happens(firmware: NativeFirmware, state: State, event: str) -> None:
    undisturbed, told = after(come_to(firmware, state), 5)
    player = come_to(firmware, state)
    signal(firmware, event)
    edges, status = after(player, 5)
    assert edges == undisturbed
    assert (status.free_bytes, status.rate_percent, status.ledger) == (told.free_bytes, told.rate_percent, told.ledger)


def assert_dropped(player: Player) -> None:
    """No step from now on, nothing in the queue, no fault."""
    edges, status = after(player, 100)
    assert motion_of(edges) == []
    assert (status.fault, status.free_bytes) == (Fault.NONE, room_after())


def assert_dropped_with_the_drivers_as_they_were(firmware: NativeFirmware, state: State, event: str) -> None:
    player = come_to(firmware, state)
    signal(firmware, event)
    assert_dropped(player)
    assert [edge for edge in player.board.edges if edge.pin == ENABLE_PIN] == []


def assert_released(firmware: NativeFirmware, state: State, event: str) -> None:
    player = come_to(firmware, state)
    signal(firmware, event)
    assert_dropped(player)
    levels = [edge.level for edge in player.board.edges if edge.pin == ENABLE_PIN]
    assert levels == ([] if state is S.IDLE else [RELEASED_LEVEL])


def assert_energised(firmware: NativeFirmware, state: State, event: str) -> None:
    player = come_to(firmware, state)
    signal(firmware, event)
    edges, _ = after(player, 5)
    assert [(edge.pin, edge.level) for edge in edges] == [(ENABLE_PIN, 1 - RELEASED_LEVEL)]


def assert_goes_on(firmware: NativeFirmware, state: State, event: str) -> None:
    player = come_to(firmware, state)
    signal(firmware, event)
    player.assert_all_steps_made()


def steps_to_rest(firmware: NativeFirmware, state: State, event: str | None) -> int:
    """Joint 1's steps until the path clock stands because it was told to."""
    player = come_to(firmware, state)
    if event is not None:
        signal(firmware, event)
    status = player.play_until(player.board.now + 10**8, S.HELD, S.READY, feed=False)
    made = len(player.board.rises(0))
    edges, _ = after(player, 50)
    assert len(motion_of(edges)) == len(motion_of(player.board.edges)) and len(player.board.rises(0)) == made
    assert status.fault is Fault.NONE
    return made


def assert_rests(firmware: NativeFirmware, state: State, event: str) -> None:
    made = steps_to_rest(firmware, state, event)
    assert made == 0 if state is S.STARVED else made > 100
    assert firmware.state() is (S.HELD if event == "hold" else S.READY)


def assert_rests_quickly(firmware: NativeFirmware, state: State, event: str) -> None:
    gently = steps_to_rest(firmware, state, "stop" if state is S.RUNNING else None)
    assert 100 < steps_to_rest(firmware, state, event) < 0.9 * gently


SHOWN_BY: dict[Outcome, Callable[[NativeFirmware, State, str], None]] = {
    NONE: assert_nothing_happens,
    Outcome.ENERGISE: assert_energised,
    RELEASE: assert_released,
    DROP: assert_dropped_with_the_drivers_as_they_were,
    FORGET: assert_dropped_with_the_drivers_as_they_were,
    GO: assert_goes_on,
    REST: assert_rests,
    REST_QUICKLY: assert_rests_quickly,
}


@pytest.mark.parametrize(("state", "event"), [(state, event) for state, events in OUTCOMES.items() for event in events])
def test_every_rows_outcome(native_firmware: NativeFirmware, state: State, event: str) -> None:
    SHOWN_BY[OUTCOMES[state][event]](native_firmware, state, event)


@pytest.mark.parametrize("state", [S.RUNNING, S.HOLDING, S.STOPPING])
def test_a_limit_switch_is_watched_wherever_joints_move(native_firmware: NativeFirmware, state: State) -> None:
    player = come_to(native_firmware, state)
    native_firmware.set_inputs(0b10)
    player.board.run(DEBOUNCE_TICKS * 3 // 2 + MS_TICKS)
    status = player.board.ask_now()
    assert (status.state, status.fault, status.detail) == (S.FAULT, Fault.LIMIT_SWITCH, 1)
    assert status.ledger.position_usteps[0] != 0
