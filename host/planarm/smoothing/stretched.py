"""Follow a path of the tip through full stretch or full fold, by many short straight moves in joint space.

On a straight leg of the tip that meets the circle of full stretch or fold, dq/ds is infinite there: the elbow goes with
the square root of the way. Over joint space nothing is singular. So the legs are halved until the straight move in
joint space between two poses stays near the leg, by this bound: with constant joint rates the tip's second derivative
is that of two turning links, |tip''| <= l1 w1^2 + l2 w2^2 over a unit of the parameter, and a curve is off its chord by
at most an eighth of that.
"""

from itertools import pairwise

import numpy as np

from planarm.errors import NoPathError
from planarm.model.arm import Arm
from planarm.model.kinematics import ElbowSide, inverse_2r
from planarm.smoothing.joint_blend import blend_poses
from planarm.smoothing.joint_spline import JointSpline, joined
from planarm.smoothing.smooth_path import Floats
from planarm.workspace.joint_proof import JointWorld

MOST_HALVINGS = 24
TRIES = 6
"""The share of the tolerance that the moves may take is halved this often where they cannot be proved free."""


def follow_stretched(
    points_cm: Floats, elbow: ElbowSide, arm: Arm, world: JointWorld, tolerance_cm: float, *, stop: bool
) -> JointSpline:
    """Return a joint path whose tip stays within the tolerance of the straight moves between points.

    Args:
        points_cm: way-points of the tip, shape (m, 2), without repeated ones.
        elbow: the elbow side.
        arm: an arm with two links.
        world: the arm among its obstacles; its margin is kept.
        tolerance_cm: largest distance of the tip from the moves, corners included.
        stop: True to stop at the way-points; the corners between the short moves along a leg are rounded all the same.

    Raises:
        NoPathError: the moves cannot be proved free.
    """
    share = 0.5
    for attempt in range(TRIES):
        near_cm = share * tolerance_cm
        legs = _poses_along(points_cm, elbow, arm, near_cm)
        runs = legs if stop else [np.concatenate(legs)]
        try:
            return joined([blend_poses(poses, arm, world, tolerance_cm - near_cm) for poses in runs])
        except NoPathError:
            if attempt == TRIES - 1:
                raise
        share *= 0.5
    raise AssertionError("the last try returns or raises")


def _poses_along(points_cm: Floats, elbow: ElbowSide, arm: Arm, near_cm: float) -> list[Floats]:
    """Return for each leg poses with the tip on it, both ends included, near enough to each other, shape (m, 2)."""
    legs = []
    first = _pose(points_cm[0], elbow, arm, None)
    for a, b in pairwise(points_cm):
        poses = [first]
        waiting = [(1.0, 0)]
        start = 0.0
        while waiting:
            end, halved = waiting[-1]
            pose = _pose(a + end * (b - a), elbow, arm, poses[-1])
            if _off_chord_cm(arm, pose - poses[-1]) <= near_cm or halved >= MOST_HALVINGS:
                poses.append(pose)
                start = end
                waiting.pop()
            else:
                waiting.append((0.5 * (start + end), halved + 1))
        first = poses[-1]
        legs.append(np.array(poses))
    return legs or [first[None]]


def _pose(tip_cm: Floats, elbow: ElbowSide, arm: Arm, before: Floats | None) -> Floats:
    """Return the joint angles for a tip position, theta1 in the turn nearest to the pose before."""
    pose = inverse_2r(arm, tip_cm, elbow)
    if before is not None:
        pose[0] += 2.0 * np.pi * np.round((before[0] - pose[0]) / (2.0 * np.pi))
    return pose


def _off_chord_cm(arm: Arm, move_rad: Floats) -> float:
    """Return how far the tip can be off its chord on a straight move in joint space."""
    turns = np.cumsum(move_rad)
    return float(np.asarray(arm.link_lengths_cm) @ turns**2) / 8.0
