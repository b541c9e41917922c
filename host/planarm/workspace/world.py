"""The two-link arm among its obstacles, as kernels see it: reach, limits and margin around one elbow side.

The elbow side fixes the pose for each tip position: with phi the tip's direction and r its distance from the base,
theta1 = phi + side * beta(r), cos beta = (r^2 + l1^2 - l2^2) / (2 r l1), and theta2 = -side * acos(...) (paper C,
eqs. 3-9, sign corrected). Since |theta2| falls as r grows, the limits of theta2 are limits of r.
"""

from math import acos, atan2, cos, floor, hypot, inf, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.errors import SceneError
from planarm.model.arm import Arm
from planarm.model.collision import two_link_clearance
from planarm.model.kinematics import ROUNDING_CM, ElbowSide, turn_start_rad
from planarm.model.shapes import ObstacleSet, obstacle_set, shape_of
from planarm.scene import ArmSpec, Scene
from planarm_wire.kernel_cache import kernel

SINGULAR_CM = 1e-6
"""Around the base itself the direction of link 1 is not defined: with equal links the hole has this radius."""

# Regions of tip positions: free, or what forbids them (paper C, section VIII, tells the first three apart).
FREE, BEYOND_REACH, INNER_HOLE, OBSTACLE, LIMIT = 0, 1, 2, 3, 4


class TwoLinkArm(NamedTuple):
    """A two-link arm on one elbow side with its limits, as plain numbers: cm and radians."""

    l1_cm: float
    l2_cm: float
    base_x_cm: float
    base_y_cm: float
    side: float
    """+1 for elbow "up" (theta2 <= 0), -1 for "down"."""
    reach_cm: float
    r_min_cm: float
    r_max_cm: float
    """Least and greatest tip distance from the base within reach and the limits of theta2."""
    turn_start_rad: float
    """theta1 is told in [turn_start_rad, turn_start_rad + 2 pi)."""
    theta1_min_rad: float
    theta1_max_rad: float
    limit_rays: tuple[float, float, float, float]
    """Directions (cos, sin) of link 1 at the least and at the greatest theta1."""
    per_l1: float
    per_l2: float
    """1 / l1^2 and 1 / l2^2, so that kernels need not divide."""
    margin_cm: float
    """A pose is free when its clearance exceeds this."""
    floor: bool


class ArmWorld(NamedTuple):
    """The arm among its obstacles.

    Kernels that need no obstacle take `arm`: Numba counts references to all arrays of a tuple at every call, which
    costs more than the arithmetic.
    """

    arm: TwoLinkArm
    obstacles: ObstacleSet


def elbow_sides(spec: ArmSpec) -> tuple[ElbowSide, ...]:
    """Return the elbow sides that a scene allows: one, or both for "either"."""
    return ("up", "down") if spec.elbow == "either" else (spec.elbow,)


def build_world(scene: Scene, margin_cm: float | None = None, elbow: ElbowSide | None = None) -> ArmWorld:
    """Return what kernels need to know about a scene.

    Args:
        scene: a scene with a two-link arm.
        margin_cm: least distance of a link's centre line to an obstacle; None takes the scene's.
        elbow: the elbow side; None takes the scene's.

    Raises:
        SceneError: the limits of theta2 leave no pose on this side; or the scene allows both sides and none is given.
    """
    if elbow is None and scene.arm.elbow == "either":
        raise SceneError(
            scene.source, "arm.elbow", "'either' stands for two maps: build one for 'up' and one for 'down'"
        )
    sides = elbow_sides(scene.arm)
    side = sides[0] if elbow is None else elbow
    arm = Arm.from_spec(scene.arm)
    l1, l2 = arm.link_lengths_cm
    r_min, r_max = _tip_distances_cm(scene, side)
    low, high = arm.joint_limits_rad[0]
    numbers = TwoLinkArm(
        l1_cm=l1,
        l2_cm=l2,
        base_x_cm=arm.base_cm[0],
        base_y_cm=arm.base_cm[1],
        side=1.0 if side == "up" else -1.0,
        reach_cm=arm.reach_cm,
        r_min_cm=r_min,
        r_max_cm=r_max,
        turn_start_rad=turn_start_rad(arm),
        theta1_min_rad=low,
        theta1_max_rad=high,
        limit_rays=(cos(low), sin(low), cos(high), sin(high)),
        per_l1=1.0 / (l1 * l1),
        per_l2=1.0 / (l2 * l2),
        margin_cm=scene.margin_cm if margin_cm is None else margin_cm,
        floor=scene.arm.floor,
    )
    return ArmWorld(numbers, obstacle_set([shape_of(obstacle) for obstacle in scene.obstacles]))


def _tip_distances_cm(scene: Scene, side: ElbowSide) -> tuple[float, float]:
    """Return the least and greatest tip distance from the base that the limits of theta2 leave."""
    low, high = scene.arm.joint_limits_rad[1]
    least, most = (-high, -low) if side == "up" else (low, high)  # bounds of |theta2| on this side
    least, most = max(least, 0.0), min(most, pi)
    if least > most:
        problem = f"no pose has its elbow {side!r} (theta2 {'<=' if side == 'up' else '>='} 0) within these limits"
        raise SceneError(scene.source, "arm.joint_limits_deg", f"{problem}; widen them or change arm.elbow")
    l1, l2 = scene.arm.link_lengths_cm
    return max(_tip_distance_cm(l1, l2, most), SINGULAR_CM), _tip_distance_cm(l1, l2, least)


def _tip_distance_cm(l1: float, l2: float, theta2_rad: float) -> float:
    return hypot(l1 + l2 * cos(theta2_rad), l2 * sin(theta2_rad))


@kernel
def elbow_at(arm: TwoLinkArm, x_cm: float, y_cm: float, r_cm: float) -> tuple[float, float]:
    """Return the elbow's (x, y) for a tip at (x, y), at distance r from the base."""
    cos_beta = cos_beta_at(arm, r_cm)
    sin_beta = arm.side * sqrt(max(0.0, 1.0 - cos_beta * cos_beta))
    ux, uy = (x_cm - arm.base_x_cm) / r_cm, (y_cm - arm.base_y_cm) / r_cm
    return (
        arm.base_x_cm + arm.l1_cm * (ux * cos_beta - uy * sin_beta),
        arm.base_y_cm + arm.l1_cm * (uy * cos_beta + ux * sin_beta),
    )


@kernel
def elbow_from_base(arm: TwoLinkArm, x: float, y: float, r2: float, r: float) -> tuple[float, float]:
    """Return the elbow seen from the base for a tip (x, y) from it, its distance r and r^2: with one division."""
    l1, per_r = arm.l1_cm, 1.0 / r
    along = min(l1, max(-l1, 0.5 * (r2 + l1 * l1 - arm.l2_cm * arm.l2_cm) * per_r))
    aside = arm.side * sqrt(l1 * l1 - along * along)
    return per_r * (x * along - y * aside), per_r * (y * along + x * aside)


@kernel
def links_apart2(cx: float, cy: float, ex: float, ey: float, x: float, y: float, per_l1: float, per_l2: float) -> float:
    """Return the squared distance from c to the nearer link; c, elbow and tip as seen from the base. No division."""
    share = min(1.0, max(0.0, (cx * ex + cy * ey) * per_l1))
    ax, ay = cx - share * ex, cy - share * ey
    ux, uy, vx, vy = x - ex, y - ey, cx - ex, cy - ey
    share = min(1.0, max(0.0, (vx * ux + vy * uy) * per_l2))
    dx, dy = vx - share * ux, vy - share * uy
    return min(ax * ax + ay * ay, dx * dx + dy * dy)


@kernel
def cos_beta_at(arm: TwoLinkArm, r_cm: float) -> float:
    """Return cos beta: beta is the angle at the base from the tip's direction to link 1, by the law of cosines."""
    l1, l2 = arm.l1_cm, arm.l2_cm
    return min(1.0, max(-1.0, (r_cm * r_cm + l1 * l1 - l2 * l2) / (2.0 * r_cm * l1)))


@kernel
def theta1_at(arm: TwoLinkArm, x_cm: float, y_cm: float, beta_rad: float) -> float:
    """Return theta1 in [turn_start_rad, turn_start_rad + 2 pi) for a tip at (x, y)."""
    theta1 = atan2(y_cm - arm.base_y_cm, x_cm - arm.base_x_cm) + arm.side * beta_rad
    return theta1 - 2.0 * pi * floor((theta1 - arm.turn_start_rad) / (2.0 * pi))


@kernel
def theta2_at(arm: TwoLinkArm, r_cm: float) -> float:
    """Return theta2 for a tip at distance r from the base."""
    l1, l2 = arm.l1_cm, arm.l2_cm
    return -arm.side * acos(min(1.0, max(-1.0, (r_cm * r_cm - l1 * l1 - l2 * l2) / (2.0 * l1 * l2))))


@kernel
def within_limits(arm: TwoLinkArm, ex: float, ey: float, room_cm: float) -> bool:
    """Tell whether joint 1 stays inside its limits while the elbow moves no farther than `room_cm` from (ex, ey).

    The elbow must be on the inner side of both limits' rays and farther than that from each.
    """
    low_x, low_y, high_x, high_y = arm.limit_rays
    vx, vy = ex - arm.base_x_cm, ey - arm.base_y_cm
    left_of_low, left_of_high = low_x * vy - low_y * vx, high_x * vy - high_y * vx
    if low_x * vx + low_y * vy > 0.0 and abs(left_of_low) <= room_cm + ROUNDING_CM:
        return False
    if high_x * vx + high_y * vy > 0.0 and abs(left_of_high) <= room_cm + ROUNDING_CM:
        return False
    turn = arm.theta1_max_rad - arm.theta1_min_rad
    if turn >= 2.0 * pi:
        return room_cm < arm.l1_cm
    inside = left_of_low > 0.0, left_of_high < 0.0
    return room_cm < arm.l1_cm and ((inside[0] and inside[1]) if turn <= pi else (inside[0] or inside[1]))


@kernel
def region_at(arm: TwoLinkArm, r_cm: float) -> int:
    """Return the region that a tip's distance from the base alone decides, FREE when it forbids nothing."""
    if r_cm < arm.r_min_cm - ROUNDING_CM:
        return INNER_HOLE
    if r_cm > arm.reach_cm + ROUNDING_CM:
        return BEYOND_REACH
    if r_cm > arm.r_max_cm + ROUNDING_CM:
        return LIMIT
    return FREE


@kernel
def obstacle_clearance(world: ArmWorld, ex: float, ey: float, x: float, y: float) -> tuple[float, int]:
    """Return (distance in cm, index) of the obstacle nearest to the links, given elbow and tip; (inf, -1) for none."""
    return two_link_clearance(world.arm.base_x_cm, world.arm.base_y_cm, ex, ey, x, y, world.obstacles, inf)


@kernel
def floor_clearance(arm: TwoLinkArm, ey: float, y: float) -> float:
    """Return the height in cm of the lower of elbow and tip above y = 0, or infinity when the scene has no floor.

    The base is mounted on or above the floor, so these two ends are the lowest points of link 1's moving end and of
    link 2.
    """
    return min(ey, y) if arm.floor else inf


@kernel
def _clearances(world: ArmWorld, q_rad: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    arm = world.arm
    for i in range(q_rad.shape[0]):
        theta1, heading2 = q_rad[i, 0], q_rad[i, 0] + q_rad[i, 1]
        ex = arm.base_x_cm + arm.l1_cm * cos(theta1)
        ey = arm.base_y_cm + arm.l1_cm * sin(theta1)
        x, y = ex + arm.l2_cm * cos(heading2), ey + arm.l2_cm * sin(heading2)
        distance, _ = obstacle_clearance(world, ex, ey, x, y)
        out[i] = min(distance, floor_clearance(arm, ey, y))


def clearances_cm(world: ArmWorld, q_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each pose's clearance in cm to obstacles and floor, for joint angles of shape (n, 2)."""
    out = np.empty(len(q_rad))
    _clearances(world, np.ascontiguousarray(q_rad, np.float64), out)
    return out
