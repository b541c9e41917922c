"""The supervisor's table, row by row: every event in every state, on the native core."""

from __future__ import annotations

import pytest

from firmware_board import SUPERVISOR_EVENTS, Board, NativeFirmware
from planarm_wire.messages import State

S = State
TABLE: dict[State, dict[str, State]] = {
    S.IDLE: {
        "enable": S.READY,
        "release": S.IDLE,
        "clear_kept": S.IDLE,
        "config": S.IDLE,
        "soft_limits": S.IDLE,
        "set_position": S.IDLE,
    },
    S.READY: {
        "enable": S.READY,
        "release": S.IDLE,
        "segments": S.READY,
        "start": S.RUNNING,
        "clear_kept": S.READY,
        "stop": S.READY,
        "quick_stop": S.READY,
        "soft_limits": S.READY,
        "set_position": S.READY,
        "home": S.HOMING,
    },
    S.RUNNING: {
        "segments": S.RUNNING,
        "hold": S.HOLDING,
        "stop": S.STOPPING,
        "quick_stop": S.STOPPING,
        "starved": S.STARVED,
        "done": S.READY,
    },
    S.HOLDING: {
        "segments": S.HOLDING,
        "resume": S.RUNNING,
        "stop": S.STOPPING,
        "quick_stop": S.STOPPING,
        "at_rest": S.HELD,
        "done": S.READY,
    },
    S.HELD: {
        "release": S.IDLE,
        "segments": S.HELD,
        "clear_kept": S.READY,
        "resume": S.RUNNING,
        "stop": S.READY,
        "quick_stop": S.READY,
    },
    S.STARVED: {
        "release": S.IDLE,
        "segments": S.STARVED,
        "clear_kept": S.READY,
        "hold": S.HOLDING,
        "stop": S.READY,
        "quick_stop": S.READY,
        "fed": S.RUNNING,
    },
    S.STOPPING: {"stop": S.STOPPING, "quick_stop": S.STOPPING, "at_rest": S.READY, "done": S.READY},
    S.HOMING: {"hold": S.READY, "stop": S.READY, "quick_stop": S.READY, "done": S.READY},
    S.FAULT: {"clear": S.IDLE, "clear_kept": S.READY},
}
"""docs/protocol.md, states and messages; what is not listed is refused and changes nothing."""

WAYS = {
    S.IDLE: "",
    S.READY: "enable",
    S.RUNNING: "enable start",
    S.HOLDING: "enable start hold",
    S.HELD: "enable start hold at_rest",
    S.STARVED: "enable start starved",
    S.STOPPING: "enable start stop",
    S.HOMING: "enable home",
}


@pytest.mark.parametrize("state", WAYS)
@pytest.mark.parametrize("event", SUPERVISOR_EVENTS)
def test_every_event_in_every_state(native_firmware: NativeFirmware, state: State, event: str) -> None:
    Board(native_firmware)  # powers on
    for step in WAYS[state].split():
        assert native_firmware.signal(SUPERVISOR_EVENTS.index(step)), step
    assert native_firmware.state() == state
    allowed = native_firmware.signal(SUPERVISOR_EVENTS.index(event))
    assert allowed == (event in TABLE[state])
    assert native_firmware.state() == TABLE[state].get(event, state)


@pytest.mark.parametrize("event", SUPERVISOR_EVENTS)
def test_a_fault_waits_for_clear(native_firmware: NativeFirmware, event: str) -> None:
    Board(native_firmware)
    native_firmware.latch(3)
    allowed = native_firmware.signal(SUPERVISOR_EVENTS.index(event))
    assert allowed == (event in TABLE[S.FAULT])
    assert native_firmware.state() == TABLE[S.FAULT].get(event, S.FAULT)
