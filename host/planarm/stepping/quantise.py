"""Trajectory to steps: a step is made where a motor's angle crosses the middle between two micro-steps.

So the arm always stands on the micro-step nearest to the planned angle. The crossings are found on the path, where they
do not depend on time (`planarm.stepping.crossings`); the time at which the trajectory passes s is known in closed form.

Hysteresis: a pair of steps forth and back that the motor could not make, because the second follows within
the board's least time of reversal, is left out. The arm then stands up to `hysteresis_usteps` more than half a
micro-step from the planned angle, for as long as the pair would have lasted. A first step before the DIR setup time is
made after it.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from planarm.errors import TimingError
from planarm.model.arm import Arm
from planarm.model.transmission import Transmission
from planarm.scene import JointSpec, Matrix
from planarm.stepping.crossings import find_crossings
from planarm.stepping.train import (
    Directions,
    Floats,
    JointSteps,
    StepTrain,
    Ticks,
    largest_rate_hz,
    least_reversal_ticks,
    nearest_usteps,
    require_steppable,
    slower,
    timing_share,
)
from planarm.trajectory.motion import Trajectory
from planarm_wire.boards import Board
from planarm_wire.messages import MIN_DIR_SETUP_TICKS, TICKS_HZ
from planarm_wire.wirings import OWN, board_of

__all__ = ["JointSteps", "StepTrain", "hysteresis_usteps", "quantisation_bound_cm", "quantise", "timing_usteps"]

ROUNDING_USTEPS = 0.005
"""How far the rounding to whole ticks can move a joint, with intervals of 320 or more."""

SUBDIVISION = 4
"""Parts of each interval of the trajectory in which the angles are searched for turning points."""


def quantise(
    trajectory: Trajectory, joints: Sequence[JointSpec], coupling: Matrix | None = None, wiring: str = OWN
) -> StepTrain:
    """Return every step of the motion on its tick, one entry a motor, for the board of so many joints and this wiring.

    Raises:
        TimingError: a joint would have to step faster than the board can.
    """
    board = board_of(len(joints), wiring)
    transmission = Transmission.from_joints(joints, coupling)
    _require_possible_rates(board, trajectory, joints, transmission)
    start = nearest_usteps(transmission.usteps(trajectory.q_rad[0]))
    steps = tuple(
        JointSteps(*_without_flutter(ticks, directions, least_reversal_ticks(board)))
        for ticks, directions in _steps_of(trajectory, transmission)
    )
    last = max((int(joint.ticks[-1]) for joint in steps if len(joint.ticks)), default=-1)
    duration = max(int(np.floor(trajectory.duration_s * TICKS_HZ + 0.5)), last + 1)
    train = StepTrain(tuple(int(n) for n in start), steps, duration, wiring)
    require_steppable(train, joints)
    return train


def _require_possible_rates(
    board: Board, trajectory: Trajectory, joints: Sequence[JointSpec], transmission: Transmission
) -> None:
    """Refuse a motion far beyond the board's rate before its steps, perhaps millions, are located.

    The exact verdict is that of `require_steppable`; gridpoints alone show only what is twice too fast or more.
    """
    rates_hz = np.abs(transmission.rates(trajectory.sample(trajectory.t_s)[1]))
    point, j = np.unravel_index(int(rates_hz.argmax()), rates_hz.shape)
    if rates_hz[point, j] > 2.0 * largest_rate_hz(board):
        raise TimingError(
            f"joint {j + 1} would make {rates_hz[point, j]:.0f} steps/s at {trajectory.t_s[point]:.6f} s; the board "
            f"{board.name} can make {largest_rate_hz(board):.0f}: {slower(board, int(j) + 1, joints)}"
        )


def quantisation_bound_cm(arm: Arm, joints: Sequence[JointSpec], coupling: Matrix | None = None) -> float:
    """Return how far any point of the arm can be from where the trajectory has it, while it makes the steps.

    Half a micro-step and the steps' timing tolerance of each motor, at its lever.
    """
    levers_cm = Transmission.from_joints(joints, coupling).levers_cm(arm.link_lengths_cm)
    return float((0.5 + timing_usteps(len(joints))) * levers_cm.sum())


def timing_usteps(joints: int) -> float:
    """Return how far a step's timing tolerance can move a joint.

    Its share of an interval, where the speed at the step is at most twice the mean (rest at the other end), and the
    rounding to whole ticks.
    """
    return 2.0 * timing_share(joints) + ROUNDING_USTEPS


def hysteresis_usteps(joint: JointSpec, board: Board) -> float:
    """Return how far beyond half a micro-step a motor's axis can be when a pair of steps is left out.

    The angle turns back within the board's least time of reversal, so it gets no farther than half that time at full
    acceleration; a delayed first step is half as late and adds no more.
    """
    half_s = 0.5 * least_reversal_ticks(board) / TICKS_HZ
    return 0.5 * joint.max_acceleration_rad_s2 * joint.usteps_per_rad * half_s**2


def _steps_of(trajectory: Trajectory, transmission: Transmission) -> list[tuple[Ticks, Directions]]:
    """Return ticks and directions of each motor's steps."""
    motors = len(transmission.usteps_per_rad)
    if len(trajectory.s) == 1:
        return [(np.zeros(0, np.int64), np.zeros(0, np.int8))] * motors
    found = find_crossings(trajectory.path, _fine_grid(trajectory.s), transmission)
    ticks = np.floor(trajectory.time_at(found.s) * TICKS_HZ + 0.5).astype(np.int64)
    ends = np.searchsorted(found.motor, np.arange(motors + 1))
    steps = []
    for begin, end in pairwise(ends):
        in_order = np.maximum.accumulate(np.maximum(ticks[begin:end], MIN_DIR_SETUP_TICKS))
        steps.append((in_order, found.direction[begin:end]))
    return steps


def _fine_grid(s: Floats) -> Floats:
    """Return the gridpoints and SUBDIVISION - 1 points in each interval."""
    shares = np.arange(SUBDIVISION) / SUBDIVISION
    return np.append((s[:-1, None] + np.diff(s)[:, None] * shares).ravel(), s[-1])


def _without_flutter(ticks: Ticks, directions: Directions, reversal_ticks: int) -> tuple[Ticks, Directions]:
    """Return the steps without pairs forth and back that follow each other too soon."""
    reverses = np.diff(directions) != 0
    if not (reverses & (np.diff(ticks) < reversal_ticks)).any():
        return ticks, directions
    kept: list[int] = []
    for i in range(len(ticks)):
        back = bool(kept) and directions[kept[-1]] != directions[i] and ticks[i] - ticks[kept[-1]] < reversal_ticks
        if back:
            kept.pop()
        else:
            kept.append(i)
    return ticks[kept], directions[kept]
