"""Touching points with the arm itself: it goes to a few poses, and a person says where its tip is."""

from __future__ import annotations

import numpy as np

from planarm.bringup.calibrate import TouchedPoint
from planarm.bringup.nudge import Mover
from planarm.bringup.person import Person, ask_until, numbers
from planarm.errors import UsageError
from planarm.model.arm import Arm
from planarm.model.kinematics import ElbowSide, inverse_2r
from planarm.model.transmission import Transmission
from planarm.scene import Scene
from planarm.smoothing.smooth_path import Floats

RINGS = (0.55, 0.85)
"""Shares of the reach at which points are touched: near and far, so that both links show."""
BEARINGS_DEG = (30.0, 75.0, 120.0, 150.0)
FARTHEST_CM = 1e4


def touch_points(person: Person, scene: Scene, mover: Mover, count: int) -> list[TouchedPoint]:
    """Move to `count` poses, ask at each where the tip is, and return the points.

    Raises:
        UsageError: the arm has too few poses, or an answer cannot be read.
        PlanarmError: a motion is refused or fails.
    """
    transmission, points = Transmission.of(scene), []
    for number, pose in enumerate(touching_poses(scene, count), start=1):
        person.tell(f"\nPoint {number} of {count}")
        mover.go(scene, pose)
        tip = ask_until(person, "Where is the tip: x, y from the base (cm)", "", numbers(2, -FARTHEST_CM, FARTHEST_CM))
        usteps = np.floor(transmission.usteps(pose) + 0.5).astype(int)
        points.append(TouchedPoint(tuple(int(n) for n in usteps), (tip[0], tip[1])))
    return points


def touching_poses(scene: Scene, count: int) -> list[Floats]:
    """Return poses whose tips lie near and far in several directions, within the joints' limits.

    Raises:
        UsageError: there are not as many.
    """
    arm = Arm.from_spec(scene.arm)
    elbow: ElbowSide = "down" if scene.arm.elbow == "down" else "up"
    poses = []
    for bearing in np.radians(BEARINGS_DEG):
        for share in RINGS:
            tip = np.array(arm.base_cm) + share * arm.reach_cm * np.array([np.cos(bearing), np.sin(bearing)])
            pose = inverse_2r(arm, (float(tip[0]), float(tip[1])), elbow)
            inside = all(low <= q <= high for q, (low, high) in zip(pose, arm.joint_limits_rad, strict=True))
            if inside and not np.isnan(pose).any():
                poses.append(pose)
    if len(poses) < count:
        raise UsageError(f"the joints' limits leave {len(poses)} poses, {count} points are asked for; touch fewer")
    return poses[:count]
