"""Time a joint path: as fast as every joint's speed, a share of its acceleration, and its motor's torque allow.

Solve on a grid, look at the result on a grid ten times denser, split the intervals in which a limit is exceeded
notably or in which time is lost, tighten those in which it is exceeded a little, solve again; what is left in the end
is removed by running the whole motion slower. So the returned trajectory never exceeds a limit. The torque's estimate
(`planarm.trajectory.planes`) is drawn anew about each solution.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planarm.dynamics.motor_terms import Load
from planarm.errors import TimingError
from planarm.scene import JointSpec
from planarm.smoothing.smooth_path import Floats, SmoothPath
from planarm.trajectory.check import LimitUse, limit_use
from planarm.trajectory.limits import STOPPING_SHARE, Limits
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.planes import Grid, half_planes, path_ends, require_holding, squared_limits, with_turning_points
from planarm.trajectory.samples import halve_some
from planarm.trajectory.topp import fastest_squared_speeds

__all__ = ["STOPPING_SHARE", "SpeedCap", "Trajectory", "fastest_motion", "time_path"]

SpeedCap = Callable[[Floats], Floats]
"""Gives the largest ds/dt, shape (m,), at path parameters of shape (m,); held at the gridpoints."""

FIRST_STEP_RAD = 0.02
MIN_INTERVALS = 8
MAX_INTERVALS = 1 << 14
SPLIT_ABOVE = 1.0 + 1e-3
SLOW_BELOW = 1.0 + 1e-5
ROUNDS = 16
LOST_SHARE = 1e-4
"""An interval that exceeds a limit beyond SPLIT_ABOVE, or loses this share of the duration, is split, else
tightened where it exceeds a limit; from SLOW_BELOW on, or after ROUNDS, the whole motion is run slower by the rest."""

GROWTH = 2.0
"""How many times the squared path speed of a solution the next may have while torque limits it."""

START_SLACK = 0.1
"""Share of the squared rate at a motion's start by which a grid may be too coarse to have it; refinement settles it."""

SPEED_BEYOND, FORCE_BEYOND = 1.0 + 5e-5, 1.01
"""A motion that begins at speed is not run slower as a whole, so it may exceed what is planned with by this: speeds are
planned with to a ten-thousandth (`limits.HEADROOM`), and of accelerations and torques a share is left for stops."""

SETTLED_SHARE = 1e-4
"""The torque's estimate is good enough when drawing it anew changes the duration by less than this share."""


def time_path(
    path: SmoothPath,
    joints: Sequence[JointSpec],
    share: float = STOPPING_SHARE,
    load: Load | None = None,
    speed_cap: SpeedCap | None = None,
) -> Trajectory:
    """Return the fastest motion along the path, at rest at its ends and stops.

    Args:
        path: the path; when all of it is one pose, the trajectory has no duration.
        joints: the joints' limits, one for each column of the path.
        share: the share of each joint's acceleration, and of the torque that gravity and friction leave, to use: in
            (0, 1].
        load: masses and motors; None when torque is not to be limited.
        speed_cap: a further limit of ds/dt.

    Raises:
        TimingError: a limit or the path is no finite number, or a motor cannot hold the arm; the message names joint
            and place.
    """
    return fastest_motion(path, Limits.of_joints(joints, share, load), speed_cap)


def fastest_motion(
    path: SmoothPath,
    limits: Limits,
    speed_cap: SpeedCap | None = None,
    rounds: int = ROUNDS,
    start_rate: float = 0.0,
) -> Trajectory:
    """Return the fastest motion along the path within the limits; see `time_path`.

    With fewer rounds the answer comes sooner and keeps the limits just as well: what refinement would have removed is
    removed by running slower.

    With `start_rate` the path is not begun at rest but at this ds/dt, and it is left as it is. Raises TimingError where
    the motion cannot be slowed down in time for what follows, or refinement leaves a limit exceeded.
    """
    s = _first_gridpoints(path, limits.joints)
    if limits.load is not None:
        s = with_turning_points(path, s)
    if not np.ptp(path.evaluate(s).q_rad, axis=0).any():
        return Trajectory(path, np.zeros(1), s[:1], np.zeros(1), path.evaluate(s[:1]).q_rad)
    grid, trajectory = _refined(path, Grid.on(path, s), replace(limits, load=None), speed_cap, rounds, start_rate)
    if limits.load is None:
        return trajectory
    require_holding(path, grid, limits)
    if limit_use(trajectory, limits, grid.samples).torque.max() <= 1.0:
        return trajectory  # the fastest without the torque's limit keeps it
    return _refined(path, replace(grid, tangent_x=trajectory.s_dot**2), limits, speed_cap, rounds, start_rate)[1]


def _refined(
    path: SmoothPath, grid: Grid, limits: Limits, speed_cap: SpeedCap | None, rounds: int, start_rate: float
) -> tuple[Grid, Trajectory]:
    """Solve, look, refine and solve again; return the last grid, and the motion made to keep every limit."""
    trajectory = solve(path, grid, limits, speed_cap, start_rate)
    before_s, use = np.inf, limit_use(trajectory, limits, grid.samples)
    for _ in range(rounds):
        coarse = _coarse(trajectory, use)
        change_s = abs(before_s - trajectory.duration_s)
        settled = limits.load is None or change_s <= SETTLED_SHARE * trajectory.duration_s
        if use.largest <= SLOW_BELOW and not coarse.any() and settled:
            break
        before_s = trajectory.duration_s
        grid = _refine(grid, trajectory, use, coarse, np.inf if limits.load is None else GROWTH)
        trajectory = solve(path, grid, limits, speed_cap, start_rate)
        use = limit_use(trajectory, limits, grid.samples)
    if start_rate == 0.0:
        return grid, _slowed(trajectory, _slowing(use))
    if use.speed.max() > SPEED_BEYOND or max(use.acceleration.max(), use.torque.max()) > FORCE_BEYOND:
        place = path.place(float(grid.s[int(np.argmax(_most(use)))]))
        raise TimingError(f"a motion that begins at speed cannot keep the joints' limits at {place}")
    return grid, trajectory


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


def solve(
    path: SmoothPath, grid: Grid, limits: Limits, speed_cap: SpeedCap | None = None, start_rate: float = 0.0
) -> Trajectory:
    """Return the fastest motion on the grid, held to the limits at both ends of every interval.

    Raises:
        TimingError: a motor cannot hold the arm, or nothing moves in some interval; or the motion begins at a rate from
            which it cannot be slowed down in time.
    """
    s = grid.s
    ends = path_ends(grid.samples, limits)
    rest = np.flatnonzero(np.isin(s, path.stops_s))
    x_limits = squared_limits(ends, grid, limits, np.concatenate([[0], rest, [len(s) - 1]]))
    if speed_cap is not None:
        x_limits = np.minimum(x_limits, speed_cap(s) ** 2)
    x_limits[0] = start_rate**2
    x = fastest_squared_speeds(*half_planes(ends, grid, limits, x_limits), x_limits)
    if x[0] < x_limits[0] * (1.0 - START_SLACK):
        raise TimingError(
            f"a motion at the rate {start_rate:.6g}/s at {path.place(float(s[0]))} cannot be slowed down in time for "
            f"what follows; {np.sqrt(x[0]):.6g}/s could"
        )
    x[0] = x_limits[0]
    s_dot = np.sqrt(x)
    stuck = np.flatnonzero(s_dot[:-1] + s_dot[1:] <= 0.0)
    if len(stuck):
        raise TimingError(f"no speed is possible at {path.place(float(s[stuck[0]]))}: the path turns there on the spot")
    t_s = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(s) / (s_dot[:-1] + s_dot[1:]))])
    q_rad = np.concatenate([ends.start.q_rad, ends.end.q_rad[-1:]])
    return Trajectory(path, t_s, s, s_dot, q_rad)


def _coarse(trajectory: Trajectory, use: LimitUse) -> NDArray[np.bool_]:
    """Tell which intervals to split: those that exceed a limit notably, and those that lose time.

    The fastest motion uses some limit up at every moment. An interval in which the limits change places cannot, since
    its acceleration is constant; it loses at most the unused share of its time.
    """
    lost_s = use.slack * np.diff(trajectory.t_s)
    most = _most(use)
    coarse = (most > SPLIT_ABOVE) | (lost_s > LOST_SHARE * trajectory.duration_s)
    return coarse if len(coarse) + np.count_nonzero(coarse) <= MAX_INTERVALS else np.zeros(len(coarse), np.bool_)


def _most(use: LimitUse) -> Floats:
    """Return the largest use of any limit inside each interval."""
    return np.asarray(np.maximum(np.maximum(use.speed, use.acceleration), use.torque).max(axis=1))


def _refine(grid: Grid, trajectory: Trajectory, use: LimitUse, coarse: NDArray[np.bool_], growth: float) -> Grid:
    """Split the coarse intervals, tighten the others where they exceed a limit a little, draw the tangents anew."""
    repeats = 1 + coarse
    speed_share, acceleration_share, torque_share = (
        np.repeat(np.where(coarse[:, None], share, share / np.maximum(1.0, used)), repeats, axis=0)
        for share, used in (
            (grid.speed_share, use.speed),
            (grid.acceleration_share, use.acceleration),
            (grid.torque_share, use.torque),
        )
    )
    s, samples = halve_some(trajectory.path, grid.s, grid.samples, coarse)
    tangent_x = np.interp(s, trajectory.s, trajectory.s_dot**2)
    return Grid(s, samples, speed_share, acceleration_share, torque_share, tangent_x, growth)


def _slowing(use: LimitUse) -> float:
    """Return the factor by which the whole motion has to be slower to keep all limits.

    Speeds fall with the factor, accelerations with its square; torque by friction only with the factor itself.
    """
    return max(1.0, float(use.speed.max()), float(np.sqrt(use.acceleration.max())), float(use.torque.max()))


def _slowed(trajectory: Trajectory, factor: float) -> Trajectory:
    """Return the same motion run slower: speeds by the factor, accelerations by its square."""
    return replace(trajectory, t_s=trajectory.t_s * factor, s_dot=trajectory.s_dot / factor)
