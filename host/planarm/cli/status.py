"""`planarm status SCENE`: what the board does, and where its arm stands."""

from __future__ import annotations

import argparse

from planarm.cli.arm import reached, tell_standing


def execute(options: argparse.Namespace) -> int:
    """Ask, and tell."""
    from planarm.link.doctor import ask_board
    from planarm.streaming.standing import look

    with reached(options) as arm:
        board = ask_board(arm.transport)
        standing = look(arm.transport, arm.port, arm.scene, arm.positions)
    tell_standing(options.json, arm.scene, standing.usteps, standing.how, board=board)
    return 0
