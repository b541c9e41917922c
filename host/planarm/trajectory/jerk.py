"""A limit of the joints' jerk: the mean of a motion over a short, moving window of time.

A moving mean starts and ends at rest where the motion does, and never has more speed or acceleration than the motion
has somewhere; its acceleration has no jumps, and its jerk is (a(t) - a(t - T)) / T for a window T. That is the box
filter of Biagiotti and Melchiorri, FIR filters for online trajectory planning with time- and frequency-domain
specifications, Control Engineering Practice 20 (2012). It takes T longer, and it cuts where the motion turns, by at
most a T^2 / 24 in a joint: whoever uses it has to prove the result free.
"""

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from planarm.errors import TimingError
from planarm.model.arm import Arm
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.smooth_path import Floats
from planarm.trajectory.motion import Trajectory

STEP_S = 5e-4
"""The window is a whole number of steps; within one the jerk is constant."""

LONGEST_WINDOW_S = 2.0
DENSER = 10
HEADROOM = 1.0 - 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Mean:
    """A motion and the window of its moving mean.

    Attributes:
        motion: it.
        speeds_rad_s: of its joints at every step, corrected so that their trapezoids end where the motion does, shape
            (steps + 1, joints).
        window: in steps.
    """

    motion: Trajectory
    speeds_rad_s: Floats
    window: int

    def trajectory(self, arm: Arm) -> Trajectory:
        """Return the mean: a path of cubic pieces over time itself, ds/dt is 1."""
        speeds, window = self.speeds_rad_s, self.window
        rest = np.zeros((window, speeds.shape[1]))
        behind, ahead = np.concatenate([rest, speeds]), np.concatenate([speeds, rest])
        bend = (ahead - behind) / (window * STEP_S)
        jerk = np.diff(bend, axis=0) / STEP_S
        rate = _integral(0.5 * (bend[:-1] + bend[1:]))
        angle = self.motion.q_rad[0] + _integral(rate[:-1] + STEP_S * (bend[:-1] / 2.0 + STEP_S * jerk / 6.0))
        pieces = np.stack([angle[:-1], rate[:-1], 0.5 * bend[:-1], jerk / 6.0], axis=1)
        borders = STEP_S * np.arange(len(angle), dtype=np.float64)
        path = JointSpline(arm, borders, np.ascontiguousarray(pieces), np.zeros(0))
        return Trajectory(path, borders, borders, np.ones(len(borders)), angle)

    def left_for(self, motion: Trajectory, step: int) -> "Mean":
        """Return the mean, over the same window, of a motion that is this one up to a step.

        Up to there the two means are the same; from there on speed and acceleration go on without a jump, since the
        window still holds what was before. Whether the jerk is kept is to be asked (`keeps`).
        """
        return Mean(motion, _speeds(motion, self.speeds_rad_s[: step + 1]), self.window)

    def keeps(self, jerks_rad_s3: Floats) -> bool:
        """Tell whether the mean keeps each joint's jerk."""
        accelerations = np.diff(self.speeds_rad_s, axis=0) / STEP_S
        return bool(_keeps(accelerations, self.window, HEADROOM * jerks_rad_s3).all())


def mean_of(trajectory: Trajectory, jerks_rad_s3: Floats) -> Mean:
    """Return a motion with the shortest window that keeps each joint's jerk.

    Args:
        trajectory: the motion.
        jerks_rad_s3: the largest jerk of each joint, inf where it has no limit, shape (joints,).

    Raises:
        TimingError: no window up to LONGEST_WINDOW_S does; the message names joint and limit.
    """
    speeds = _speeds(trajectory, np.zeros((1, trajectory.q_rad.shape[1])))
    window = _window(np.diff(speeds, axis=0) / STEP_S, HEADROOM * jerks_rad_s3)
    return Mean(trajectory, speeds, window)


def averaged(trajectory: Trajectory, arm: Arm, jerks_rad_s3: Floats) -> Trajectory:
    """Return the moving mean of a motion over the shortest window that keeps each joint's jerk; see `mean_of`."""
    return mean_of(trajectory, jerks_rad_s3).trajectory(arm)


def largest_jerks(trajectory: Trajectory) -> tuple[Floats, Floats]:
    """Return each joint's largest jerk and when it is there, from accelerations at ten times as many times."""
    count = DENSER * (len(trajectory.t_s) - 1)
    # In the middle of each small interval, so that no border, where the jerk jumps, is one of the times.
    t_s = trajectory.duration_s * (np.arange(count) + 0.5) / count
    jerks = np.abs(np.diff(trajectory.sample(t_s)[2], axis=0)) / (trajectory.duration_s / count)
    worst = jerks.argmax(axis=0)
    return jerks.max(axis=0), t_s[worst]


def _speeds(trajectory: Trajectory, before: Floats) -> Floats:
    """Return the joints' speeds at every step, corrected so that their trapezoids end where the motion does.

    The first of them, one at least, are known and stay as they are: `before`, shape (m, joints).
    """
    first = len(before) - 1
    count = max(2, ceil(trajectory.duration_s / STEP_S) - first)
    speeds = trajectory.sample(STEP_S * (first + np.arange(count + 1)))[1]
    speeds[0], speeds[-1] = before[-1], 0.0
    whole = np.concatenate([before[:-1], speeds])
    missing = trajectory.q_rad[-1] - trajectory.q_rad[0] - STEP_S * (whole.sum(axis=0) - 0.5 * whole[0])
    bump = np.sin(np.pi * np.arange(count + 1) / count) ** 2
    whole[first:] += bump[:, None] * missing / (STEP_S * bump.sum())
    return np.asarray(whole)


def _window(accelerations: Floats, jerks_rad_s3: Floats) -> int:
    """Return the least number of steps whose mean keeps the jerks."""
    most = int(LONGEST_WINDOW_S / STEP_S)
    low, high = 0, 1
    while not _keeps(accelerations, high, jerks_rad_s3).all():
        low, high = high, 2 * high
        if high > most:
            joint = int(np.argmin(_keeps(accelerations, most, jerks_rad_s3)))
            raise TimingError(
                f"joint {joint + 1} cannot keep {jerks_rad_s3[joint]:.4g} rad/s^3: its acceleration would have to "
                f"change for more than {LONGEST_WINDOW_S:g} s; raise joints[{joint + 1}].max_jerk_deg_s3"
            )
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if _keeps(accelerations, middle, jerks_rad_s3).all() else (middle, high)
    return high


def _keeps(accelerations: Floats, window: int, jerks_rad_s3: Floats) -> NDArray[np.bool_]:
    """Tell for each joint whether the mean over so many steps keeps its jerk."""
    rest = np.zeros((window, accelerations.shape[1]))
    change = np.concatenate([accelerations, rest]) - np.concatenate([rest, accelerations])
    return np.asarray(np.abs(change).max(axis=0) <= jerks_rad_s3 * window * STEP_S)


def _integral(values: Floats) -> Floats:
    sums = np.cumsum(STEP_S * values, axis=0)
    return np.asarray(np.concatenate([np.zeros((1, values.shape[1])), sums]), np.float64)
