"""`[board]`: how drivers are wired to the Uno. With the joints and their drivers it names the board and its image."""

from __future__ import annotations

from collections.abc import Sequence

from planarm.scene.joint import JointSpec
from planarm.scene.mechanics import Matrix
from planarm.scene.pulses import short_pulse
from planarm.scene.strict_toml import Table
from planarm_wire.errors import WireError
from planarm_wire.messages import BOARDS
from planarm_wire.wirings import OWN, board_of, boards_alike

BOARD_KEYS = ("wiring",)
WIRINGS = tuple(dict.fromkeys(board.pin_map for board in BOARDS.values()))


def parse_board(table: Table, joints: Sequence[JointSpec], coupling: Matrix) -> str:
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
