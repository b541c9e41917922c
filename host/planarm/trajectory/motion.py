"""A timed motion: the path parameter as a piecewise quadratic function of time."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.smoothing.smooth_path import Floats, SmoothPath


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A joint path run through in time, from rest to rest.

    Between two gridpoints the path acceleration is constant, so everything in between is exact, not interpolated.

    Attributes:
        path: what is run through.
        t_s: time at the gridpoints, from 0, strictly ascending, shape (m,); one point when nothing moves.
        s: path parameter at the gridpoints, shape (m,).
        s_dot: its rate at the gridpoints, shape (m,).
        q_rad: joint angles at the gridpoints, shape (m, joints).
    """

    path: SmoothPath
    t_s: Floats
    s: Floats
    s_dot: Floats
    q_rad: Floats

    @classmethod
    def in_own_time(cls, path: SmoothPath) -> Self:
        """Return the motion along a path whose parameter is time in seconds, from 0, as it is."""
        t_s = np.asarray(path.borders_s, np.float64)
        return cls(path, t_s, t_s, np.ones(len(t_s)), path.evaluate(t_s, "left").q_rad)

    @property
    def duration_s(self) -> float:
        """Time from start to end."""
        return float(self.t_s[-1])

    @property
    def s_ddot(self) -> Floats:
        """Path acceleration of each interval, shape (m - 1,)."""
        return (self.s_dot[1:] ** 2 - self.s_dot[:-1] ** 2) / (2.0 * np.diff(self.s))

    def sample(self, t_s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return angles, speeds and accelerations, each of shape (n, joints), at times of shape (n,).

        Before the start and after the end the arm rests. Where the acceleration jumps, the later value is given.
        """
        wanted = np.asarray(t_s, np.float64)
        if len(self.t_s) == 1:
            rest = np.zeros((len(wanted), self.q_rad.shape[1]))
            return rest + self.q_rad[0], rest, rest.copy()
        inside = np.clip(wanted, 0.0, self.duration_s)
        i = np.clip(np.searchsorted(self.t_s, inside, side="right") - 1, 0, len(self.t_s) - 2)
        u = self.s_ddot[i]
        since = inside - self.t_s[i]
        rate = np.maximum(0.0, self.s_dot[i] + u * since)
        s = np.clip(self.s[i] + since * (self.s_dot[i] + 0.5 * u * since), self.s[i], self.s[i + 1])
        q, dq, ddq = self.path.evaluate(s)
        rate, u = rate[:, None], u[:, None]
        moving = ((wanted >= 0.0) & (wanted < self.duration_s))[:, None]
        return q, np.where(moving, dq * rate, 0.0), np.where(moving, dq * u + ddq * rate**2, 0.0)

    def path_at(self, t_s: float) -> tuple[float, float]:
        """Return the path parameter at a time within the motion, and its rate there."""
        i = int(np.clip(np.searchsorted(self.t_s, t_s, side="right") - 1, 0, len(self.t_s) - 2))
        u, since = float(self.s_ddot[i]), t_s - float(self.t_s[i])
        s = float(self.s[i]) + since * (float(self.s_dot[i]) + 0.5 * u * since)
        return min(max(s, float(self.s[i])), float(self.s[i + 1])), max(0.0, float(self.s_dot[i]) + u * since)

    def left_for(self, path: SmoothPath, t_s: float, then: "Trajectory") -> "Trajectory":
        """Return this motion up to a time, and from there on another, which begins with the rate that this one has.

        Args:
            path: this motion's up to there, then the other's; its parameter is this motion's.
            t_s: when it is left.
            then: the other motion, its time and path parameter from 0.
        """
        s, _ = self.path_at(t_s)
        kept = (self.t_s < t_s) & (self.s < s)
        return Trajectory(
            path,
            np.concatenate([self.t_s[kept], t_s + then.t_s]),
            np.concatenate([self.s[kept], s + then.s]),
            np.concatenate([self.s_dot[kept], then.s_dot]),
            np.concatenate([self.q_rad[kept], then.q_rad]),
        )

    def time_at(self, s: Floats) -> Floats:
        """Return the times in seconds at which the path parameters of shape (n,) are passed."""
        if len(self.t_s) == 1:
            return np.zeros(len(s))
        i = self.interval_of(s)
        into = np.maximum(0.0, s - self.s[i])
        rate = np.sqrt(np.maximum(0.0, self.s_dot[i] ** 2 + 2.0 * self.s_ddot[i] * into))
        # 2 h / (v0 + v1) instead of (v1 - v0) / u: no cancellation, and right for u = 0.
        total = self.s_dot[i] + rate
        since = np.divide(2.0 * into, total, out=np.zeros(len(s)), where=total > 0.0)
        return np.minimum(self.t_s[i] + since, self.t_s[i + 1])

    def interval_of(self, s: Floats) -> NDArray[np.intp]:
        """Return the index of the interval that holds each path parameter."""
        return np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
