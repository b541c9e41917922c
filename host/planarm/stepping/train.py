"""Steps on their ticks, and the joints' lattice of micro-steps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.errors import TimingError
from planarm.scene import JointSpec
from planarm_wire.boards import Board
from planarm_wire.messages import MIN_DIR_SETUP_TICKS, TICKS_HZ
from planarm_wire.wirings import OWN, board_of

Ticks = NDArray[np.int64]
Directions = NDArray[np.int8]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class JointSteps:
    """One joint's steps.

    Attributes:
        ticks: moment of each step in ticks of 62.5 ns from the motion's start, ascending, int64[n].
        directions: +1 or -1 for each, int8[n].
    """

    ticks: Ticks
    directions: Directions

    @property
    def net_usteps(self) -> int:
        """Signed sum of the steps."""
        return int(self.directions.sum(dtype=np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class StepTrain:
    """The steps of all joints over one motion.

    Attributes:
        start_usteps: each motor's position before the motion; `model.transmission` says where that puts the joints.
        steps: one entry a motor.
        duration_ticks: length of the motion, later than every step; 0 when nothing moves.
        wiring: of the board that is to make them, a name of the wire's pin maps.
    """

    start_usteps: tuple[int, ...]
    steps: tuple[JointSteps, ...]
    duration_ticks: int
    wiring: str = OWN

    @property
    def board(self) -> Board:
        """The board that is to make the steps."""
        return board_of(len(self.start_usteps), self.wiring)

    @property
    def end_usteps(self) -> tuple[int, ...]:
        """Each joint's position after the motion."""
        return tuple(start + joint.net_usteps for start, joint in zip(self.start_usteps, self.steps, strict=True))


def least_reversal_ticks(board: Board) -> int:
    """Return the least time between two steps of one joint in opposite directions: DIR changes and has its setup."""
    return board.min_interval_ticks + MIN_DIR_SETUP_TICKS


def timing_share(joints: int) -> float:
    """Return by how much of the shorter interval around it compression may move a step.

    2 % with two joints, whose steps rise on their ticks. 5 % with more, whose queue has less room for more: there an
    interrupt makes up to 12 us of jitter, a fifth of the least interval, anyway (docs/decisions/0127).
    """
    return 0.02 if joints <= 2 else 0.05


def largest_rate_hz(board: Board) -> float:
    """Return the most steps of one joint in a second."""
    return TICKS_HZ / board.min_interval_ticks


def nearest_usteps(usteps: ArrayLike) -> NDArray[np.int64]:
    """Return the nearest whole micro-steps; half-way values go up."""
    nearest: NDArray[np.int64] = np.floor(np.asarray(usteps) + 0.5).astype(np.int64)
    return nearest


def require_steppable(train: StepTrain, joints: Sequence[JointSpec] | None = None) -> None:
    """Check that the firmware can make the steps.

    Raises:
        TimingError: a step of a joint follows too soon after the one before it, or after the motion's start.
    """
    board = train.board
    reversal_ticks = least_reversal_ticks(board)
    for number, steps in enumerate(train.steps, start=1):
        if not len(steps.ticks):
            continue
        reverses = np.diff(steps.directions) != 0
        room = np.diff(steps.ticks) - np.where(reverses, reversal_ticks, board.min_interval_ticks)
        if len(room) and room.min() < 0:
            raise TimingError(_too_fast(board, number, steps, int(room.argmin()), joints))
        if steps.ticks[0] < MIN_DIR_SETUP_TICKS:
            raise TimingError(
                f"joint {number} would step {steps.ticks[0]} ticks after the motion's start; its DIR line needs "
                f"{MIN_DIR_SETUP_TICKS}: let the motion start later"
            )
        if steps.ticks[-1] >= train.duration_ticks:
            raise TimingError(
                f"joint {number} steps at tick {steps.ticks[-1]}, the motion ends at {train.duration_ticks}"
            )


def _too_fast(board: Board, number: int, steps: JointSteps, i: int, joints: Sequence[JointSpec] | None) -> str:
    """Tell where a joint is too fast and what to do about it."""
    gap = int(steps.ticks[i + 1] - steps.ticks[i])
    at_s = steps.ticks[i] / TICKS_HZ
    if steps.directions[i] != steps.directions[i + 1]:
        return (
            f"joint {number} would reverse within {gap} ticks at {at_s:.6f} s; reversing takes "
            f"{least_reversal_ticks(board)} on the board {board.name}: lower joints[{number}].max_acceleration_deg_s2"
        )
    return (
        f"joint {number} would step after {gap} ticks ({TICKS_HZ / max(gap, 1):.0f} steps/s) at {at_s:.6f} s; the "
        f"board {board.name} needs {board.min_interval_ticks} ({largest_rate_hz(board):.0f} steps/s): "
        f"{slower(board, number, joints)}"
    )


def slower(board: Board, number: int, joints: Sequence[JointSpec] | None) -> str:
    """Say which setting slows a joint down to what the board can step."""
    advice = f"lower joints[{number}].max_speed_deg_s"
    if joints is None:
        return advice
    fastest_deg_s = np.degrees(largest_rate_hz(board) / joints[number - 1].usteps_per_rad)
    return f"{advice} to at most {fastest_deg_s:.6g}, or its microsteps or gear_ratio"
