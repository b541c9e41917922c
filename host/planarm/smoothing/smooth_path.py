"""A smooth path of the tip, and what it asks of the joints.

The tip runs through pieces on each of which its position is a quadratic polynomial of s: straight pieces, and parabolas
that round the corners. s is the length along the polygon of way-points: on a straight piece it is the tip's arc length,
and a parabola that leaves its corner's legs at a distance d from the corner takes 2 d of it. With that, d(tip)/ds is
continuous from leg to leg, so q(s) and q'(s) are continuous everywhere but at stops, and q''(s) jumps only at borders.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.model.kinematics import ElbowSide
from planarm.smoothing.joint_state import joint_states

Floats = NDArray[np.float64]
Side = Literal["left", "right"]


class JointState(NamedTuple):
    """Joint angles and their derivatives by s, each of shape (m, 2): rad, rad/cm, rad/cm^2."""

    q_rad: Floats
    dq_rad: Floats
    ddq_rad: Floats


@dataclass(frozen=True, slots=True)
class TwoLinks:
    """A two-link arm on one elbow side, as far as its kinematics go."""

    l1_cm: float
    l2_cm: float
    base_cm: tuple[float, float]
    elbow: ElbowSide


@dataclass(frozen=True, slots=True, eq=False)
class SmoothPath:
    """Quadratic pieces of the tip, of one elbow side; fulfils `planarm.trajectory.joint_path.JointPath`.

    Attributes:
        links: the arm.
        borders_s: s at the ends of the pieces, from 0, shape (pieces + 1,); one border when the tip does not move.
        tips_cm: tip at each border, shape (pieces + 1, 2).
        slopes: d(tip)/ds at the start of each piece, shape (pieces, 2).
        bends_per_cm: d2(tip)/ds2 of each piece, zero where it is straight, shape (pieces, 2).
        directions_rad: direction of the tip from the base at each border, without jumps, shape (pieces + 1,).
        stops_s: borders at which d(tip)/ds jumps: corners that could not be rounded.
    """

    links: TwoLinks
    borders_s: Floats
    tips_cm: Floats
    slopes: Floats
    bends_per_cm: Floats
    directions_rad: Floats
    stops_s: Floats

    @property
    def length_cm(self) -> float:
        """The range of s, which is the length of the polygon of way-points."""
        return float(self.borders_s[-1])

    @property
    def elbow(self) -> ElbowSide:
        """The elbow side of the whole path."""
        return self.links.elbow

    def tip_cm(self, s: Floats) -> Floats:
        """Return the tip's positions, shape (m, 2), at s of shape (m,)."""
        s = np.asarray(s, np.float64)
        if len(self.borders_s) == 1:
            return np.tile(self.tips_cm[0], (len(s), 1))
        piece = np.clip(np.searchsorted(self.borders_s, s, side="right") - 1, 0, len(self.slopes) - 1)
        into = (s - self.borders_s[piece])[:, None]
        tip: Floats = self.tips_cm[piece] + into * (self.slopes[piece] + 0.5 * into * self.bends_per_cm[piece])
        return tip

    def evaluate(self, s: Floats, side: Side = "right") -> JointState:
        """Return joint angles and derivatives at s of shape (m,); at a border, of the piece on the given side.

        NaN where the arm does not reach; the derivatives also where it is straight (|theta2| = 0 or pi).
        """
        s = np.ascontiguousarray(s, np.float64)
        if len(self.borders_s) == 1:
            q_rad = joint_angles(self.links, self.tips_cm, self.directions_rad)
            rest = np.zeros((len(s), 2))
            return JointState(rest + q_rad, rest, rest.copy())
        links = self.links
        arm = np.array([links.l1_cm, links.l2_cm, *links.base_cm, -1.0 if links.elbow == "up" else 1.0])
        pieces = np.concatenate([self.slopes, self.bends_per_cm], axis=1)
        return JointState(
            *joint_states(arm, self.borders_s, self.tips_cm, pieces, self.directions_rad, s, side == "right")
        )

    def place(self, s: float) -> str:
        """Say where s is: along the path, and the tip's position."""
        x, y = self.tip_cm(np.array([s]))[0]
        return f"path {s:.2f} of {self.length_cm:.2f} cm, tip ({x:.2f}, {y:.2f}) cm"


def angle_between(a: Floats, b: Floats) -> Floats:
    """Return the signed angles from vectors a to vectors b, each of shape (m, 2), in (-pi, pi]."""
    turned: Floats = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    return turned


def joint_angles(links: TwoLinks, tip_cm: Floats, direction_rad: Floats) -> Floats:
    """Return the joint angles, shape (m, 2), for tips whose direction from the base is given as an unbroken angle.

    Source: paper C, eqs. 3-9, with the sign of eq. 9 corrected. NaN out of reach.
    """
    l1, l2 = links.l1_cm, links.l2_cm
    cos_q2 = (((tip_cm - links.base_cm) ** 2).sum(axis=1) - l1 * l1 - l2 * l2) / (2.0 * l1 * l2)
    with np.errstate(invalid="ignore"):
        q2 = np.arccos(cos_q2) * (-1.0 if links.elbow == "up" else 1.0)
    return np.stack([direction_rad - np.arctan2(l2 * np.sin(q2), l1 + l2 * np.cos(q2)), q2], axis=1)
