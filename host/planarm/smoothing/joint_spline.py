"""A smooth path in joint space: cubic pieces of the joint angles, for any number of joints.

Polylines of poses with rounded corners and splines that were optimised for time both end here. Nothing is singular in
joint space, so such a path may run through full stretch and full fold.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.smoothing.smooth_path import Floats, JointState, Side
from planarm_wire.kernel_cache import kernel


@dataclass(frozen=True, slots=True, eq=False)
class JointSpline:
    """Cubic pieces of n joint angles; fulfils `planarm.smoothing.smooth_path.SmoothPath`.

    Attributes:
        arm: the arm, to tell where the tip is.
        borders_s: s at the ends of the pieces, from 0, shape (pieces + 1,); one border when nothing moves.
        coefficients: the angle of joint j on piece p is the sum over k of coefficients[p, k, j] (s - borders_s[p])^k,
            shape (pieces, 4, n); one piece when nothing moves.
        stops_s: borders at which dq/ds jumps.
    """

    arm: Arm
    borders_s: Floats
    coefficients: Floats
    stops_s: Floats

    def evaluate(self, s: Floats, side: Side = "right") -> JointState:
        """Return joint angles and derivatives at s of shape (m,); at a border, of the piece on the given side."""
        s = np.ascontiguousarray(s, np.float64)
        state = JointState(*(np.empty((len(s), self.arm.links)) for _ in range(3)))
        _evaluate(self.borders_s, self.coefficients, s, side == "left", *state)
        return state

    def tip_cm(self, s: Floats) -> Floats:
        """Return the tip's positions, shape (m, 2), at s of shape (m,)."""
        return forward(self.arm, self.evaluate(s).q_rad)[:, -1]

    def place(self, s: float) -> str:
        """Say where s is: along the path, and the tip's position."""
        x, y = self.tip_cm(np.array([s]))[0]
        return f"path {s:.3f} of {self.borders_s[-1]:.3f} rad, tip ({x:.2f}, {y:.2f}) cm"


def joined(splines: Sequence[JointSpline]) -> JointSpline:
    """Return one path through all of them, each of which ends where the next begins, with stops in between."""
    lengths = [float(spline.borders_s[-1]) for spline in splines]
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    inner = [start + spline.borders_s[1:] for start, spline in zip(starts, splines, strict=False)]
    stops = [start + spline.stops_s for start, spline in zip(starts, splines, strict=False)]
    return JointSpline(
        splines[0].arm,
        np.concatenate([[0.0], *inner]),
        np.concatenate([spline.coefficients for spline in splines]),
        np.unique(np.concatenate([*stops, starts[1:-1]])),
    )


def run_on(splines: Sequence[JointSpline]) -> JointSpline:
    """Return one path through all of them, each of which ends where, and in the direction in which, the next begins."""
    whole = joined(splines)
    starts = np.cumsum([0.0, *(float(spline.borders_s[-1]) for spline in splines)])
    stops = [start + spline.stops_s for start, spline in zip(starts, splines, strict=False)]
    return replace(whole, stops_s=np.unique(np.concatenate(stops)))


def scaled(spline: JointSpline, factor: float) -> JointSpline:
    """Return the same path with a parameter that grows slower by a factor: dq/ds is so many times as large."""
    powers = factor ** np.arange(4.0)
    return JointSpline(
        spline.arm, spline.borders_s / factor, spline.coefficients * powers[:, None], spline.stops_s / factor
    )


def part_of(spline: JointSpline, from_s: float, to_s: float) -> JointSpline:
    """Return the part between two parameters, from < to; its own parameter begins at 0."""
    borders = spline.borders_s
    inner = borders[(borders > from_s) & (borders < to_s)]
    cuts = np.concatenate([[from_s], inner, [to_s]])
    pieces = np.clip(np.searchsorted(borders, cuts[:-1], side="right") - 1, 0, len(borders) - 2)
    x = (cuts[:-1] - borders[pieces])[:, None]
    a, b, c, d = np.moveaxis(spline.coefficients[pieces], 1, 0)
    # About x in place of the piece's start; where a piece is whole, x is 0 and nothing changes.
    shifted = np.stack([a + x * (b + x * (c + x * d)), b + x * (2 * c + 3 * x * d), c + 3 * x * d, d], axis=1)
    stops = spline.stops_s[(spline.stops_s > from_s) & (spline.stops_s < to_s)]
    return JointSpline(spline.arm, cuts - from_s, np.ascontiguousarray(shifted), stops - from_s)


@kernel
def _evaluate(borders: Floats, coefficients: Floats, s: Floats, left: bool, q: Floats, dq: Floats, ddq: Floats) -> None:
    piece = int(np.int64(0))  # not a literal, for which `piece_at` would be compiled once more
    for i in range(s.shape[0]):
        piece = piece_at(borders, s[i], left, piece)
        x = s[i] - borders[piece]
        for j in range(q.shape[1]):
            a, b = coefficients[piece, 0, j], coefficients[piece, 1, j]
            c, d = coefficients[piece, 2, j], coefficients[piece, 3, j]
            q[i, j] = a + x * (b + x * (c + x * d))
            dq[i, j] = b + x * (2.0 * c + 3.0 * x * d)
            ddq[i, j] = 2.0 * c + 6.0 * x * d


@kernel
def piece_at(borders: Floats, s: float, left: bool, near: int) -> int:
    """Return the piece that holds s, at a border the one on the left or on the right; quick when `near` is near."""
    piece, last = near, borders.shape[0] - 2
    while piece < last and (borders[piece + 1] < s or (borders[piece + 1] == s and not left)):
        piece += 1
    while piece > 0 and (borders[piece] > s or (borders[piece] == s and left)):
        piece -= 1
    return piece
