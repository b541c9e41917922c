"""Trajectory to steps: a step is made where the joint's angle crosses the middle between two micro-steps.

So the arm always stands on the micro-step nearest to the planned angle. The crossings are found on the path, where they
do not depend on time: between gridpoints and turning points each angle is monotone in s, its crossings are roots of
q(s) usteps_per_rad = n + 1/2, and the time at which the trajectory passes s is known in closed form.

Hysteresis: a pair of steps forth and back that the motor could not make, because the second follows within
MIN_REVERSAL_TICKS, is left out. The arm then stands up to `hysteresis_usteps` more than half a micro-step from the
planned angle, for as long as the pair would have lasted. A first step before the DIR setup time is made after it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planarm.errors import TimingError
from planarm.model.arm import Arm
from planarm.scene import JointSpec
from planarm.stepping.train import (
    LARGEST_RATE_HZ,
    MIN_REVERSAL_TICKS,
    Directions,
    Floats,
    JointSteps,
    StepTrain,
    Ticks,
    require_steppable,
    slower,
    to_usteps,
)
from planarm.trajectory.motion import Trajectory
from planarm_wire.messages import MIN_DIR_SETUP_TICKS, TICKS_HZ

__all__ = ["JointSteps", "StepTrain", "hysteresis_usteps", "quantisation_bound_cm", "quantise"]

TIMING_USTEPS = 0.045
"""How far a step's timing tolerance can move a joint: 2 % of an interval, where the speed at the step is at most twice
the mean (rest at the other end), and the rounding to whole ticks of intervals of 320 or more."""

SUBDIVISION = 4
"""Parts of each interval of the trajectory in which the angles are searched for turning points."""

ROOT_RAD = 1e-13
"""A crossing is found when the angle is this near to it: 1e-8 micro-steps at 10^5 micro-steps a radian."""

MAX_ITERATIONS = 100


def quantise(trajectory: Trajectory, joints: Sequence[JointSpec]) -> StepTrain:
    """Return every step of the motion on its tick.

    Raises:
        TimingError: a joint would have to step faster than the firmware can.
    """
    usteps_per_rad = np.array([joint.usteps_per_rad for joint in joints])
    _require_possible_rates(trajectory, joints, usteps_per_rad)
    start = to_usteps(trajectory.q_rad[0], usteps_per_rad)
    s = _monotone_points(trajectory)
    steps = tuple(
        _joint_steps(trajectory, j, s[j], usteps_per_rad[j]) if len(s[j]) > 1 else _no_steps()
        for j in range(len(joints))
    )
    last = max((int(joint.ticks[-1]) for joint in steps if len(joint.ticks)), default=-1)
    duration = max(int(np.floor(trajectory.duration_s * TICKS_HZ + 0.5)), last + 1)
    train = StepTrain(tuple(int(n) for n in start), steps, duration)
    require_steppable(train, joints)
    return train


def _require_possible_rates(trajectory: Trajectory, joints: Sequence[JointSpec], usteps_per_rad: Floats) -> None:
    """Refuse a motion far beyond the firmware's rate before its steps, perhaps millions, are located.

    The exact verdict is that of `require_steppable`; gridpoints alone show only what is twice too fast or more.
    """
    rates_hz = np.abs(trajectory.sample(trajectory.t_s)[1]) * usteps_per_rad
    point, j = np.unravel_index(int(rates_hz.argmax()), rates_hz.shape)
    if rates_hz[point, j] > 2.0 * LARGEST_RATE_HZ:
        raise TimingError(
            f"joint {j + 1} would make {rates_hz[point, j]:.0f} steps/s at {trajectory.t_s[point]:.6f} s; the firmware "
            f"can make {LARGEST_RATE_HZ:.0f}: {slower(int(j) + 1, joints)}"
        )


def quantisation_bound_cm(arm: Arm, joints: Sequence[JointSpec]) -> float:
    """Return how far any point of the arm can be from where the trajectory has it, while it makes the steps.

    Half a micro-step and the steps' timing tolerance in each joint, at the joint's lever: all links from it outwards.
    """
    levers_cm = np.cumsum(arm.link_lengths_cm[::-1])[::-1]
    return float(
        sum((0.5 + TIMING_USTEPS) / joint.usteps_per_rad * r for joint, r in zip(joints, levers_cm, strict=True))
    )


def hysteresis_usteps(joint: JointSpec) -> float:
    """Return how far beyond half a micro-step the joint can be when a pair of steps is left out.

    The angle turns back within MIN_REVERSAL_TICKS, so it gets no farther than half that time at full acceleration; a
    delayed first step is half as late and adds no more.
    """
    half_s = 0.5 * MIN_REVERSAL_TICKS / TICKS_HZ
    return 0.5 * joint.max_acceleration_rad_s2 * joint.usteps_per_rad * half_s**2


def _no_steps() -> JointSteps:
    return JointSteps(np.zeros(0, np.int64), np.zeros(0, np.int8))


def _monotone_points(trajectory: Trajectory) -> list[Floats]:
    """Return for each joint path parameters, ascending from start to end, between which its angle is monotone."""
    grid = trajectory.s
    joints = trajectory.q_rad.shape[1]
    if len(grid) == 1:
        return [grid] * joints
    shares = np.arange(SUBDIVISION) / SUBDIVISION
    s = np.append((grid[:-1, None] + np.diff(grid)[:, None] * shares).ravel(), grid[-1])
    start = trajectory.path.evaluate(s[:-1], "right").dq_rad
    end = trajectory.path.evaluate(s[1:], "left").dq_rad
    points = []
    for j in range(joints):
        turning = np.flatnonzero(start[:, j] * end[:, j] < 0.0)
        roots = _turning_points(trajectory, j, s[turning], s[turning + 1], start[turning, j])
        points.append(np.unique(np.concatenate([s, roots])))
    return points


def _turning_points(trajectory: Trajectory, j: int, low: Floats, high: Floats, rate_low: Floats) -> Floats:
    """Return where the rate of joint j changes its sign between `low` and `high`, by bisection."""
    low, high = low.copy(), high.copy()
    for _ in range(MAX_ITERATIONS):
        middle = 0.5 * (low + high)
        if not ((low < middle) & (middle < high)).any():
            break
        same = trajectory.path.evaluate(middle).dq_rad[:, j] * rate_low > 0.0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low


def _joint_steps(trajectory: Trajectory, j: int, s: Floats, usteps_per_rad: float) -> JointSteps:
    """Return the steps of joint j, whose angle is monotone between neighbours of s."""
    q_rad = trajectory.path.evaluate(s).q_rad[:, j]
    nearest = to_usteps(q_rad, usteps_per_rad)
    crossed = np.diff(nearest)
    piece = np.repeat(np.arange(len(crossed)), np.abs(crossed))
    direction = np.sign(crossed)[piece]
    first = np.cumsum(np.abs(crossed)) - np.abs(crossed)
    order = np.arange(len(piece)) - first[piece]
    middles_rad = (nearest[piece] + direction * (order + 0.5)) / usteps_per_rad
    bracket = _Bracket(s[piece], s[piece + 1], direction > 0)
    share = (middles_rad - q_rad[piece]) / (q_rad[piece + 1] - q_rad[piece])
    guess = bracket.low + np.clip(share, 0.0, 1.0) * (bracket.high - bracket.low)
    crossings = _crossings(trajectory, j, middles_rad, bracket, guess)
    ticks = np.floor(trajectory.time_at(crossings) * TICKS_HZ + 0.5).astype(np.int64)
    ticks = np.maximum.accumulate(np.maximum(ticks, MIN_DIR_SETUP_TICKS))
    return JointSteps(*_without_flutter(ticks, direction.astype(np.int8)))


@dataclass(frozen=True, slots=True)
class _Bracket:
    """Where crossings are looked for, shape (n,) each, and whether the angle rises there."""

    low: Floats
    high: Floats
    rises: NDArray[np.bool_]


def _crossings(trajectory: Trajectory, j: int, q_rad: Floats, bracket: _Bracket, guess: Floats) -> Floats:
    """Return where joint j passes each angle: Newton's method from a guess, kept in the bracket by bisection."""
    s, low, high = guess.copy(), bracket.low.copy(), bracket.high.copy()
    left = np.arange(len(s))
    for _ in range(MAX_ITERATIONS):
        if not len(left):
            return s
        at = s[left]
        state = trajectory.path.evaluate(at)
        error, rate = state.q_rad[:, j] - q_rad[left], state.dq_rad[:, j]
        before = (error < 0.0) == bracket.rises[left]
        low[left] = np.where(before, at, low[left])
        high[left] = np.where(before, high[left], at)
        newton = at - np.divide(error, rate, out=np.full(len(at), np.inf), where=rate != 0.0)
        inside = (newton > low[left]) & (newton < high[left])
        following = np.where(inside, newton, 0.5 * (low[left] + high[left]))
        between = (following > low[left]) & (following < high[left])  # else the bracket is down to rounding
        more = (np.abs(error) > ROOT_RAD) & between
        s[left[more]] = following[more]
        left = left[more]
    raise TimingError(f"the steps of joint {j + 1} at {trajectory.path.place(float(s[left[0]]))} could not be located")


def _without_flutter(ticks: Ticks, directions: Directions) -> tuple[Ticks, Directions]:
    """Return the steps without pairs forth and back that follow each other too soon."""
    reverses = np.diff(directions) != 0
    if not (reverses & (np.diff(ticks) < MIN_REVERSAL_TICKS)).any():
        return ticks, directions
    kept: list[int] = []
    for i in range(len(ticks)):
        back = bool(kept) and directions[kept[-1]] != directions[i] and ticks[i] - ticks[kept[-1]] < MIN_REVERSAL_TICKS
        if back:
            kept.pop()
        else:
            kept.append(i)
    return ticks[kept], directions[kept]
