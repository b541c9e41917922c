"""Proof that the links stay clear of a point while the tip moves a short way straight on: to second order.

The disc bound of `planarm.workspace.proof` knows how far the arm may move, not where to, so near an obstacle it needs
pieces as short as the clearance. Here the arm's motion is known: pieces as long as the clearance's root will do.

With e and f the links as vectors, u the tip's direction, s its way, D = e x f = l1 l2 sin theta2, and a dot for d/ds:
theta1. = (f . u) / D, and link 2's heading turns by alpha. = -(e . u) / D. With |D| >= D0 and r <= r1 on the piece,
D. = (e . f)(alpha. - theta1.) and alpha. - theta1. = -(u . (e + f)) / D give

    |theta1.| <= l2 / D0,    |theta1..| <= l1 l2 / D0^2 + l1 l2^2 r1 / D0^3,    and for alpha the same with l1 and l2
    exchanged.

Two certificates, each enough alone for a link; h is half the piece's length, all values are those at its middle:

- The line through the link stays farther than `keep` from the point c. Its distance is g = n . (p - c), n the link's
  normal, p its end; |g| falls by at most |g.| h + sup |g..| h^2 / 2, and what that leaves must exceed `keep`.
- A fixed direction n parts them: n . (p - c) > keep for both ends of the link on the whole piece, and so for all points
  between its ends.

The first fits where the link's side passes the point, the second where an end of it does.
"""

from math import sqrt

from planarm.model.kinematics import ROUNDING_CM
from planarm_wire.kernel_cache import kernel


@kernel
def turning_bounds(l_near: float, l_far: float, least_cross: float, r_most: float) -> tuple[float, float]:
    """Return bounds of a heading's first and second derivative, in rad/cm and rad/cm^2.

    Args:
        l_near: length of the link whose heading it is.
        l_far: length of the other one.
        least_cross: the least |e x f| on the piece, in cm^2.
        r_most: the tip's greatest distance from the base on it, in cm.
    """
    first = l_far / least_cross
    return first, l_near * first / least_cross * (1.0 + first * r_most)


@kernel
def link1_stays_clear(
    cx: float, cy: float, keep_cm: float, ex: float, ey: float, turn: float, bounds: tuple[float, float], half_cm: float
) -> bool:
    """Tell whether link 1 is proved to stay farther than `keep_cm` from c, both seen from the base.

    Args:
        cx: the point's x.
        cy: its y.
        keep_cm: a distance.
        ex: the elbow's x at the piece's middle.
        ey: its y.
        turn: theta1's derivative there, in rad/cm.
        bounds: of its first and second derivative on the piece.
        half_cm: half the length of the piece.
    """
    keep = keep_cm + ROUNDING_CM
    l1 = sqrt(ex * ex + ey * ey)
    tx, ty = ex / l1, ey / l1
    along, aside = tx * cx + ty * cy, tx * cy - ty * cx
    bend = (bounds[1] + bounds[0] * bounds[0]) * 0.5 * half_cm * half_cm
    if abs(aside) - abs(turn * along) * half_cm - bend * sqrt(cx * cx + cy * cy) > keep:
        return True
    share = min(l1, max(0.0, along))
    nx, ny = share * tx - cx, share * ty - cy
    apart = sqrt(nx * nx + ny * ny)
    if apart <= keep:
        return False
    nx, ny = nx / apart, ny / apart
    base = -nx * cx - ny * cy
    elbow = base + nx * ex + ny * ey - abs(turn * (ny * ex - nx * ey)) * half_cm - bend * l1
    return base > keep and elbow > keep


@kernel
def link2_stays_clear(
    cx: float,
    cy: float,
    keep_cm: float,
    ex: float,
    ey: float,
    x: float,
    y: float,
    ux: float,
    uy: float,
    turns: tuple[float, float],
    bounds1: tuple[float, float],
    bounds2: tuple[float, float],
    half_cm: float,
) -> bool:
    """Tell whether link 2 is proved to stay farther than `keep_cm` from c; everything is seen from the base.

    Args:
        cx: the point's x.
        cy: its y.
        keep_cm: a distance.
        ex: the elbow's x at the piece's middle.
        ey: its y.
        x: the tip's x there.
        y: its y.
        ux: x of the tip's direction, of length 1.
        uy: its y.
        turns: derivatives of theta1 and of link 2's heading at the middle, in rad/cm.
        bounds1: of theta1's first and second derivative on the piece.
        bounds2: of those of link 2's heading.
        half_cm: half the length of the piece.
    """
    keep = keep_cm + ROUNDING_CM
    fx, fy, vx, vy = x - ex, y - ey, x - cx, y - cy
    l2 = sqrt(fx * fx + fy * fy)
    tx, ty = fx / l2, fy / l2
    along, aside = tx * vx + ty * vy, tx * vy - ty * vx
    per_step = tx * uy - ty * ux - turns[1] * along
    farthest = sqrt(vx * vx + vy * vy) + half_cm
    bend = (bounds2[1] + bounds2[0] * bounds2[0]) * farthest + 2.0 * bounds2[0]
    if abs(aside) - abs(per_step) * half_cm - 0.5 * bend * half_cm * half_cm > keep:
        return True
    back = min(l2, max(0.0, along))
    nx, ny = vx - back * tx, vy - back * ty
    apart = sqrt(nx * nx + ny * ny)
    if apart <= keep:
        return False
    nx, ny = nx / apart, ny / apart
    tip = nx * vx + ny * vy - abs(nx * ux + ny * uy) * half_cm
    bend = (bounds1[1] + bounds1[0] * bounds1[0]) * sqrt(ex * ex + ey * ey)
    elbow = nx * (ex - cx) + ny * (ey - cy) - abs(turns[0] * (ny * ex - nx * ey)) * half_cm
    return tip > keep and elbow - 0.5 * bend * half_cm * half_cm > keep
