"""A path looked at inside every interval of a grid: taken once, and anew only where the grid changes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.smoothing.smooth_path import Floats, JointState, SmoothPath

SUBSTEPS = 10
"""A grid is checked on one so many times denser."""


class Samples(NamedTuple):
    """Angles and derivatives at SUBSTEPS + 1 even points of each interval, each of shape (intervals, points, joints).

    The first and the last point are as seen from inside the interval, where derivatives may jump at its ends.
    """

    q_rad: Floats
    dq_rad: Floats
    ddq_rad: Floats

    @property
    def starts(self) -> JointState:
        """The path at the start of every interval."""
        return JointState(*(np.ascontiguousarray(values[:, 0]) for values in self))

    @property
    def ends(self) -> JointState:
        """The path at the end of every interval."""
        return JointState(*(np.ascontiguousarray(values[:, -1]) for values in self))

    @property
    def senses(self) -> Floats:
        """In which sense each joint turns in the middle of every interval: -1, 0 or 1, shape (intervals, joints)."""
        return np.asarray(np.sign(self.dq_rad[:, SUBSTEPS // 2]))


def take_samples(path: SmoothPath, starts: Floats, ends: Floats) -> Samples:
    """Evaluate the path in the intervals from each of `starts` to that of `ends`, each of shape (intervals,)."""
    s = starts[:, None] + (ends - starts)[:, None] * (np.arange(SUBSTEPS + 1) / SUBSTEPS)
    s[:, -1] = ends
    inner = path.evaluate(s[:, :-1].ravel(), "right")
    last = path.evaluate(s[:, -1], "left")
    shape = (len(starts), SUBSTEPS, last.q_rad.shape[1])
    return Samples(
        *(
            np.concatenate([values.reshape(shape), at_end[:, None]], axis=1)
            for values, at_end in zip(inner, last, strict=True)
        )
    )


def halve_some(path: SmoothPath, s: Floats, samples: Samples, split: NDArray[np.bool_]) -> tuple[Floats, Samples]:
    """Return gridpoints and samples with the marked intervals cut in halves; the others' samples are kept."""
    if not split.any():
        return s, samples
    middles = 0.5 * (s[:-1] + s[1:])[split]
    finer = np.sort(np.concatenate([s, middles]))
    kept = [np.repeat(values, 1 + split, axis=0) for values in samples]
    first = np.flatnonzero(split) + np.arange(len(middles))  # a half's place: each split before it added one
    halves = np.stack([first, first + 1], axis=1).ravel()
    for values, anew in zip(kept, take_samples(path, finer[halves], finer[halves + 1]), strict=True):
        values[halves] = anew
    return finer, Samples(*kept)
