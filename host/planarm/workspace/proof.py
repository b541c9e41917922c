"""Proofs that a moving arm stays free, by a bound on its motion; nothing here is sampled.

The bound. While the tip moves by ds, link 1 turns by (f . ds) / (e x f), with e and f the links as vectors: by at
most ds / (l1 |sin theta2|), so the elbow moves at most ds / |sin theta2|. Let the tip stay in a disc of radius rho
around c, r_c from the base. |sin theta2|, as a function of the tip's distance r, rises and then falls, so on the disc
it is least at r_c - rho or r_c + rho, and the elbow moves at most D = rho / min |sin theta2| on the straight way to any
point of the disc. Every point of link 1 moves no farther than the elbow, and every point of link 2, whose displacement
lies between those of its ends, no farther than the farther-moving end: D bounds them all. A disc is free when the
clearance at its centre exceeds the margin by more than this.

Near full stretch and full fold, where sin theta2 vanishes, another bound is finite: the tip's direction changes by at
most asin(rho / r_c), its distance r stays in [r_c - rho, r_c + rho], clipped to what reach and theta2's limits allow.
With theta1 = phi +- beta(r), cos beta = (r^2 + l1^2 - l2^2) / (2 r l1), beta has its extremes at the ends of that range
or at r* = sqrt(l1^2 - l2^2), where link 2 stands at a right angle to the tip's direction. So theta1 changes by at most
dtheta1 = asin(rho / r_c) + max |beta(r) - beta(r_c)|, and the elbow moves at most 2 l1 sin(dtheta1 / 2).

A curve is proved free by covering it with discs, found by bisection. On a straight line more is known than how far the
arm may move, namely what its links sweep (`planarm.workspace.straight_sweep`): a line is divided into pieces whose
sweeps are shown to be free, most often one.
"""

from math import acos, asin, hypot, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from planarm.model.collision import point_segment_distance2, segment_polygon_distance
from planarm.model.kinematics import ROUNDING_CM
from planarm.workspace.world import (
    FREE,
    ArmWorld,
    TwoLinkArm,
    cos_beta_at,
    elbow_from_base,
    floor_clearance,
    links_apart2,
    region_at,
    theta1_at,
    within_limits,
)
from planarm_wire.kernel_cache import bare_kernel, kernel

Floats = NDArray[np.float64]

# Verdicts: the whole piece is free; a pose on it is not (the counterexample is told); neither could be shown.
PROVED, BLOCKED, UNPROVED = 0, 1, 2

ALL = -1
"""Stands for the number of obstacles to look at."""

SMALLEST_CM = 1e-3
"""Half the length of the shortest piece of a line or curve: what cannot be proved with it stays unproved."""


@kernel
def displacement_bound(arm: TwoLinkArm, r_cm: float, rho_cm: float) -> float:
    """Return a bound in cm of any point's displacement while the tip moves from a disc's centre to elsewhere in it.

    Args:
        arm: the arm.
        r_cm: distance of the disc's centre from the base, within reach and limits.
        rho_cm: the disc's radius.
    """
    half, scale = 0.5 * (arm.l1_cm * arm.l1_cm + arm.l2_cm * arm.l2_cm), 1.0 / (arm.l1_cm * arm.l2_cm)
    cos_here = (0.5 * r_cm * r_cm - half) * scale
    sin2 = least_sin2(arm, r_cm, rho_cm)
    if 4.0 * sin2 >= 1.0 - cos_here * cos_here and sin2 > 0.0:
        return rho_cm / sqrt(sin2)
    turned = motion_bound(arm, r_cm, rho_cm)[1]
    return turned if sin2 <= 0.0 else min(turned, rho_cm / sqrt(sin2))


@kernel
def least_sin2(arm: TwoLinkArm, r_cm: float, rho_cm: float) -> float:
    """Return the least sin^2 theta2 on a disc whose centre is r from the base; not above 0 if it holds a singular pose.

    Args:
        arm: the arm.
        r_cm: distance of the disc's centre from the base.
        rho_cm: the disc's radius.
    """
    half, scale = 0.5 * (arm.l1_cm * arm.l1_cm + arm.l2_cm * arm.l2_cm), 1.0 / (arm.l1_cm * arm.l2_cm)
    low, high = max(r_cm - rho_cm, 0.0), r_cm + rho_cm
    cos_low, cos_high = (0.5 * low * low - half) * scale, (0.5 * high * high - half) * scale
    return 1.0 - max(cos_low * cos_low, cos_high * cos_high)


@kernel
def motion_bound(arm: TwoLinkArm, r_cm: float, rho_cm: float) -> tuple[float, float]:
    """Return bounds (of theta1's change in rad, of any point's displacement in cm) that hold near singular poses, too.

    Args:
        arm: the arm.
        r_cm: distance of the disc's centre from the base, within reach and limits.
        rho_cm: the disc's radius.
    """
    low, high = max(r_cm - rho_cm, arm.r_min_cm), min(r_cm + rho_cm, arm.r_max_cm)
    beta = acos(cos_beta_at(arm, r_cm))
    dbeta = max(abs(acos(cos_beta_at(arm, low)) - beta), abs(acos(cos_beta_at(arm, high)) - beta))
    extreme2 = arm.l1_cm * arm.l1_cm - arm.l2_cm * arm.l2_cm
    if low * low < extreme2 < high * high:
        dbeta = max(dbeta, abs(acos(cos_beta_at(arm, sqrt(extreme2))) - beta))
    dphi = asin(rho_cm / r_cm) if rho_cm < r_cm else pi
    dtheta1 = min(pi, dphi + dbeta)
    return dtheta1, max(rho_cm, 2.0 * arm.l1_cm * sin(0.5 * dtheta1))


@kernel
def disc_verdict(world: ArmWorld, x_cm: float, y_cm: float, rho_cm: float) -> int:
    """Judge all poses with the tip in the disc around (x, y), as far as its tip distances are within reach and limits.

    BLOCKED means that the pose at the centre is not free. A disc that holds the base is never proved.
    """
    obstacles = world.obstacles
    return judge_disc(
        world.arm,
        obstacles.centers_cm,
        obstacles.radii_cm,
        obstacles.first_vertex,
        obstacles.vertices_cm,
        obstacles.first_vertex,
        ALL,
        x_cm - world.arm.base_x_cm,
        y_cm - world.arm.base_y_cm,
        rho_cm,
    )


@bare_kernel
def judge_disc(
    arm: TwoLinkArm,
    centers_cm: Floats,
    radii_cm: Floats,
    first_vertex: NDArray[np.int64],
    vertices_cm: Floats,
    near: NDArray[np.int64],
    count: int,
    x: float,
    y: float,
    rho_cm: float,
) -> int:
    """`disc_verdict` for a disc around (x, y) from the base, with the obstacles' arrays one by one, which is faster.

    Only the obstacles in the first `count` places of `near` are looked at; all when `count` is ALL.
    """
    bx, by, margin, per_l1, per_l2 = arm.base_x_cm, arm.base_y_cm, arm.margin_cm, arm.per_l1, arm.per_l2
    r2 = x * x + y * y
    r = sqrt(r2)
    if region_at(arm, r) != FREE:
        return BLOCKED
    ex, ey = elbow_from_base(arm, x, y, r2, r)
    moves = displacement_bound(arm, r, rho_cm) + ROUNDING_CM
    height = floor_clearance(arm, by + ey, by + y)
    if height <= margin:
        return BLOCKED
    free = rho_cm < r and height > margin + moves
    for k in range(radii_cm.size if count == ALL else count):
        i = k if count == ALL else near[k]
        cx, cy, keep = centers_cm[i, 0] - bx, centers_cm[i, 1] - by, radii_cm[i] + margin
        apart2 = links_apart2(cx, cy, ex, ey, x, y, per_l1, per_l2)
        if apart2 > (keep + moves) * (keep + moves):
            continue
        first, end = first_vertex[i], first_vertex[i + 1]
        if first == end:
            blocked, clear = apart2 <= keep * keep, False
        else:
            apart = min(
                segment_polygon_distance(bx, by, bx + ex, by + ey, vertices_cm, first, end),
                segment_polygon_distance(bx + ex, by + ey, bx + x, by + y, vertices_cm, first, end),
            )
            blocked, clear = apart <= margin, apart > margin + moves
        if blocked:
            return BLOCKED
        free = free and clear
    if within_limits(arm, bx + ex, by + ey, moves):
        return PROVED if free else UNPROVED
    theta1 = theta1_at(arm, bx + x, by + y, acos(cos_beta_at(arm, r)))
    return BLOCKED if theta1 < arm.theta1_min_rad or theta1 > arm.theta1_max_rad else UNPROVED


@kernel
def disc_within_reach(arm: TwoLinkArm, r_cm: float, rho_cm: float) -> bool:
    """Tell whether every point of a disc, its centre r from the base, is within reach and the limits of theta2."""
    return r_cm - rho_cm >= arm.r_min_cm and r_cm + rho_cm <= arm.r_max_cm


@bare_kernel
def next_piece(start: float, width: float) -> tuple[float, float]:
    """Return (start, width) of the piece to judge after [start, start + width] of a bisection of [0, 1] is settled."""
    start += width
    while width < 1.0 and start % (2.0 * width) == 0.0:
        width *= 2.0
    return start, width


@kernel
def prove_curve(world: ArmWorld, x0: float, y0: float, x1: float, y1: float, x2: float, y2: float) -> tuple[int, float]:
    """Judge the tip's move along the quadratic Bezier curve with the control points 0, 1, 2, in cm.

    Each piece of the curve lies in the triangle of its own control points: that triangle must be within reach and
    limits, and a disc around the piece's middle that holds it must be free. Returns (verdict, parameter) as
    `prove_line` does; the parameter is the curve's, 0 to 1.
    """
    start, width = 0.0, 1.0
    while start < 1.0:
        end = start + width
        ax, bx, cx = bezier_piece(x0, x1, x2, start, end)
        ay, by, cy = bezier_piece(y0, y1, y2, start, end)
        mx, my = 0.25 * (ax + 2.0 * bx + cx), 0.25 * (ay + 2.0 * by + cy)
        rho = max(hypot(ax - mx, ay - my), hypot(bx - mx, by - my), hypot(cx - mx, cy - my))
        verdict = disc_verdict(world, mx, my, rho)
        if verdict == PROVED and not triangle_within_reach(world.arm, ax, ay, bx, by, cx, cy):
            verdict = UNPROVED
        if verdict == PROVED:
            start, width = next_piece(start, width)
        elif verdict == BLOCKED or rho <= SMALLEST_CM:
            return verdict, start + 0.5 * width
        else:
            width *= 0.5
    return PROVED, 1.0


@kernel
def bezier_piece(p0: float, p1: float, p2: float, start: float, end: float) -> tuple[float, float, float]:
    """Return the control values of the piece [start, end] of a quadratic Bezier, one coordinate (blossoming)."""
    return (
        blossom(p0, p1, p2, start, start),
        blossom(p0, p1, p2, start, end),
        blossom(p0, p1, p2, end, end),
    )


@kernel
def blossom(p0: float, p1: float, p2: float, s: float, t: float) -> float:
    """Return the polar form of a quadratic Bezier: its value for s = t, a piece's control value for s < t."""
    return (1.0 - s) * ((1.0 - t) * p0 + t * p1) + s * ((1.0 - t) * p1 + t * p2)


@kernel
def triangle_within_reach(arm: TwoLinkArm, ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> bool:
    """Tell whether every point of a triangle that does not hold the base is within reach and the limits of theta2."""
    ox, oy = arm.base_x_cm, arm.base_y_cm
    farthest = max(hypot(ax - ox, ay - oy), hypot(bx - ox, by - oy), hypot(cx - ox, cy - oy))
    nearest2 = min(
        point_segment_distance2(ox, oy, ax, ay, bx, by),
        point_segment_distance2(ox, oy, bx, by, cx, cy),
        point_segment_distance2(ox, oy, cx, cy, ax, ay),
    )
    return region_at(arm, farthest) == FREE and region_at(arm, sqrt(nearest2)) == FREE
