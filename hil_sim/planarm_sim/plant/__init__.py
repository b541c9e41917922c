"""Motors, gears and a planar arm that move by physics of their own, and hit what stands in their way."""

from __future__ import annotations

from planarm_sim.plant.happenings import Contact, Slip, StopHit, SwitchChange
from planarm_sim.plant.plant import Plant
from planarm_sim.plant.spec import CircleObstacle, Joint, LimitSwitch, Link, Motor, PolygonObstacle, Rig, desk_arm

__all__ = [
    "CircleObstacle",
    "Contact",
    "Joint",
    "LimitSwitch",
    "Link",
    "Motor",
    "Plant",
    "PolygonObstacle",
    "Rig",
    "Slip",
    "StopHit",
    "SwitchChange",
    "desk_arm",
]
