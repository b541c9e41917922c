"""`planarm zero SCENE`: tells the board where an arm without limit switches stands."""

from __future__ import annotations

import argparse

from planarm.cli.arm import pose_rad, reached, tell_standing
from planarm.errors import UsageError


def execute(options: argparse.Namespace) -> int:
    """Tell where the arm stands: at the task's start, with the tip --at a point, or with the joints at --deg."""
    from planarm.streaming.standing import nearest, start_usteps, tell, usteps_at

    if options.at and options.deg:
        raise UsageError("give --at X Y or --deg, not both")
    with reached(options) as arm:
        if options.deg:
            usteps = nearest(arm.scene, pose_rad(arm.scene, options.deg))
        else:
            usteps = usteps_at(arm.scene, (options.at[0], options.at[1])) if options.at else start_usteps(arm.scene)
        tell(arm.transport, arm.port, arm.scene, arm.positions, usteps, "zeroed")
    tell_standing(options.json, arm.scene, usteps, "zeroed")
    return 0
