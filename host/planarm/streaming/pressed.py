"""What limit switches read at rest, held against where the arm is known to stand, before a motion.

The board lets an arm leave a switch that is pressed when a motion begins. One that reads pressed for another reason, as
a normally closed one with a broken wire does, would not be watched at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, radians

from planarm.model.transmission import Transmission
from planarm.scene import Scene

NEAR_RAD = radians(2.0)
"""So near its switch a joint may press it or not: by the switch's play, and by a step or two."""


def switch_doubts(scene: Scene, usteps: Sequence[int], inputs: int) -> str:
    """Return what contradicts the scene's limit switches, in words; "" when nothing does.

    Args:
        scene: the scene.
        usteps: where the motors are known to stand.
        inputs: of a status, debounced: bit j is set where the switch of joint j, from 0, reads pressed.
    """
    q_rad = Transmission.of(scene).q_rad(usteps)
    doubts = []
    for switch in scene.limit_switches:
        beyond_rad = (1.0 if switch.above else -1.0) * (float(q_rad[switch.joint - 1]) - switch.at_rad)
        reads = bool(inputs >> (switch.joint - 1) & 1)
        if abs(beyond_rad) > NEAR_RAD and reads != (beyond_rad > 0.0):
            doubts.append(
                f"joint {switch.joint}: its limit switch on {switch.pin} reads {'pressed' if reads else 'released'} at"
                f" {degrees(float(q_rad[switch.joint - 1])):.1f} degrees, and is pressed"
                f" {'above' if switch.above else 'below'} {degrees(switch.at_rad):.1f}"
            )
    if not doubts:
        return ""
    return (
        f"{'; '.join(doubts)}. Look for a broken wire, check limit_switches.normally_closed and at_deg; or the arm is"
        " not where it is said to be: 'planarm home SCENE'"
    )
