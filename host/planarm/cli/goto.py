"""`planarm goto SCENE X Y`: plans a certified path from where the arm stands, and goes there."""

from __future__ import annotations

import argparse

from planarm.cli.arm import pose_rad, reached, tell_standing
from planarm.cli.progress import progress
from planarm.cli.scenes import tell_first_compile
from planarm.errors import UsageError


def execute(options: argparse.Namespace) -> int:
    """Plan, go, and tell where the arm stands then."""
    if (options.y_cm is None) == (not options.deg):
        raise UsageError("give the point X Y in cm, or joint angles: --deg ANGLE ...")
    tell_first_compile("planarm", "planarm_sim")
    from planarm.link.position import moved_usteps
    from planarm.operations.arm_moves import goto
    from planarm.streaming.plan_stream import telling
    from planarm.streaming.standing import look_and_configure

    with progress(options.json) as notice, reached(options) as arm:
        standing = look_and_configure(arm.transport, arm.port, arm.scene, arm.positions)
        pose = pose_rad(arm.scene, options.deg) if options.deg else None
        target_cm = None if options.deg else (options.x_cm, options.y_cm)
        watch = telling(notice, notice.watch)
        _, done = goto(arm.transport, arm.scene, standing, target_cm, watch, pose, notice.warn)
    moved = moved_usteps(done.ledger_before, done.ledger_after)[: len(standing.usteps)]
    usteps = tuple(at + by for at, by in zip(standing.usteps, moved, strict=True))
    tell_standing(options.json, arm.scene, usteps, standing.how, moved_usteps=list(moved))
    return 0
