"""`planarm home SCENE`: every joint to its limit switch, in the scene's order of switches."""

from __future__ import annotations

import argparse

from planarm.cli.arm import reached, tell_standing


def execute(options: argparse.Namespace) -> int:
    """Home, and tell where the arm stands then."""
    from planarm.operations.arm_moves import home

    with reached(options) as arm:
        usteps = home(arm.transport, arm.port, arm.scene, arm.positions)
    tell_standing(options.json, arm.scene, usteps, "homed")
    return 0
