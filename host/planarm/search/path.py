"""The path that a search finds: way-points of the end effector, joined by straight moves."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import dist, fsum

import numpy as np
from numpy.typing import NDArray

from planarm.model.kinematics import ElbowSide


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
        length_cm = fsum(dist(a, b) for a, b in pairwise(points_cm.tolist()))
        return cls(points_cm, length_cm, elbow)
