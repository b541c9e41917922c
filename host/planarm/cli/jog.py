"""`planarm jog SCENE JOINT DEGREES`: turns one joint; among the obstacles where the arm's place is known."""

from __future__ import annotations

import argparse
from math import degrees as in_degrees
from math import radians
from typing import TYPE_CHECKING

from planarm.cli.arm import reached, tell_standing
from planarm.cli.progress import progress
from planarm.cli.scenes import tell_first_compile
from planarm.errors import UsageError

if TYPE_CHECKING:
    from planarm.scene import Scene


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
        _require_within_limits(arm.scene, options.joint, options.degrees)
        standing = look_and_configure(arm.transport, arm.port, arm.scene, arm.positions)
        turn_rad = radians(options.degrees)
        watch = telling(notice, notice.watch)
        _, done = jog(arm.transport, arm.scene, standing, options.joint - 1, turn_rad, watch, notice.warn)
    moved = moved_usteps(done.ledger_before, done.ledger_after)[: len(standing.usteps)]
    usteps = tuple(at + by for at, by in zip(standing.usteps, moved, strict=True))
    tell_standing(options.json, arm.scene, usteps, standing.how, moved_usteps=list(moved))
    return 0


def _require_within_limits(scene: Scene, joint: int, degrees: float) -> None:
    """Refuse an angle that no joint can turn by wherever it stands; where that is known, the limits are watched, too.

    Raises:
        UsageError: it is wider than the joint's limits are apart.
    """
    least, most = (in_degrees(angle) for angle in scene.arm.joint_limits_rad[joint - 1])
    if abs(degrees) > most - least:
        raise UsageError(
            f"joint {joint}: {degrees:g} degrees given, but its limits are only {most - least:g} apart"
            f" ({least:g} to {most:g}, arm.joint_limits_deg); turn it by less"
        )
