"""`planarm zero SCENE`: tells the board where an arm without limit switches stands."""

from __future__ import annotations

import argparse

from planarm.cli.arm import reached, tell_standing


def execute(options: argparse.Namespace) -> int:
    """Tell the place of the tip: the task's start, or --at."""
    from planarm.streaming.standing import tell, usteps_at

    with reached(options) as arm:
        tip_cm = tuple(options.at) if options.at else arm.scene.task.start_cm
        usteps = usteps_at(arm.scene, (tip_cm[0], tip_cm[1]))
        tell(arm.transport, arm.port, arm.scene, arm.positions, usteps, "zeroed")
    tell_standing(options.json, arm.scene, usteps, "zeroed")
    return 0
