"""Forward kinematics of n links, the closed-form inverse of two, and the end effector's Jacobian.

Source: paper C, eqs. 1-9, with every arc tangent as atan2 and the sign of eq. 9 corrected. As printed, eq. 9 adds
psi = atan2(l2 sin theta2, l1 + l2 cos theta2) to the direction phi of the point; with psi in the sign that eq. 8
gives it, the end effector reaches the point only for theta1 = phi - psi. For theta2 < 0 ("elbow up") psi is
negative, so that theta1 = phi + |psi|.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.model.arm import Arm

ElbowSide = Literal["up", "down"]
Floats = NDArray[np.float64]

ROUNDING_CM = 1e-9
"""A point this far beyond reach still counts as reached: rounding, not geometry."""


def forward(arm: Arm, q_rad: ArrayLike) -> Floats:
    """Return the joints' positions, base to end effector (paper C, eqs. 1-2, for any number of links).

    Args:
        arm: an arm with n links.
        q_rad: joint angles, shape (..., n).

    Returns:
        Positions in centimetres, shape (..., n + 1, 2); index 0 is the base, index n the end effector.
    """
    headings_rad = np.cumsum(np.asarray(q_rad, np.float64), axis=-1)
    lengths_cm = np.asarray(arm.link_lengths_cm)
    links_cm = np.stack([lengths_cm * np.cos(headings_rad), lengths_cm * np.sin(headings_rad)], axis=-1)
    base_cm = np.broadcast_to(np.asarray(arm.base_cm, np.float64), (*links_cm.shape[:-2], 1, 2))
    return np.cumsum(np.concatenate([base_cm, links_cm], axis=-2), axis=-2)


def inverse_2r(arm: Arm, tip_cm: ArrayLike, elbow: ElbowSide) -> Floats:
    """Return the joint angles that put the end effector of a two-link arm at a point.

    theta1 is given in the turn around the middle of joint 1's limits, so that it is out of its limits only where no
    whole turn brings it inside. Only reach is judged here, joint limits are not.

    Args:
        arm: an arm with two links.
        tip_cm: points, shape (..., 2).
        elbow: "up" for theta2 <= 0, "down" for theta2 >= 0.

    Returns:
        Joint angles in radians, shape (..., 2); NaN where the point is out of reach.

    Raises:
        ValueError: the arm has not two links.
    """
    if arm.links != 2:
        raise ValueError(f"the closed-form inverse needs 2 links, the arm has {arm.links}")
    l1, l2 = arm.link_lengths_cm
    x, y = np.moveaxis(np.asarray(tip_cm, np.float64) - arm.base_cm, -1, 0)
    r = np.hypot(x, y)  # eq. 3
    reached = (r <= l1 + l2 + ROUNDING_CM) & (r >= abs(l1 - l2) - ROUNDING_CM)
    cos_theta2 = np.clip((r * r - l1 * l1 - l2 * l2) / (2.0 * l1 * l2), -1.0, 1.0)  # eq. 4, cos(alpha) = -cos(theta2)
    sign = -1.0 if elbow == "up" else 1.0
    theta2 = np.where(reached, sign * np.arccos(cos_theta2), np.nan)
    psi = np.arctan2(l2 * np.sin(theta2), l1 + l2 * np.cos(theta2))  # eq. 8
    theta1 = np.arctan2(y, x) - psi  # eq. 9, sign corrected
    return np.stack([within_turn(theta1, turn_start_rad(arm)), theta2], axis=-1)


def turn_start_rad(arm: Arm) -> float:
    """Return the angle at which the turn around the middle of joint 1's limits begins."""
    low, high = arm.joint_limits_rad[0]
    return 0.5 * (low + high) - np.pi


def within_turn(angle_rad: Floats, start_rad: float) -> Floats:
    """Return the angles shifted by whole turns into [start_rad, start_rad + 2 pi)."""
    return angle_rad - 2.0 * np.pi * np.floor((angle_rad - start_rad) / (2.0 * np.pi))


def tip_jacobian(arm: Arm, q_rad: ArrayLike) -> Floats:
    """Return d(tip)/d(q) in cm/rad, shape (..., 2, n), for joint angles of shape (..., n).

    Column i is the lever from joint i to the end effector, turned by a quarter turn.
    """
    joints_cm = forward(arm, q_rad)
    lever_cm = joints_cm[..., -1:, :] - joints_cm[..., :-1, :]
    return np.stack([-lever_cm[..., 1], lever_cm[..., 0]], axis=-2)
