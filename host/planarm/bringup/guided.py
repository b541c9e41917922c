"""Touching points with the arm itself: it goes to a few poses, and a person says where its tip is."""

from __future__ import annotations

from math import radians

import numpy as np

from planarm.bringup.calibrate import TouchedPoint
from planarm.bringup.nudge import Mover
from planarm.bringup.person import Person, ask_until, numbers
from planarm.errors import UsageError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, tip_jacobian
from planarm.model.transmission import Transmission
from planarm.scene import Scene
from planarm.smoothing.smooth_path import Floats

CANDIDATES = 500
ROUNDS = 4
"""So often each is chosen."""
MOST_FOLDED_RAD = radians(110.0)
"""Between two links: the inner ones of an arm do not come near each other."""
BASES = (2, 3, 5, 7)
"""Of Halton's sequence, for each joint."""
FARTHEST_CM = 1e4


def touch_points(person: Person, scene: Scene, mover: Mover, count: int) -> list[TouchedPoint]:
    """Move to `count` poses, ask at each where the tip is, and return the points.

    Raises:
        UsageError: the arm has too few poses, or an answer cannot be read.
        PlanarmError: a motion is refused or fails.
    """
    transmission, points = Transmission.of(scene), []
    place = numbers(range(2, 3), -FARTHEST_CM, FARTHEST_CM)
    for number, pose in enumerate(touching_poses(scene, count), start=1):
        person.tell(f"\nPoint {number} of {count}")
        mover.go(scene, pose)
        tip = ask_until(person, "Where is the tip: x, y from the base (cm)", "", place)
        usteps = np.floor(transmission.usteps(pose) + 0.5).astype(int)
        points.append(TouchedPoint(tuple(int(n) for n in usteps), (tip[0], tip[1])))
    return points


def touching_poses(scene: Scene, count: int) -> list[Floats]:
    """Return poses that tell most of the links' lengths and the zero angles, within the joints' limits.

    They are chosen one by one from a spread of poses whose joints lie in the workspace, each so that the determinant of
    what is known grows most (D-optimal design); then they are put in the order of the first joint.

    Raises:
        UsageError: there are not as many.
    """
    arm = Arm.from_spec(scene.arm)
    candidates = _spread(scene, arm)
    if len(candidates) < count:
        raise UsageError(
            f"the joints' limits and the workspace leave {len(candidates)} poses, {count} points are asked for; touch "
            "fewer, or widen workspace.x_cm and y_cm"
        )
    chosen = _most_telling(_told_by(arm, candidates), count)
    return sorted((candidates[k] for k in chosen), key=lambda pose: float(pose[0]))


def _most_telling(told: Floats, count: int) -> list[int]:
    """Return which of the candidates, whose derivatives are `told`, tell most together (Fedorov's exchange)."""
    chosen: list[int] = []
    for turn in range(ROUNDS * count):
        if turn >= count:
            chosen.pop(0)  # the one that was chosen first is chosen anew, beside all others
        known = 1e-6 * np.eye(told.shape[2]) + sum(told[k].T @ told[k] for k in chosen)
        growth = np.linalg.det(np.eye(2) + told @ np.linalg.solve(known, told.swapaxes(1, 2)))
        growth[chosen] = 0.0
        chosen.append(int(np.argmax(growth)))
    return chosen


def _spread(scene: Scene, arm: Arm) -> Floats:
    """Return poses over the joints' ranges, shape (m, n): on the elbow's side, all joints in the workspace."""
    low, high = np.array(arm.joint_limits_rad).T
    low[1:], high[1:] = np.maximum(low[1:], -MOST_FOLDED_RAD), np.minimum(high[1:], MOST_FOLDED_RAD)
    if scene.arm.elbow == "up":
        high[1:2] = np.minimum(high[1:2], 0.0)
    if scene.arm.elbow == "down":
        low[1:2] = np.maximum(low[1:2], 0.0)
    if (low > high).any():
        return np.empty((0, arm.links))
    shares = np.array([[_halton(k, base) for base in BASES[: arm.links]] for k in range(1, CANDIDATES + 1)])
    poses = low + shares * (high - low)
    x, y = np.moveaxis(forward(arm, poses)[:, 1:], -1, 0)
    (x_low, x_high), (y_low, y_high) = scene.workspace.x_cm, scene.workspace.y_cm
    within = (x >= x_low) & (x <= x_high) & (y >= y_low) & (y <= y_high)
    return np.asarray(poses[within.all(axis=1)])


def _told_by(arm: Arm, poses: Floats) -> Floats:
    """Return how the tip moves with each length, and with each zero for an angle of a reach, shape (m, 2, 2 n)."""
    along = np.cumsum(poses, axis=1)
    lengths = np.stack([np.cos(along), np.sin(along)], axis=1)
    return np.concatenate([lengths, tip_jacobian(arm, poses) / arm.reach_cm], axis=2)


def _halton(index: int, base: int) -> float:
    """Return a member of van der Corput's sequence: the digits of `index` behind the point, the last first."""
    share, digit = 0.0, 1.0 / base
    while index:
        index, rest = divmod(index, base)
        share += rest * digit
        digit /= base
    return share
