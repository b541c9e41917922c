"""The path that a search finds: way-points of the end effector, joined by straight moves."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import dist, fsum

import numpy as np
from numpy.typing import NDArray

from planarm.model.kinematics import ElbowSide

STRAIGHT_RAD = 1e-9
"""Two moves whose directions differ by less than this make no corner."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Way-points of the end effector; nodes on a straight run are kept."""

    points_cm: NDArray[np.float64]
    """Shape (n, 2), n >= 1, from start to goal."""
    length_cm: float
    """Sum of the straight moves' lengths, correctly rounded."""
    elbow: ElbowSide

    @classmethod
    def through(cls, points_cm: NDArray[np.float64], elbow: ElbowSide) -> Path:
        """Return the path through the given way-points, shape (n, 2)."""
        points_cm = np.array(points_cm, dtype=np.float64)
        points_cm.flags.writeable = False
        length_cm = fsum(dist(a, b) for a, b in pairwise(points_cm))
        return cls(points_cm, length_cm, elbow)

    def corners_cm(self) -> NDArray[np.float64]:
        """Return the way-points without those that lie on a straight run, shape (m, 2)."""
        if len(self.points_cm) < 3:
            return self.points_cm
        moves = np.diff(self.points_cm, axis=0)
        before, after = moves[:-1], moves[1:]
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        along = np.sum(before * after, axis=1)
        turns = np.abs(np.arctan2(cross, along)) > STRAIGHT_RAD
        return self.points_cm[np.concatenate(([True], turns, [True]))]
