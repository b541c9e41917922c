"""`[board]`: how drivers, stop circuit and power are wired to the Uno. With the joints it names the board's image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from planarm.scene.joint import JointSpec
from planarm.scene.limit_switches import LimitSwitchSpec
from planarm.scene.mechanics import Matrix
from planarm.scene.pulses import short_pulse
from planarm.scene.strict_toml import Table
from planarm_wire.errors import WireError
from planarm_wire.messages import BOARDS, DEFAULT_WAKE_TICKS, TICKS_HZ
from planarm_wire.wirings import OWN, board_of, boards_alike

BOARD_KEYS = ("wiring", "stop_input", "emergency_releases", "enable_active_high", "idle_release_s", "wake_ms")
WIRINGS = tuple(dict.fromkeys(board.pin_map for board in BOARDS.values()))
DEFAULT_WAKE_S = DEFAULT_WAKE_TICKS / TICKS_HZ
LONGEST_WAKE_MS = 10_000.0
LEAST_IDLE_S = 5.0
"""A queue is filled within that on every line that carries a motion, and the drivers stay on meanwhile."""
MOST_IDLE_S = 86_400.0


@dataclass(frozen=True, slots=True)
class BoardSpec:
    """What the board is told of its surroundings, besides its pins.

    Attributes:
        stop_input: a normally closed stop contact is wired to the stop input, and ends all pulses when it opens.
        emergency_releases: an emergency stop, or the stop input, releases the drivers; else they go on holding.
        enable_active_high: ENABLE is high where the drivers are on.
        idle_release_s: the drivers are released after so long at rest; None: never.
        wake_s: least time from ENABLE to the first step.
    """

    stop_input: bool = False
    emergency_releases: bool = False
    enable_active_high: bool = False
    idle_release_s: float | None = None
    wake_s: float = DEFAULT_WAKE_S


def parse_wiring(table: Table, joints: Sequence[JointSpec], coupling: Matrix) -> str:
    """Return the wiring, a name of the wire's pin maps; own wiring where nothing is said.

    Where drivers need longer pulses it is that of the board with the same pins that makes them, if there is one.

    Raises:
        SceneError: there is no such wiring.
    """
    wiring = table.choice("wiring", WIRINGS, OWN)
    try:
        board = board_of(len(joints), wiring)
    except WireError:
        return wiring  # such an arm can be searched, not moved
    fitting = (one for one in boards_alike(board) if short_pulse(joints, coupling, one) is None)
    return next(fitting, board).pin_map


def parse_board(table: Table) -> BoardSpec:
    """Read what the board is told.

    Raises:
        SceneError: a value is not what its key takes.
    """
    idle_s = table.number("idle_release_s", 0.0, at_least=0.0, at_most=MOST_IDLE_S)
    if 0.0 < idle_s < LEAST_IDLE_S:
        table.reject("idle_release_s", idle_s, f"0 (never) or a number of seconds from {LEAST_IDLE_S:g} on")
    wake_ms = table.number("wake_ms", 1e3 * DEFAULT_WAKE_S, at_least=0.0, at_most=LONGEST_WAKE_MS)
    return BoardSpec(
        stop_input=table.flag("stop_input", False),
        emergency_releases=table.flag("emergency_releases", False),
        enable_active_high=table.flag("enable_active_high", False),
        idle_release_s=idle_s if idle_s > 0.0 else None,
        wake_s=1e-3 * wake_ms,
    )


def require_inputs(root: Table, switches: Sequence[LimitSwitchSpec], wiring: str, joints: int) -> None:
    """Check that every limit switch is where the board looks for that of its joint.

    Raises:
        SceneError: one is not, so that nothing would watch it.
    """
    try:
        board = board_of(joints, wiring)
    except WireError:
        return  # such an arm can be searched, not moved
    for number, switch in enumerate(switches, start=1):
        wanted = board.limit_pins[switch.joint - 1]
        if switch.pin != wanted:
            root.fail(
                f"limit_switches[{number}].pin",
                f"{switch.pin!r} given, {wanted!r} expected: there the board {board.name} looks for the switch of joint"
                f" {switch.joint}",
            )
