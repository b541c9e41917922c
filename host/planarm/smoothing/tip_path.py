"""A smooth path of a two-link arm's tip, and what it asks of the joints.

The tip runs through pieces on each of which its position is a quadratic polynomial of s: straight pieces, and parabolas
that round the corners. s is the length along the polygon of way-points: on a straight piece it is the tip's arc length,
and a parabola that leaves its corner's legs at a distance d from the corner takes 2 d of it. With that, d(tip)/ds is
continuous from leg to leg, so q(s) and q'(s) are continuous everywhere but at stops, and q''(s) jumps only at borders.
"""

from dataclasses import dataclass
from math import atan2, nan, sqrt
from typing import NamedTuple

import numpy as np

from planarm.model.kinematics import ElbowSide
from planarm.smoothing.joint_spline import piece_at
from planarm.smoothing.smooth_path import Floats, JointState, Side
from planarm_wire.kernel_cache import kernel

BEYOND = 1.0 + 1e-12
"""A cosine of theta2 up to this is full stretch or fold with a rounding error."""


class TwoLinks(NamedTuple):
    """A two-link arm on one elbow side, as far as its kinematics go."""

    l1_cm: float
    l2_cm: float
    base_x_cm: float
    base_y_cm: float
    side: float
    """+1 for elbow "up" (theta2 <= 0), -1 for "down"."""


class TipPieces(NamedTuple):
    """The pieces as flat arrays, as kernels read them."""

    borders_s: Floats
    """Ends of the pieces from 0, shape (pieces + 1,)."""
    tips_cm: Floats
    """Tip at each border, shape (pieces + 1, 2)."""
    slopes: Floats
    """d(tip)/ds at the start of each piece, shape (pieces, 2)."""
    bends_per_cm: Floats
    """d2(tip)/ds2 of each piece, zero where it is straight, shape (pieces, 2)."""
    directions_rad: Floats
    """Direction of the tip from the base at each border, without jumps, shape (pieces + 1,)."""


@dataclass(frozen=True, slots=True, eq=False)
class TipPath:
    """Quadratic pieces of the tip, of one elbow side; fulfils `planarm.smoothing.smooth_path.SmoothPath`.

    Attributes:
        links: the arm.
        pieces: the curve; one piece without length when the tip does not move.
        stops_s: borders at which d(tip)/ds jumps: corners that could not be rounded.
    """

    links: TwoLinks
    pieces: TipPieces
    stops_s: Floats

    @property
    def borders_s(self) -> Floats:
        """Path parameters at the ends of the pieces, from 0; one border when the tip does not move."""
        return self.pieces.borders_s

    @property
    def length_cm(self) -> float:
        """The range of s, which is the length of the polygon of way-points."""
        return float(self.borders_s[-1])

    @property
    def elbow(self) -> ElbowSide:
        """The elbow side of the whole path."""
        return "up" if self.links.side > 0.0 else "down"

    def tip_cm(self, s: Floats) -> Floats:
        """Return the tip's positions, shape (m, 2), at s of shape (m,)."""
        s = np.ascontiguousarray(s, np.float64)
        tips = np.empty((len(s), 2))
        _tips(self.pieces, s, tips)
        return tips

    def evaluate(self, s: Floats, side: Side = "right") -> JointState:
        """Return joint angles and derivatives at s of shape (m,); at a border, of the piece on the given side.

        NaN where the arm does not reach; the derivatives also where it is straight (|theta2| = 0 or pi).
        """
        s = np.ascontiguousarray(s, np.float64)
        state = JointState(*(np.empty((len(s), 2)) for _ in range(3)))
        _evaluate(self.links, self.pieces, s, side == "left", *state)
        return state

    def place(self, s: float) -> str:
        """Say where s is: along the path, and the tip's position."""
        x, y = self.tip_cm(np.array([s]))[0]
        return f"path {s:.2f} of {self.length_cm:.2f} cm, tip ({x:.2f}, {y:.2f}) cm"


def angle_between(a: Floats, b: Floats) -> Floats:
    """Return the signed angles from vectors a to vectors b, each of shape (m, 2), in (-pi, pi]."""
    turned: Floats = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    return turned


@kernel
def _tips(pieces: TipPieces, s: Floats, tips: Floats) -> None:
    borders, starts, slopes, bends = pieces.borders_s, pieces.tips_cm, pieces.slopes, pieces.bends_per_cm
    piece = int(np.int64(0))  # not a literal, for which `piece_at` would be compiled once more
    for i in range(s.shape[0]):
        piece = piece_at(borders, s[i], False, piece)
        x = s[i] - borders[piece]
        for axis in range(2):
            tips[i, axis] = starts[piece, axis] + x * (slopes[piece, axis] + 0.5 * x * bends[piece, axis])


@kernel
def _evaluate(links: TwoLinks, pieces: TipPieces, s: Floats, left: bool, q: Floats, dq: Floats, ddq: Floats) -> None:
    """Fill the joints' angles and derivatives (paper C, eqs. 3-9, with the sign of eq. 9 corrected, for q).

    tip' = J q', and tip'' = J q'' - e (q1')^2 - f (q1' + q2')^2
    with e from the base to the elbow and f from the elbow to the tip, since each link's end is accelerated to its
    centre; both are solved with J = [perp(e + f), perp(f)], whose determinant is e x f.
    """
    # Each array is taken out of the tuple once: Numba counts a reference every time.
    borders, starts, slopes, bends = pieces.borders_s, pieces.tips_cm, pieces.slopes, pieces.bends_per_cm
    directions = pieces.directions_rad
    l1, l2 = links.l1_cm, links.l2_cm
    squares, twice = l1 * l1 + l2 * l2, 1.0 / (2.0 * l1 * l2)
    piece = int(np.int64(0))  # not a literal, for which `piece_at` would be compiled once more
    for i in range(s.shape[0]):
        piece = piece_at(borders, s[i], left, piece)
        x = s[i] - borders[piece]
        ax, ay = starts[piece, 0] - links.base_x_cm, starts[piece, 1] - links.base_y_cm
        bend_x, bend_y = bends[piece, 0], bends[piece, 1]
        tip_x = ax + x * (slopes[piece, 0] + 0.5 * x * bend_x)
        tip_y = ay + x * (slopes[piece, 1] + 0.5 * x * bend_y)
        slope_x, slope_y = slopes[piece, 0] + x * bend_x, slopes[piece, 1] + x * bend_y
        cosine = (tip_x * tip_x + tip_y * tip_y - squares) * twice
        sine = -links.side * sqrt(max(0.0, (1.0 - cosine) * (1.0 + cosine))) if abs(cosine) <= BEYOND else nan
        # The tip as link 1 sees it, along and aside; turned to where the tip is, link 1 points along e.
        along, aside = l1 + l2 * cosine, l2 * sine
        r2 = along * along + aside * aside
        turn = l1 / r2 if r2 > 0.0 else nan
        ex, ey = turn * (along * tip_x + aside * tip_y), turn * (along * tip_y - aside * tip_x)
        fx, fy = tip_x - ex, tip_y - ey
        q[i, 0] = directions[piece] + atan2(ax * tip_y - ay * tip_x, ax * tip_x + ay * tip_y) - atan2(aside, along)
        q[i, 1] = atan2(sine, cosine)
        w1, w2 = _turning_rates(ex, ey, fx, fy, slope_x, slope_y)
        dq[i, 0], dq[i, 1] = w1, w2 - w1
        pull_x, pull_y = bend_x + ex * w1 * w1 + fx * w2 * w2, bend_y + ey * w1 * w1 + fy * w2 * w2
        w1, w2 = _turning_rates(ex, ey, fx, fy, pull_x, pull_y)
        ddq[i, 0], ddq[i, 1] = w1, w2 - w1


@kernel
def _turning_rates(ex: float, ey: float, fx: float, fy: float, vx: float, vy: float) -> tuple[float, float]:
    """Return the links' turning rates w1, w2 that move the tip by v = perp(e) w1 + perp(f) w2.

    The scalar product with f removes w2, and with e removes w1: perp(e) . f = e x f, perp(f) . e = -(e x f).
    """
    determinant = ex * fy - ey * fx
    if determinant == 0.0:
        return nan, nan
    return (vx * fx + vy * fy) / determinant, -(vx * ex + vy * ey) / determinant
