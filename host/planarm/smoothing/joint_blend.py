"""Poses to a smooth path in joint space: straight moves, and corners rounded by parabolas that are proved free.

A corner between two straight moves is cut by the quadratic Bezier curve that leaves the moves at equal distances d from
it (in radians, along the polygon); its control point is the corner. With unit vectors u and v along the moves joint i
comes within d |v_i - u_i| / 4 of the corner's angle, so no point of the arm is farther than the sum of these, each
times its lever, from the corner's pose. Tolerance and proof are those of `planarm.smoothing.blend`: the tip leaves the
corner's pose by at most the tolerance, a parabola that cannot be proved free is halved, and what is left sharp is a
stop.
"""

from typing import NamedTuple

import numpy as np

from planarm.errors import NoPathError
from planarm.model.arm import Arm
from planarm.smoothing.blend import LEG_SHARE
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.smooth_path import Floats
from planarm.workspace.joint_proof import JointWorld, prove_joint_line, prove_pieces
from planarm.workspace.proof import PROVED

SMALLEST_CUT_RAD = 1e-4
"""A corner that leaves room for smaller parabolas only is left sharp: running through it would be nearly a stop."""

STRAIGHT = 1e-9
"""Sine of the largest turn between moves that count as one."""

TURNING_BACK = -0.99
"""Cosine of the turn beyond which the joints go back where they came from: a stop, so that the corner is reached."""


class _Polygon(NamedTuple):
    poses_rad: Floats
    lengths: Floats
    units: Floats


def blend_poses(
    poses_rad: Floats, arm: Arm, world: JointWorld, tolerance_cm: float | None, *, proved: bool = False
) -> JointSpline:
    """Return the straight moves in joint space between poses, with corners rounded as tolerance and obstacles allow.

    Args:
        poses_rad: joint angles, shape (m, n), from start to goal; repeated poses are dropped.
        arm: the arm.
        world: the arm among its obstacles; its margin is kept.
        tolerance_cm: largest distance of the tip from a corner's position; None stops at every corner.
        proved: True when the moves are known to be free; else each is proved here.

    Raises:
        NoPathError: a move between two poses is not free, or cannot be proved to be.
        ValueError: the poses are no finite array of shape (m, n); or the tolerance is not above 0.
    """
    if tolerance_cm is not None and not tolerance_cm > 0.0:
        raise ValueError(f"the tolerance is {tolerance_cm} cm; it must be above 0")
    corners = _distinct(poses_rad, arm.links)
    moves = np.diff(corners, axis=0)
    lengths = np.sqrt((moves**2).sum(axis=1))
    polygon = _Polygon(corners, lengths, moves / lengths[:, None])
    if not proved:
        _require_free_moves(polygon, world)
    cuts = np.zeros(len(corners))
    if tolerance_cm is not None:
        for k in range(1, len(corners) - 1):
            cuts[k] = _proved_cut(polygon, k, arm, world, tolerance_cm)
    return _assemble(arm, polygon, cuts)


def _distinct(poses_rad: Floats, joints: int) -> Floats:
    """Return the poses without repeated ones and without those in the middle of a straight run."""
    poses = np.asarray(poses_rad, np.float64)
    if poses.ndim != 2 or poses.shape[1] != joints or not len(poses) or not np.isfinite(poses).all():
        raise ValueError(f"poses are one or more rows of {joints} finite angles, not an array of shape {poses.shape}")
    kept = [poses[0]]
    for pose in poses[1:]:
        if (pose == kept[-1]).all():
            continue
        if len(kept) > 1 and _runs_on(kept[-1] - kept[-2], pose - kept[-1]):
            kept[-1] = pose
        else:
            kept.append(pose)
    return np.array(kept)


def _runs_on(a: Floats, b: Floats) -> bool:
    """Tell whether move b goes on straight after move a."""
    u, v = a / np.sqrt(a @ a), b / np.sqrt(b @ b)
    return bool(np.sqrt(((v - u) ** 2).sum()) <= STRAIGHT)


def _require_free_moves(polygon: _Polygon, world: JointWorld) -> None:
    for k in range(len(polygon.lengths)):
        verdict, share = prove_joint_line(world, polygon.poses_rad[k], polygon.poses_rad[k + 1])
        if verdict != PROVED:
            angles = np.degrees(polygon.poses_rad[k] + share * polygon.lengths[k] * polygon.units[k])
            raise NoPathError(
                f"the move from pose {k + 1} to pose {k + 2} cannot be proved free at joint angles "
                f"{', '.join(f'{a:.2f}' for a in angles)} deg, with {world.margin_cm:.4g} cm to be kept; add a pose "
                "that leads around, or lower workspace.clearance_cm"
            )


def _proved_cut(polygon: _Polygon, k: int, arm: Arm, world: JointWorld, tolerance_cm: float) -> float:
    """Return the distance from corner k at which a proved parabola leaves the moves; 0 for a stop."""
    u, v = polygon.units[k - 1], polygon.units[k]
    if u @ v < TURNING_BACK:
        return 0.0
    levers_cm = np.cumsum(arm.link_lengths_cm[::-1])[::-1]
    cut = LEG_SHARE * float(min(polygon.lengths[k - 1], polygon.lengths[k]))
    cut = min(cut, 4.0 * tolerance_cm / float(np.abs(v - u) @ levers_cm))
    while cut >= SMALLEST_CUT_RAD:
        piece = np.zeros((1, 4, arm.links))
        piece[0, :3] = _parabola(polygon.poses_rad[k], u, v, cut)
        if prove_pieces(world, np.array([0.0, 2.0 * cut]), piece)[0] == PROVED:
            return cut
        cut *= 0.5
    return 0.0


def _parabola(corner: Floats, u: Floats, v: Floats, cut: float) -> Floats:
    """Return the coefficients of 1, s and s^2, shape (3, n), of the parabola over s in [0, 2 cut]."""
    return np.stack([corner - cut * u, u, (v - u) / (4.0 * cut)])


def _assemble(arm: Arm, polygon: _Polygon, cuts: Floats) -> JointSpline:
    """Return the path made of what the cuts leave of each move, and a parabola at each cut corner."""
    sizes: list[float] = []
    pieces: list[Floats] = []
    stops: list[int] = []
    rest = np.zeros((2, arm.links))
    for k, (length, unit) in enumerate(zip(polygon.lengths, polygon.units, strict=True)):
        left = length - cuts[k] - cuts[k + 1]
        if left > STRAIGHT * length:
            sizes.append(left)
            pieces.append(np.stack([polygon.poses_rad[k] + cuts[k] * unit, unit, *rest]))
        if cuts[k + 1] > 0.0:
            sizes.append(2.0 * cuts[k + 1])
            parabola = _parabola(polygon.poses_rad[k + 1], unit, polygon.units[k + 1], cuts[k + 1])
            pieces.append(np.stack([*parabola, rest[0]]))
        elif k + 1 < len(polygon.lengths):
            stops.append(len(sizes))
    if not pieces:
        pieces.append(np.stack([polygon.poses_rad[0], *rest, rest[0]]))
    borders = np.concatenate([[0.0], np.cumsum(sizes)])
    return JointSpline(arm, borders, np.array(pieces), borders[stops])
