"""`planarm jog SCENE JOINT DEGREES`: turns one joint; among the obstacles where the arm's place is known."""

from __future__ import annotations

import argparse
from math import radians

from planarm.cli.arm import reached, tell_standing
from planarm.cli.progress import progress
from planarm.cli.scenes import tell_first_compile
from planarm.errors import UsageError


def execute(options: argparse.Namespace) -> int:
    """Turn, and tell where the arm stands then."""
    tell_first_compile("planarm", "planarm_sim")
    from planarm.link.position import moved_usteps
    from planarm.operations.arm_moves import jog
    from planarm.streaming.plan_stream import telling
    from planarm.streaming.standing import look_and_configure

    with progress(options.json) as notice, reached(options) as arm:
        if not 1 <= options.joint <= len(arm.scene.joints):
            raise UsageError(f"joint {options.joint}: the scene has joints 1 to {len(arm.scene.joints)}")
        standing = look_and_configure(arm.transport, arm.port, arm.scene, arm.positions)
        turn_rad = radians(options.degrees)
        watch = telling(notice, notice.watch)
        _, done = jog(arm.transport, arm.scene, standing, options.joint - 1, turn_rad, watch, notice.warn)
    moved = moved_usteps(done.ledger_before, done.ledger_after)[: len(standing.usteps)]
    usteps = tuple(at + by for at, by in zip(standing.usteps, moved, strict=True))
    tell_standing(options.json, arm.scene, usteps, standing.how, moved_usteps=list(moved))
    return 0
