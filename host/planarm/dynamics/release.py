"""Whether an arm stays where it is when its drivers are released.

Without current a joint is held by its dry friction and by the detent torque of the motors, through their gears. Where
gravity asks for more, the arm falls: at the end of a run when the board is reset, after an idle time that releases, at
an emergency stop that does. Only a brake or a balance helps then.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from planarm.dynamics.rigid_body import Floats, RigidBody, gravity_torques
from planarm.scene import Scene


@dataclass(frozen=True, slots=True)
class Falling:
    """A joint that would fall on release: its number from 1, and the torques in N m at the angles told."""

    joint: int
    gravity_nm: float
    held_nm: float
    q_rad: tuple[float, ...]

    def __str__(self) -> str:
        angles = ", ".join(f"{angle:.1f}" for angle in np.rad2deg(self.q_rad))
        return (
            f"joint {self.joint} falls when the drivers are released: at [{angles}] degrees gravity pulls with "
            f"{self.gravity_nm:.2f} N m, friction and detent torque hold {self.held_nm:.2f} N m; "
            "give it a brake or a balance, or hold it whenever the board is reset, the supply fails or a stop releases"
        )


def held_without_current_nm(scene: Scene) -> Floats:
    """Return the torque that each joint holds without current, shape (joints,)."""
    detent = np.array([joint.motor.detent_torque_nm * abs(joint.gear_ratio) for joint in scene.joints])
    held: Floats = np.abs(np.array(scene.coupling)).T @ detent + np.array(scene.mechanics.coulomb_friction_nm)
    return held


def falls_on_release(scene: Scene, poses_rad: Iterable[Floats]) -> Falling | None:
    """Return the joint that gravity overcomes most in any of the poses, or None when the arm stays in all of them."""
    if not scene.mechanics.gravity:
        return None
    body, held = RigidBody.of(scene), held_without_current_nm(scene)
    worst: Falling | None = None
    for q_rad in poses_rad:
        pulls = np.abs(gravity_torques(body, np.asarray(q_rad, np.float64)))
        joint = int(np.argmax(pulls - held))
        found = Falling(joint + 1, float(pulls[joint]), float(held[joint]), tuple(map(float, q_rad)))
        excess = found.gravity_nm - found.held_nm
        if excess > 0.0 and (worst is None or excess > worst.gravity_nm - worst.held_nm):
            worst = found
    return worst
