"""Proofs that an arm with any number of links stays free while its joints move on polynomials of a path parameter.

The bound. While each joint i stays within d_i of a pose, take the changes one joint at a time, the outermost first.
Joint i then turns the end of link p, which is no farther from joint i than it was in the pose plus what the joints
beyond i have moved it, and never farther than the links between them reach. So the end of link p moves by at most m_1,
where

    m_(p+1) = 0,   m_i = m_(i+1) + d_i min(reach_ip, distance_ip + m_(i+1)),

and a point of a link, whose displacement lies between those of the link's ends, by at most the larger of the two. A
piece of the path is free when at its middle every link's clearance exceeds the margin by more than that; pieces for
which it does not are halved. Unlike `planarm.workspace.proof`, which bounds the joints by the tip, this holds at full
stretch and fold.
"""

from math import hypot, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.model.collision import segment_clearance
from planarm.model.kinematics import ROUNDING_CM
from planarm.model.shapes import ObstacleSet, obstacle_set, shape_of
from planarm.scene import Scene
from planarm.workspace.proof import BLOCKED, PROVED, UNPROVED, next_piece
from planarm_wire.kernel_cache import bare_kernel, kernel

Floats = NDArray[np.float64]

SMALLEST_CM = 1e-3
"""A piece on which no point of the arm moves farther than this is not halved: what it does not prove stays unproved."""

ROUNDING_RAD = 1e-9
"""A joint this far beyond its limit still counts as inside: rounding, not geometry."""


class JointWorld(NamedTuple):
    """An arm with n links among its obstacles, as joint-space kernels see it."""

    lengths_cm: Floats
    """Shape (n,)."""
    base_x_cm: float
    base_y_cm: float
    low_rad: Floats
    """Least angle of each joint, shape (n,)."""
    high_rad: Floats
    margin_cm: float
    """A pose is free when every link's clearance exceeds this."""
    floor: bool
    """True when all links must stay above y = 0."""
    obstacles: ObstacleSet


def joint_world(scene: Scene, margin_cm: float | None = None) -> JointWorld:
    """Return what the kernels need of a scene; both elbow sides are in it.

    Args:
        scene: the scene.
        margin_cm: least distance of a link's centre line to an obstacle; None takes the scene's.
    """
    low, high = np.array(scene.arm.joint_limits_rad, np.float64).T
    return JointWorld(
        lengths_cm=np.array(scene.arm.link_lengths_cm, np.float64),
        base_x_cm=scene.arm.base_cm[0],
        base_y_cm=scene.arm.base_cm[1],
        low_rad=np.ascontiguousarray(low),
        high_rad=np.ascontiguousarray(high),
        margin_cm=scene.margin_cm if margin_cm is None else margin_cm,
        floor=scene.arm.floor,
        obstacles=obstacle_set([shape_of(obstacle) for obstacle in scene.obstacles]),
    )


def prove_joint_line(world: JointWorld, start_rad: Floats, end_rad: Floats) -> tuple[int, float]:
    """Judge the straight move between two poses of shape (n,); see `prove_pieces`."""
    coefficients = np.zeros((1, 4, len(world.lengths_cm)))
    coefficients[0, 0], coefficients[0, 1] = start_rad, np.subtract(end_rad, start_rad)
    return prove_pieces(world, np.array([0.0, 1.0]), coefficients)


@kernel
def prove_pieces(world: JointWorld, borders_s: Floats, coefficients: Floats) -> tuple[int, float]:
    """Judge a joint path of cubic pieces.

    Args:
        world: the arm among its obstacles.
        borders_s: ends of the pieces, ascending, shape (pieces + 1,).
        coefficients: angle of joint j on piece p at s is the sum over k of coefficients[p, k, j] (s - borders_s[p])^k,
            shape (pieces, 4, n), radians.

    Returns:
        (verdict, s): PROVED; or BLOCKED with an s at which the pose is not free; or UNPROVED with the s around which
        the margin is too small for a proof.
    """
    joints = world.lengths_cm.shape[0]
    q, sway, ends = np.empty(joints), np.empty(joints), np.empty((joints + 1, 2))
    for p in range(coefficients.shape[0]):
        size = borders_s[p + 1] - borders_s[p]
        outside = _leaves_limits(world, coefficients[p], size)
        if outside >= 0.0:
            return BLOCKED, borders_s[p] + outside
        start, width = 0.0, 1.0
        while start < 1.0:
            middle = (start + 0.5 * width) * size
            _pose_and_sway(coefficients[p], middle, 0.5 * width * size, q, sway)
            verdict = _judge(world, q, sway, ends)
            if verdict == PROVED:
                start, width = next_piece(start, width)
            elif verdict == BLOCKED:
                return BLOCKED, borders_s[p] + middle
            elif _largest_move(world, sway) <= SMALLEST_CM:
                return UNPROVED, borders_s[p] + middle
            else:
                width *= 0.5
    return PROVED, borders_s[-1]


@kernel
def pose_spare_cm(world: JointWorld, q_rad: Floats) -> float:
    """Return the least clearance of any link, obstacles and floor, beyond the margin, for angles of shape (n,)."""
    ends = np.empty((world.lengths_cm.shape[0] + 1, 2))
    link_ends(world, q_rad, ends)
    spare = inf
    for k in range(q_rad.shape[0]):
        spare = min(spare, link_spare(world, ends, k))
    return spare


@bare_kernel
def _judge(world: JointWorld, q: Floats, sway: Floats, ends: Floats) -> int:
    """Judge all poses within `sway` of q, joint by joint; BLOCKED tells of q itself. `ends` is room to work in."""
    link_ends(world, q, ends)
    verdict, before = PROVED, 0.0
    for k in range(q.shape[0]):
        spare = link_spare(world, ends, k)
        if spare <= 0.0:
            return BLOCKED
        after = _end_move(world, ends, sway, k)
        if spare <= max(before, after) + ROUNDING_CM:
            verdict = UNPROVED
        before = after
    return verdict


@bare_kernel
def link_ends(world: JointWorld, q: Floats, ends: Floats) -> None:
    """Fill the positions of base and all links' ends, shape (n + 1, 2)."""
    ends[0, 0], ends[0, 1] = world.base_x_cm, world.base_y_cm
    heading = 0.0
    for k in range(q.shape[0]):
        heading += q[k]
        ends[k + 1, 0] = ends[k, 0] + world.lengths_cm[k] * np.cos(heading)
        ends[k + 1, 1] = ends[k, 1] + world.lengths_cm[k] * np.sin(heading)


@bare_kernel
def link_spare(world: JointWorld, ends: Floats, k: int) -> float:
    """Return link k's clearance beyond the margin."""
    clearance, _ = segment_clearance(ends[k, 0], ends[k, 1], ends[k + 1, 0], ends[k + 1, 1], world.obstacles, inf)
    if world.floor:
        clearance = min(clearance, ends[k + 1, 1])
    return clearance - world.margin_cm


@bare_kernel
def _end_move(world: JointWorld, ends: Floats, sway: Floats, p: int) -> float:
    """Return the module's bound for the end of link p, counted from 0."""
    reach, moved = 0.0, 0.0
    for i in range(p, -1, -1):
        reach += world.lengths_cm[i]
        lever = hypot(ends[p + 1, 0] - ends[i, 0], ends[p + 1, 1] - ends[i, 1])
        moved += sway[i] * min(reach, lever + moved)
    return moved


@bare_kernel
def _largest_move(world: JointWorld, sway: Floats) -> float:
    """Return how far the joints can move any point of the arm, whatever the pose."""
    reach, moved = 0.0, 0.0
    for i in range(sway.shape[0] - 1, -1, -1):
        reach += world.lengths_cm[i]
        moved += sway[i] * reach
    return moved


@bare_kernel
def _pose_and_sway(piece: Floats, middle: float, half: float, q: Floats, sway: Floats) -> None:
    """Fill the pose at `middle` of a piece and how far each joint gets from it within `half` on both sides."""
    for j in range(q.shape[0]):
        a, b, c, d = piece[0, j], piece[1, j], piece[2, j], piece[3, j]
        q[j] = a + middle * (b + middle * (c + middle * d))
        rate, bend, twist = b + middle * (2.0 * c + 3.0 * middle * d), 2.0 * c + 6.0 * middle * d, 6.0 * d
        # Taylor's series about the middle; it ends here, since the piece is cubic.
        sway[j] = half * (abs(rate) + half * (0.5 * abs(bend) + half * abs(twist) / 6.0))


@bare_kernel
def _leaves_limits(world: JointWorld, piece: Floats, size: float) -> float:
    """Return where in a piece a joint is farthest beyond its limits, at an end or a turning point; -1 when none is."""
    worst, at = ROUNDING_RAD, -1.0
    for j in range(piece.shape[1]):
        a, b, c, d = piece[0, j], piece[1, j], piece[2, j], piece[3, j]
        for where in (0.0, size, *turning_points(b, c, d)):
            if 0.0 <= where <= size:
                angle = a + where * (b + where * (c + where * d))
                beyond = max(world.low_rad[j] - angle, angle - world.high_rad[j])
                if beyond > worst:
                    worst, at = beyond, where
    return at


@bare_kernel
def turning_points(b: float, c: float, d: float) -> tuple[float, float]:
    """Return the roots of b + 2 c x + 3 d x^2; -1 for each that is none."""
    if d == 0.0:
        return (-b / (2.0 * c) if c != 0.0 else -1.0), -1.0
    inside = c * c - 3.0 * b * d
    if inside < 0.0:
        return -1.0, -1.0
    # The larger root first, the other from their product: no cancellation.
    q = -(c + (sqrt(inside) if c >= 0.0 else -sqrt(inside)))
    return q / (3.0 * d), (b / q if q != 0.0 else -1.0)
