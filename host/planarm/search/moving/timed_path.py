"""A path in space and time: the node that the tip is on at each motion sample."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import dist, fsum

import numpy as np
from numpy.typing import NDArray

from planarm.model.kinematics import ElbowSide
from planarm.workspace.moving_map import MovingMap


@dataclass(frozen=True, slots=True, eq=False)
class TimedPath:
    """Nodes from sample 0 on; the same node twice is a wait."""

    cells: NDArray[np.int64]
    """The map's cell at each sample, shape (samples + 1,)."""
    points_cm: NDArray[np.float64]
    """The tip at each sample, shape (samples + 1, 2)."""
    q_rad: NDArray[np.float64]
    """The pose at each sample, shape (samples + 1, 2)."""
    length_cm: float
    """Sum of the straight moves' lengths, correctly rounded."""
    elbow: ElbowSide

    @classmethod
    def through(cls, moving_map: MovingMap, cells: NDArray[np.int64]) -> TimedPath:
        """Return the path through the given cells of a map, all of which must have a pose."""
        points = np.array([moving_map.tip_cm(int(cell)) for cell in cells])
        q_rad = moving_map.poses.q_rad[moving_map.poses.place[cells]]
        length = fsum(dist(a, b) for a, b in pairwise(points.tolist()))
        return cls(np.asarray(cells, np.int64), points, q_rad, length, moving_map.elbow)

    def after(self, q_rad: NDArray[np.float64], tip_cm: NDArray[np.float64]) -> TimedPath:
        """Return the path with a pose that is no node one sample before it; its cell is that of the first node."""
        return TimedPath(
            np.concatenate([self.cells[:1], self.cells]),
            np.concatenate([[tip_cm], self.points_cm]),
            np.concatenate([[q_rad], self.q_rad]),
            self.length_cm + dist(tip_cm.tolist(), self.points_cm[0].tolist()),
            self.elbow,
        )

    @property
    def arrival(self) -> int:
        """The sample at which the last node is taken."""
        return len(self.cells) - 1

    @property
    def waits(self) -> list[int]:
        """The samples at the end of which the arm has not moved."""
        return (np.flatnonzero(np.diff(self.cells) == 0) + 1).tolist()

    @property
    def backs(self) -> list[int]:
        """The samples at which the arm is again on a node that it had left."""
        seen: set[int] = set()
        found = []
        for sample, (before, now) in enumerate(pairwise(self.cells.tolist()), start=1):
            seen.add(before)
            if now != before and now in seen:
                found.append(sample)
        return found
