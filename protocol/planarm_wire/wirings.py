"""Which board, and so which flash image, an arm needs: by its joints and by where its drivers are wired."""

from __future__ import annotations

from planarm_wire.boards import Board
from planarm_wire.errors import WireError
from planarm_wire.messages import BOARDS

OWN = "own"


def wirings(joints: int = 1) -> tuple[str, ...]:
    """Return the names of the wirings with pins for so many joints, the own one first."""
    return tuple(dict.fromkeys(board.pin_map for board in BOARDS.values() if board.joints >= joints))


def pins_of(board: Board) -> dict[str, str]:
    """Return which pins of the Uno do what on a board, in words for people."""
    joints = enumerate(board.joint_pins, start=1)
    return {
        **{f"joint {number}": f"STEP {step}, DIR {direction}" for number, (step, direction) in joints},
        "drivers": f"ENABLE {board.enable_pin}",
        "stop input": board.stop_pin,
        "limit switches": ", ".join(board.limit_pins),
    }


def pin_words(board: Board) -> str:
    """Return the same on one line."""
    return "; ".join(f"{what} {which}" for what, which in pins_of(board).items())


def board_of(joints: int, pin_map: str = OWN) -> Board:
    """Return the board with the fewest joints that has enough of them.

    Raises WireError when no board of this wiring steps so many.
    """
    wired = [board for board in BOARDS.values() if board.pin_map == pin_map]
    if not wired:
        raise WireError(f"no wiring {pin_map!r} is known; there are {', '.join(wirings())}")
    fitting = [board for board in wired if board.joints >= joints]
    if not fitting:
        most = max(board.joints for board in wired)
        raise WireError(f"an arm with {joints} joints; the wiring {pin_map} has pins for {most}")
    return min(fitting, key=lambda board: board.joints)


def boards_alike(board: Board) -> tuple[Board, ...]:
    """Return the board and then the others with the same pins, which differ in the pulses that they make."""
    return (board, *(one for one in BOARDS.values() if one != board and one.driver_pins == board.driver_pins))
