"""Time a joint path: as fast as every joint's speed and a share of its acceleration allow.

Solve on a grid, look at the result on a grid ten times denser, split the intervals in which a limit is exceeded
notably or in which time is lost, tighten those in which it is exceeded a little, solve again; what is left in the end
is removed by running the whole motion slower. So the returned trajectory never exceeds a limit.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planarm.errors import TimingError
from planarm.scene import JointSpec
from planarm.smoothing.smooth_path import Floats, SmoothPath
from planarm.trajectory.check import LimitUse, limit_use
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.topp import fastest_squared_speeds

__all__ = ["STOPPING_SHARE", "Trajectory", "time_path"]

STOPPING_SHARE = 0.8
"""Share of each joint's acceleration that a plan uses; what is left keeps a stop along the path possible."""

HEADROOM = 1.0 - 1e-4
"""Planned share of each limit. The dense check knows what happens between its points to second order; this covers the
rest many times."""

FIRST_STEP_RAD = 0.02
MIN_INTERVALS = 8
MAX_INTERVALS = 1 << 14
SPLIT_ABOVE = 1.0 + 1e-3
SLOW_BELOW = 1.0 + 1e-5
ROUNDS = 16
LOST_SHARE = 1e-4
"""An interval that exceeds a limit beyond SPLIT_ABOVE, or loses this share of the duration, is split, else
tightened where it exceeds a limit; from SLOW_BELOW on, or after ROUNDS, the whole motion is run slower by the rest."""


@dataclass(frozen=True, slots=True)
class _Limits:
    """What the joints may do, shape (joints,) each."""

    speeds_rad_s: Floats
    accelerations_rad_s2: Floats


@dataclass(frozen=True, slots=True)
class _Grid:
    """Gridpoints and, for each interval and joint, the shares of the limits that the solver may use."""

    s: Floats
    speed_share: Floats
    acceleration_share: Floats


def time_path(path: SmoothPath, joints: Sequence[JointSpec], share: float = STOPPING_SHARE) -> Trajectory:
    """Return the fastest motion along the path, at rest at its ends and stops.

    Args:
        path: the path; when all of it is one pose, the trajectory has no duration.
        joints: the joints' limits, one for each column of the path.
        share: the share of each joint's acceleration to use, in (0, 1].

    Raises:
        TimingError: a limit or the path is no finite number; the message names joint and place.
    """
    limits = _limits_of(joints, share)
    s = _first_gridpoints(path, len(joints))
    if not np.ptp(path.evaluate(s).q_rad, axis=0).any():
        return Trajectory(path, np.zeros(1), s[:1], np.zeros(1), path.evaluate(s[:1]).q_rad)
    ones = np.ones((len(s) - 1, len(joints)))
    grid = _Grid(s, ones, ones)
    trajectory = _solve(path, grid, limits)
    for _ in range(ROUNDS):
        use = limit_use(trajectory, limits.speeds_rad_s, limits.accelerations_rad_s2)
        coarse = _coarse(trajectory, use)
        if max(use.speed.max(), use.acceleration.max()) <= SLOW_BELOW and not coarse.any():
            break
        grid = _refine(grid, use, coarse)
        trajectory = _solve(path, grid, limits)
    else:
        use = limit_use(trajectory, limits.speeds_rad_s, limits.accelerations_rad_s2)
    return _slowed(trajectory, max(1.0, float(use.speed.max()), float(np.sqrt(use.acceleration.max()))))


def _limits_of(joints: Sequence[JointSpec], share: float) -> _Limits:
    """Check the limits and return what a plan may use of them."""
    if not 0.0 < share <= 1.0:
        raise TimingError(f"the share of the acceleration is {share}; it must be above 0 and at most 1")
    for number, joint in enumerate(joints, start=1):
        for key, value in (
            ("max_speed_deg_s", np.degrees(joint.max_speed_rad_s)),
            ("max_acceleration_deg_s2", np.degrees(joint.max_acceleration_rad_s2)),
        ):
            if not (np.isfinite(value) and value > 0.0):
                raise TimingError(f"joint {number} cannot be timed: joints[{number}].{key} is {value}; set it above 0")
    return _Limits(
        HEADROOM * np.array([joint.max_speed_rad_s for joint in joints]),
        HEADROOM * share * np.array([joint.max_acceleration_rad_s2 for joint in joints]),
    )


def _first_gridpoints(path: SmoothPath, joints: int) -> Floats:
    """Return gridpoints at every border and, between them, about every FIRST_STEP_RAD of the joints' travel."""
    borders = path.borders_s
    if not np.isfinite(borders).all() or (np.diff(borders) <= 0.0).any():
        raise TimingError(f"the path's borders are not ascending finite numbers: {borders}")
    shares = np.arange(MIN_INTERVALS) / MIN_INTERVALS
    coarse = np.append((borders[:-1, None] + np.diff(borders)[:, None] * shares).ravel(), borders[-1])
    q = _finite_angles(path, coarse, joints)
    travel = np.abs(np.diff(q, axis=0)).reshape(len(borders) - 1, MIN_INTERVALS, joints).sum(axis=1).max(axis=1)
    counts = np.clip(np.ceil(travel / FIRST_STEP_RAD), MIN_INTERVALS, MAX_INTERVALS // len(borders)).astype(int)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(borders, borders[1:], counts, strict=False)]
    return np.concatenate([*pieces, borders[-1:]])


def _finite_angles(path: SmoothPath, s: Floats, joints: int) -> Floats:
    """Return the angles at s after checking that they and their derivatives are numbers."""
    for side in ("left", "right"):
        state = path.evaluate(s, "left" if side == "left" else "right")
        for values in state:
            if values.shape != (len(s), joints):
                raise TimingError(
                    f"the path has {values.shape[1]} joints, the scene {joints}; add or remove [[joints]]"
                )
            wrong = np.argwhere(~np.isfinite(values))
            if len(wrong):
                row, joint = wrong[0]
                raise TimingError(
                    f"joint {joint + 1} has no finite angle or rate at {path.place(float(s[row]))}: out of reach, or "
                    f"at full stretch; keep the path inside the reach (workspace, joint_limits_deg)"
                )
    return path.evaluate(s).q_rad


def _solve(path: SmoothPath, grid: _Grid, limits: _Limits) -> Trajectory:
    """Return the fastest motion on the grid."""
    s = grid.s
    h = np.diff(s)[:, None]
    start, end = path.evaluate(s[:-1], "right"), path.evaluate(s[1:], "left")
    inertia_start, inertia_end = start.dq_rad / (2.0 * h), end.dq_rad / (2.0 * h)
    strips = np.concatenate(
        [
            np.stack([start.ddq_rad - inertia_start, inertia_start], axis=-1),
            np.stack([-inertia_end, end.ddq_rad + inertia_end], axis=-1),
        ],
        axis=1,
    )
    accelerations = np.tile(limits.accelerations_rad_s2 * grid.acceleration_share, (1, 2))
    x = fastest_squared_speeds(
        np.ascontiguousarray(strips), accelerations, _squared_limits(path, grid, limits, start.dq_rad, end.dq_rad)
    )
    s_dot = np.sqrt(x)
    stuck = np.flatnonzero(s_dot[:-1] + s_dot[1:] <= 0.0)
    if len(stuck):
        raise TimingError(f"no speed is possible at {path.place(float(s[stuck[0]]))}: the path turns there on the spot")
    t_s = np.concatenate([[0.0], np.cumsum(2.0 * h[:, 0] / (s_dot[:-1] + s_dot[1:]))])
    return Trajectory(path, t_s, s, s_dot, path.evaluate(s).q_rad)


def _squared_limits(path: SmoothPath, grid: _Grid, limits: _Limits, dq_start: Floats, dq_end: Floats) -> Floats:
    """Return the largest x by the speed limits at each gridpoint: the least over both sides and all joints."""
    allowed = limits.speeds_rad_s * grid.speed_share
    # A gridpoint at which no joint moves gets the largest limit found elsewhere.
    rate = np.full(len(grid.s), np.inf)
    for dq, at in ((dq_start, slice(None, -1)), (dq_end, slice(1, None))):
        bound = np.divide(allowed, np.abs(dq), out=np.full(dq.shape, np.inf), where=dq != 0.0).min(axis=1)
        rate[at] = np.minimum(rate[at], bound)
    rate[np.isinf(rate)] = rate[np.isfinite(rate)].max()
    rate[[0, -1]] = 0.0
    rate[np.isin(grid.s, path.stops_s)] = 0.0
    return rate**2


def _coarse(trajectory: Trajectory, use: LimitUse) -> NDArray[np.bool_]:
    """Tell which intervals to split: those that exceed a limit notably, and those that lose time.

    The fastest motion uses some limit up at every moment. An interval in which the limits change places cannot, since
    its acceleration is constant; it loses at most the unused share of its time.
    """
    lost_s = use.slack * np.diff(trajectory.t_s)
    coarse = (np.maximum(use.speed, use.acceleration).max(axis=1) > SPLIT_ABOVE) | (
        lost_s > LOST_SHARE * trajectory.duration_s
    )
    return coarse if len(coarse) + np.count_nonzero(coarse) <= MAX_INTERVALS else np.zeros(len(coarse), np.bool_)


def _refine(grid: _Grid, use: LimitUse, coarse: NDArray[np.bool_]) -> _Grid:
    """Split the coarse intervals, tighten the others where they exceed a limit a little."""
    tight = ~coarse[:, None]
    speed = np.where(tight, grid.speed_share / np.maximum(1.0, use.speed), grid.speed_share)
    acceleration = np.where(tight, grid.acceleration_share / np.maximum(1.0, use.acceleration), grid.acceleration_share)
    repeats = 1 + coarse
    middles = 0.5 * (grid.s[:-1] + grid.s[1:])
    s = np.sort(np.concatenate([grid.s, middles[coarse]]))
    return _Grid(s, np.repeat(speed, repeats, axis=0), np.repeat(acceleration, repeats, axis=0))


def _slowed(trajectory: Trajectory, factor: float) -> Trajectory:
    """Return the same motion run slower: speeds by the factor, accelerations by its square."""
    return Trajectory(
        trajectory.path, trajectory.t_s * factor, trajectory.s, trajectory.s_dot / factor, trajectory.q_rad
    )
