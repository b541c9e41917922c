"""`[board]`: how the drivers are wired to the Uno, which with the arm's joints names the board and its flash image."""

from __future__ import annotations

from planarm.scene.strict_toml import Table
from planarm_wire.messages import BOARDS
from planarm_wire.wirings import OWN

BOARD_KEYS = ("wiring",)
WIRINGS = tuple(dict.fromkeys(board.pin_map for board in BOARDS.values()))


def parse_board(table: Table) -> str:
    """Return the wiring, a name of the wire's pin maps; own wiring where nothing is said.

    Raises:
        SceneError: there is no such wiring.
    """
    return table.choice("wiring", WIRINGS, OWN)
