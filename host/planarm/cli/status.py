"""`planarm status SCENE`: what the board does, and where its arm stands."""

from __future__ import annotations

import argparse

from planarm.cli.arm import reached, tell_standing
from planarm_wire.wirings import pins_of


def execute(options: argparse.Namespace) -> int:
    """Ask, and tell."""
    from planarm.link.doctor import ask_board
    from planarm.streaming.standing import look

    with reached(options) as arm:
        board = ask_board(arm.transport)
        standing = look(arm.transport, arm.port, arm.scene, arm.positions)
    made_for = arm.scene.board
    # An image refuses what is asked of another wiring, but an idle one is not asked (link.exchange.open_on_board).
    by = "the scene" if board["state"] == "idle" else "the image"
    wiring = {"board": made_for.name, "known_by": by, "pins": pins_of(made_for)}
    tell_standing(options.json, arm.scene, standing.usteps, standing.how, board=board, wiring=wiring)
    return 0
