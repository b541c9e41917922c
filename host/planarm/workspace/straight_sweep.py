"""What both links sweep while the tip moves straight on: in closed form, without a bound on speeds.

Seen from the base, with u the tip's direction, n the normal to its left, e and f the links as vectors and x = e + f:
theta1 changes at (f . u) / (e x f), so it turns back only where link 2 stands at a right angle to the line. There
f = s l2 n with s = 1 or -1; since n . x = p is the same all along the line, n . e = p - s l2, and the elbow's side
fixes the sign of e x f: joint 1 turns back where u . x is -side s sqrt(l1^2 - (p - s l2)^2), for each s at one place at
most, and it does turn back there. Between such places the elbow goes one way along its circle, singular poses included.

So on a piece of the line that holds at most one of these places, and on which neither tip nor elbow turns by a right
angle about the base, the elbow stays on a short arc whose ends are known: two of its places at the piece's ends and at
the turn. Then

- link 1 sweeps exactly the sector below the arc;
- every point of link 2 lies between elbow and tip, so link 2 stays in the convex hull of the arc and the tip's way. The
  arc leaves its chord by at most l1 t (1 + t) / 2 with t = (chord / 2 l1)^2, as 1 - sqrt(1 - t) is no more than that;
- no point moves farther from its place at the piece's beginning than the longest of these chords and the tip's way.

What is shown holds for exact poses; those of the kernels are rounded, by less than ROUNDING_CM but near singular poses,
where they, and so what is shown, are true to some 1e-6 cm.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.model.kinematics import ROUNDING_CM
from planarm.workspace.world import TwoLinkArm
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]

UNSURE_CM = 1e-5
"""Near singular poses rounding moves the elbow by some 1e-6 cm: a turn this near to a piece counts as on it."""


class Sweep(NamedTuple):
    """Elbow and tip at the ends of a piece, seen from the base, and the elbow where joint 1 turns back, all in cm."""

    eax: float
    eay: float
    xa: float
    ya: float
    ebx: float
    eby: float
    xb: float
    yb: float
    tx: float
    """The elbow at the turn, or at the beginning where joint 1 does not turn back."""
    ty: float
    turned: bool
    ux: float
    """The tip's direction, of length 1."""
    uy: float
    sag_cm: float
    """Bound of how far the elbow's arc leaves its chords."""
    moves_cm: float
    """Bound of any point's displacement from its place at the beginning."""


@kernel
def sweep_between(
    arm: TwoLinkArm,
    a: tuple[float, float, float, float],
    b: tuple[float, float, float, float],
    ux: float,
    uy: float,
) -> tuple[bool, Sweep]:
    """Return (whether it is known, what the links sweep) on the tip's straight way from pose a to pose b.

    Args:
        arm: the arm.
        a: elbow and tip (ex, ey, x, y) at the beginning, seen from the base.
        b: the same at the end.
        ux: x of the tip's direction, of length 1.
        uy: its y.
    """
    eax, eay, xa, ya = a
    ebx, eby, xb, yb = b
    known = xa * xb + ya * yb > 0.0 and eax * ebx + eay * eby > 0.0
    at_a, at_b = xa * ux + ya * uy, xb * ux + yb * uy
    turning_a, turning_b = at_a - eax * ux - eay * uy, at_b - ebx * ux - eby * uy
    tx, ty, turned = eax, eay, False
    same_sign = min(turning_a, turning_b) > UNSURE_CM or max(turning_a, turning_b) < -UNSURE_CM
    if not same_sign or (at_a < UNSURE_CM and at_b > -UNSURE_CM):
        aside = ux * ya - uy * xa
        count = 0
        for s in (1.0, -1.0):
            off = aside - s * arm.l2_cm
            rest = arm.l1_cm * arm.l1_cm - off * off
            along = -arm.side * s * sqrt(max(0.0, rest))
            if rest > -UNSURE_CM * UNSURE_CM and at_a - UNSURE_CM < along < at_b + UNSURE_CM:
                tx, ty = along * ux - off * uy, along * uy + off * ux
                count += 1
        turned = count > 0
        known = known and count < 2 and tx * eax + ty * eay > 0.0 and tx * ebx + ty * eby > 0.0
    ab2 = (ebx - eax) * (ebx - eax) + (eby - eay) * (eby - eay)
    at2 = (tx - eax) * (tx - eax) + (ty - eay) * (ty - eay)
    bt2 = (tx - ebx) * (tx - ebx) + (ty - eby) * (ty - eby)
    t = 0.25 * max(ab2, at2, bt2) * arm.per_l1
    sag = 0.5 * arm.l1_cm * t * (1.0 + t)
    moves = max(sqrt(max(ab2, at2)), at_b - at_a)
    return known, Sweep(eax, eay, xa, ya, ebx, eby, xb, yb, tx, ty, turned, ux, uy, sag, moves)


@kernel
def link1_keeps_off(arm: TwoLinkArm, sweep: Sweep, cx: float, cy: float, keep_cm: float) -> bool:
    """Tell whether link 1 stays farther than `keep_cm` from the point c, seen from the base, on the whole piece."""
    keep = keep_cm + ROUNDING_CM
    c2 = cx * cx + cy * cy
    if c2 > (arm.l1_cm + keep) * (arm.l1_cm + keep):
        return True
    per_l1, keep2 = arm.per_l1, keep * keep
    if (
        _apart2(cx, cy, sweep.eax, sweep.eay, per_l1) <= keep2
        or _apart2(cx, cy, sweep.ebx, sweep.eby, per_l1) <= keep2
        or (sweep.turned and _apart2(cx, cy, sweep.tx, sweep.ty, per_l1) <= keep2)
    ):
        return False
    if not sweep.turned:
        return not _between(cx, cy, sweep.eax, sweep.eay, sweep.ebx, sweep.eby)
    return not (
        _between(cx, cy, sweep.tx, sweep.ty, sweep.eax, sweep.eay)
        or _between(cx, cy, sweep.tx, sweep.ty, sweep.ebx, sweep.eby)
    )


@kernel
def _apart2(cx: float, cy: float, ex: float, ey: float, per_l1: float) -> float:
    """Return the squared distance from c to the link from the base to e."""
    share = min(1.0, max(0.0, (cx * ex + cy * ey) * per_l1))
    dx, dy = cx - share * ex, cy - share * ey
    return dx * dx + dy * dy


@kernel
def _between(cx: float, cy: float, vx: float, vy: float, wx: float, wy: float) -> bool:
    """Tell whether c lies in the angle between v and w, which is less than a right one."""
    return (vx * cy - vy * cx) * (wx * cy - wy * cx) <= 0.0 and cx * (vx + wx) + cy * (vy + wy) > 0.0


@kernel
def link2_keeps_off(arm: TwoLinkArm, sweep: Sweep, cx: float, cy: float, keep_cm: float) -> bool:
    """Tell whether link 2 is shown to stay farther than `keep_cm` from c on the whole piece.

    Tried are the direction from c to the nearest point of the link between its mean ends, and the line through it.
    """
    ex, ey = 0.5 * (sweep.eax + sweep.ebx), 0.5 * (sweep.eay + sweep.eby)
    fx, fy = 0.5 * (sweep.xa + sweep.xb) - ex, 0.5 * (sweep.ya + sweep.yb) - ey
    share = min(1.0, max(0.0, ((cx - ex) * fx + (cy - ey) * fy) * arm.per_l2))
    nx, ny = ex + share * fx - cx, ey + share * fy - cy
    length, keep = sqrt(nx * nx + ny * ny), keep_cm + ROUNDING_CM
    if _least_of(sweep, 2, nx, ny, length) - nx * cx - ny * cy > keep * length:
        return True
    return share > 0.0 and _line_keeps_off(arm, sweep, cx, cy, keep)


@kernel
def _line_keeps_off(arm: TwoLinkArm, sweep: Sweep, cx: float, cy: float, keep_cm: float) -> bool:
    """Tell whether the line through link 2 is shown to stay farther than `keep_cm` from c on the whole piece.

    With t link 2's direction, its distance is g = t x (c - x), and g is no less than it is at one of the ends less
    L^2 / 8 sup |g..|, a dot for a derivative by the tip's way, L its length. With D = e x f, link 2 turns by
    a. = -(e . u) / D and D changes by -(e . f) (x . u) / D, so

        |g..| <= (|a..| + a.^2) |c - x| + 2 |a.|,  |a..| <= |theta1.| |e x u| / |D| + |e . u| |e . f| |x . u| / |D|^3.
    """
    l1, l2, ux, uy = arm.l1_cm, arm.l2_cm, sweep.ux, sweep.uy
    vax, vay, vbx, vby = cx - sweep.xa, cy - sweep.ya, cx - sweep.xb, cy - sweep.yb
    aside_a = (sweep.xa - sweep.eax) * vay - (sweep.ya - sweep.eay) * vax
    aside_b = (sweep.xb - sweep.ebx) * vby - (sweep.yb - sweep.eby) * vbx
    least = min(abs(aside_a), abs(aside_b)) if aside_a * aside_b > 0.0 else 0.0
    if least <= keep_cm * l2:
        return False
    at_a, at_b, aside = sweep.xa * ux + sweep.ya * uy, sweep.xb * ux + sweep.yb * uy, ux * sweep.ya - uy * sweep.xa
    half = 0.5 * (l1 * l1 + l2 * l2)
    from_a, from_b = 0.5 * (at_a * at_a + aside * aside) - half, 0.5 * (at_b * at_b + aside * aside) - half
    ef = max(abs(from_a), abs(from_b))
    if at_a < 0.0 < at_b:
        ef = max(ef, abs(0.5 * aside * aside - half))
    cross2 = l1 * l1 * l2 * l2 - ef * ef
    if cross2 <= 0.0:
        return False
    per_cross = 1.0 / sqrt(cross2)
    sag = sweep.sag_cm
    ua, ub, ut = (
        sweep.eax * ux + sweep.eay * uy,
        sweep.ebx * ux + sweep.eby * uy,
        sweep.tx * ux + sweep.ty * uy,
    )
    low, high = min(ua, ub, ut) - sag, max(ua, ub, ut) + sag
    eu, fu = max(-low, high), max(at_b - low, high - at_a)
    na, nb, nt = ux * sweep.eay - uy * sweep.eax, ux * sweep.eby - uy * sweep.ebx, ux * sweep.ty - uy * sweep.tx
    en = max(abs(na), abs(nb), abs(nt)) + sag
    first = eu * per_cross
    second = (fu * en + eu * ef * max(-at_a, at_b) * per_cross) * per_cross * per_cross
    farthest = sqrt(max(vax * vax + vay * vay, vbx * vbx + vby * vby))
    bend = (second + first * first) * farthest + 2.0 * first
    most_below = 0.5 * bend * (at_b - at_a) * (at_b - at_a) * l2
    share = max(0.0, 0.5 * (most_below - abs(aside_b - aside_a)))
    return (least - keep_cm * l2) * most_below >= share * share


@kernel
def keeps_off_polygon(
    arm: TwoLinkArm, sweep: Sweep, link: int, vertices_cm: Floats, first: int, end: int, keep_cm: float
) -> bool:
    """Tell whether link 1 or 2 is shown to stay farther than `keep_cm` from a polygon on the whole piece.

    Tried are directions that part them: the link's normal, the normals of the polygon's edges, and those from its
    vertices to the link; then, for link 2, whether the line through it has the whole polygon on one side. The vertices
    first .. end - 1 are as in the scene, not seen from the base.
    """
    bx, by = arm.base_x_cm, arm.base_y_cm
    ex, ey = 0.5 * (sweep.eax + sweep.ebx), 0.5 * (sweep.eay + sweep.eby)
    ax, ay, lx, ly, per_l = 0.0, 0.0, ex, ey, arm.per_l1
    if link == 2:
        ax, ay, lx, ly = ex, ey, 0.5 * (sweep.xa + sweep.xb) - ex, 0.5 * (sweep.ya + sweep.yb) - ey
        per_l = arm.per_l2
    if _is_parted(arm, sweep, link, vertices_cm, first, end, ly, -lx, keep_cm):
        return True
    px, py = vertices_cm[end - 1, 0] - bx, vertices_cm[end - 1, 1] - by
    for k in range(first, end):
        vx, vy = vertices_cm[k, 0] - bx, vertices_cm[k, 1] - by
        share = min(1.0, max(0.0, ((vx - ax) * lx + (vy - ay) * ly) * per_l))
        nx, ny = ax + share * lx - vx, ay + share * ly - vy
        if _is_parted(arm, sweep, link, vertices_cm, first, end, vy - py, px - vx, keep_cm) or _is_parted(
            arm, sweep, link, vertices_cm, first, end, nx, ny, keep_cm
        ):
            return True
        px, py = vx, vy
    return link == 2 and _line_keeps_off_polygon(arm, sweep, vertices_cm, first, end, keep_cm)


@kernel
def _is_parted(
    arm: TwoLinkArm,
    sweep: Sweep,
    link: int,
    vertices_cm: Floats,
    first: int,
    end: int,
    nx: float,
    ny: float,
    keep_cm: float,
) -> bool:
    """Tell whether, along n, the link stays more than `keep_cm` beyond all vertices, or before them."""
    low, high = np.inf, -np.inf
    for i in range(first, end):
        at = nx * (vertices_cm[i, 0] - arm.base_x_cm) + ny * (vertices_cm[i, 1] - arm.base_y_cm)
        low, high = min(low, at), max(high, at)
    length = sqrt(nx * nx + ny * ny)
    keep = (keep_cm + ROUNDING_CM) * length
    return _least_of(sweep, link, nx, ny, length) - high > keep or _least_of(sweep, link, -nx, -ny, length) + low > keep


@kernel
def _line_keeps_off_polygon(
    arm: TwoLinkArm, sweep: Sweep, vertices_cm: Floats, first: int, end: int, keep_cm: float
) -> bool:
    """Tell whether the line through link 2 stays farther than `keep_cm` from all vertices, which are on one side."""
    fx, fy = sweep.xa - sweep.eax, sweep.ya - sweep.eay
    lefts = 0
    for i in range(first, end):
        vx, vy = vertices_cm[i, 0] - arm.base_x_cm, vertices_cm[i, 1] - arm.base_y_cm
        if not _line_keeps_off(arm, sweep, vx, vy, keep_cm + ROUNDING_CM):
            return False
        lefts += fx * (vy - sweep.ya) - fy * (vx - sweep.xa) > 0.0
    return lefts == 0 or lefts == end - first


@kernel
def _least_of(sweep: Sweep, link: int, nx: float, ny: float, length: float) -> float:
    """Return a lower bound of n . x over all points x of a link on the piece; `length` is n's."""
    elbow = min(nx * sweep.eax + ny * sweep.eay, nx * sweep.ebx + ny * sweep.eby, nx * sweep.tx + ny * sweep.ty)
    other = 0.0 if link == 1 else min(nx * sweep.xa + ny * sweep.ya, nx * sweep.xb + ny * sweep.yb)
    return min(elbow - sweep.sag_cm * length, other)


@kernel
def lowest(sweep: Sweep) -> float:
    """Return a lower bound of elbow's and tip's y on the piece, seen from the base."""
    return min(min(sweep.eay, sweep.eby, sweep.ty) - sweep.sag_cm, sweep.ya, sweep.yb)
