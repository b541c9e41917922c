"""Round a path's corners by parabolas that are proved free.

A corner between two legs is cut by the quadratic Bezier curve that leaves the legs at equal distances d from it;
its control point is the corner. With unit vectors u and v along the legs it comes within d |v - u| / 4 of the corner,
so a tolerance for that distance gives the largest d. Each leg is shared by the corners at its two ends, nearly half to
each. A curve that cannot be proved free is tried with half of d, and so on; a corner left sharp is a stop.
"""

from math import acos, atan2, floor, pi, sqrt

import numpy as np

from planarm.search.path import Path
from planarm.smoothing.smooth_path import Floats
from planarm.smoothing.tip_path import TipPath, TipPieces, TwoLinks, angle_between
from planarm.workspace.free_map import FreeMap
from planarm.workspace.proof import PROVED, prove_curve

DEFAULT_TOLERANCE_CM = 0.5
"""The tip leaves a corner by at most this, unless told otherwise."""

SMALLEST_LEG_CM = 0.01
"""A corner that leaves room for shorter legs only is left sharp: running through it would be nearly a stop anyway."""

LEG_SHARE = 0.499
"""Share of a leg that a corner may take. Two halves would leave pieces as short as the legs' lengths are rounded, in
which the path's acceleration drowns in rounding."""

STRAIGHT = 1e-9
"""Sine of the largest turn between legs that count as one."""

TURNING_BACK = -0.99
"""Cosine of the turn beyond which the tip goes back where it came from: a stop, so that the corner is reached."""

SINGULAR_RAD = 0.01
"""Nearer than this to full stretch or full fold, theta2 turns so sharply on the path that no timing is worth having."""


def blend_corners(path: Path, free_map: FreeMap, tolerance_cm: float | None = DEFAULT_TOLERANCE_CM) -> TipPath:
    """Return the path with its corners rounded as much as tolerance and obstacles allow.

    Args:
        path: way-points of the tip, with straight moves between them that are free.
        free_map: where the tip may be; its margin is kept.
        tolerance_cm: largest distance of the rounded path from a corner; None stops at every corner.

    Raises:
        ValueError: the path has no point, or one that is no number; or the tolerance is not above 0.
    """
    if tolerance_cm is not None and not tolerance_cm > 0.0:
        raise ValueError(f"the tolerance is {tolerance_cm} cm; it must be above 0")
    corners = way_points(path.points_cm)
    arm = free_map.world.arm
    links = TwoLinks(arm.l1_cm, arm.l2_cm, arm.base_x_cm, arm.base_y_cm, arm.side)
    legs = np.diff(corners, axis=0)
    lengths = np.hypot(legs[:, 0], legs[:, 1])
    units = legs / lengths[:, None]
    cuts = np.zeros(len(corners))
    if tolerance_cm is not None:
        for k in range(1, len(corners) - 1):
            largest = LEG_SHARE * min(lengths[k - 1], lengths[k])
            cuts[k] = _proved_cut(corners[k], units[k - 1], units[k], largest, tolerance_cm, free_map)
    return _assemble(links, corners, units, lengths, cuts, arm.turn_start_rad)


def way_points(points_cm: Floats) -> Floats:
    """Return the points without repeated ones and without those in the middle of a straight run, shape (n, 2)."""
    points = np.asarray(points_cm, np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not len(points) or not np.isfinite(points).all():
        raise ValueError(f"a path is one or more finite points (x, y), not an array of shape {points.shape}: {points}")
    kept = [points[0]]
    for point in points[1:]:
        if (point == kept[-1]).all():
            continue
        if len(kept) > 1 and _runs_on(kept[-1] - kept[-2], point - kept[-1]):
            kept[-1] = point
        else:
            kept.append(point)
    return np.array(kept)


def _runs_on(a: Floats, b: Floats) -> bool:
    """Tell whether leg b goes on straight after leg a."""
    sizes = np.hypot(*a) * np.hypot(*b)
    return bool(abs(a[0] * b[1] - a[1] * b[0]) <= STRAIGHT * sizes and a @ b > 0.0)


def _proved_cut(
    corner: Floats, u: Floats, v: Floats, largest_cm: float, tolerance_cm: float, free_map: FreeMap
) -> float:
    """Return the distance from the corner at which a proved parabola leaves the legs; 0 for a stop."""
    if u @ v < TURNING_BACK:
        return 0.0
    cut = min(largest_cm, 4.0 * tolerance_cm / float(np.hypot(*(v - u))))
    while cut >= SMALLEST_LEG_CM:
        verdict, _ = prove_curve(free_map.world, *(corner - cut * u), *corner, *(corner + cut * v))
        if verdict == PROVED:
            return cut
        cut *= 0.5
    return 0.0


def _assemble(
    links: TwoLinks, corners: Floats, units: Floats, lengths: Floats, cuts: Floats, turn_start_rad: float
) -> TipPath:
    """Return the path made of what the cuts leave of each leg, and a parabola at each cut corner."""
    sizes, slopes, bends, tips, stops = [], [], [], [corners[0]], []
    for k, length in enumerate(lengths):
        rest = length - cuts[k] - cuts[k + 1]
        if rest > STRAIGHT * length:
            sizes.append(rest)
            slopes.append(units[k])
            bends.append(np.zeros(2))
            tips.append(corners[k + 1] - cuts[k + 1] * units[k])
        if cuts[k + 1] > 0.0:
            sizes.append(2.0 * cuts[k + 1])
            slopes.append(units[k])
            bends.append((units[k + 1] - units[k]) / (2.0 * cuts[k + 1]))
            tips.append(corners[k + 1] + cuts[k + 1] * units[k + 1])
        elif k + 1 < len(lengths):
            stops.append(len(sizes))
    borders = np.concatenate([[0.0], np.cumsum(sizes)])
    tips_cm = np.array(tips)
    pieces = TipPieces(
        borders,
        tips_cm,
        np.array(slopes or [np.zeros(2)]),
        np.array(bends or [np.zeros(2)]),
        _directions_rad(links, tips_cm, turn_start_rad),
    )
    return TipPath(links, pieces, borders[stops])


def _directions_rad(links: TwoLinks, tips_cm: Floats, turn_start_rad: float) -> Floats:
    """Return the tip's direction at each border, without jumps, so that theta1 starts in the turn of its limits."""
    to_tips = tips_cm - (links.base_x_cm, links.base_y_cm)
    turns = angle_between(to_tips[:-1], to_tips[1:])
    first = atan2(to_tips[0, 1], to_tips[0, 0])
    r2, l1, l2 = float(to_tips[0] @ to_tips[0]), links.l1_cm, links.l2_cm
    beta = acos(min(1.0, max(-1.0, (r2 + l1 * l1 - l2 * l2) / (2.0 * l1 * sqrt(r2)))))
    theta1 = first + links.side * beta
    first -= 2.0 * pi * floor((theta1 - turn_start_rad) / (2.0 * pi))
    return first + np.concatenate([[0.0], np.cumsum(turns)])


def bends_everywhere(path: TipPath) -> bool:
    """Tell whether theta2 stays clear of 0 and pi."""
    return bool(_least_bend(path)[0] >= np.sin(SINGULAR_RAD))


def stretched_place(path: TipPath) -> str:
    """Say where the elbow is nearest to full stretch or full fold."""
    return path.place(_least_bend(path)[1])


def _least_bend(path: TipPath) -> tuple[float, float]:
    """Return (least |sin theta2|, its s): at an end of a piece, or where the tip is nearest or farthest on it."""
    s = np.concatenate([path.borders_s, *(_distance_extremes(path, k) for k in range(len(path.pieces.slopes)))])
    sines = np.nan_to_num(np.abs(np.sin(path.evaluate(s).q_rad[:, 1])))
    worst = int(np.argmin(sines))
    return float(sines[worst]), float(s[worst])


def _distance_extremes(path: TipPath, k: int) -> Floats:
    """Return s inside piece k where the tip's distance from the base is stationary: to_tip . d(tip)/ds = 0, a cubic."""
    pieces = path.pieces
    if len(pieces.borders_s) == 1:
        return np.zeros(0)
    start = pieces.tips_cm[k] - (path.links.base_x_cm, path.links.base_y_cm)
    slope, bend = pieces.slopes[k], pieces.bends_per_cm[k]
    if not bend.any():
        into = np.array([-(start @ slope) / (slope @ slope)])
    else:
        roots = np.roots([0.5 * bend @ bend, 1.5 * slope @ bend, slope @ slope + start @ bend, start @ slope])
        into = np.real(roots[np.abs(np.imag(roots)) <= STRAIGHT])
    size = pieces.borders_s[k + 1] - pieces.borders_s[k]
    return np.asarray(pieces.borders_s[k] + into[(into > 0.0) & (into < size)])
