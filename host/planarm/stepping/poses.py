"""Every pose that an expanded plan takes, in the order of time, for the checks of the arm in space."""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from planarm.model.transmission import Transmission
from planarm.scene import ArmSpec
from planarm.stepping.clearance import joint_positions_cm
from planarm.stepping.train import Floats, StepTrain, Ticks
from planarm_wire.messages import TICKS_HZ


class MotorPositions(NamedTuple):
    """Where the motors stand at each tick at which anything changes."""

    ticks: Ticks
    """Ascending, shape (n,)."""
    before_usteps: Ticks
    """Just before each tick, shape (n, motors)."""
    after_usteps: Ticks
    """Just after each tick, shape (n, motors)."""


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Poses in the middle of every change, and those at rest before and after the motion.

    Between two neighbouring poses one motor, or several at the same tick, moves by a micro-step. The pose in the middle
    is taken; no point of the arm is farther from it than `reach_cm` before, after and between.

    Attributes:
        ticks: shape (n,).
        q_rad: joint angles, shape (n, joints).
        positions_cm: base, elbow(s) and tip, shape (n, joints + 1, 2).
        reach_cm: shape (n,).
    """

    ticks: Ticks
    q_rad: Floats
    positions_cm: Floats
    reach_cm: Floats

    def since(self, ticks: int) -> Self:
        """Return the poses from a tick on, and the one before it."""
        part = slice(max(0, int(np.searchsorted(self.ticks, ticks)) - 1), None)
        return replace(
            self,
            ticks=self.ticks[part],
            q_rad=self.q_rad[part],
            positions_cm=self.positions_cm[part],
            reach_cm=self.reach_cm[part],
        )

    def place(self, i: int) -> str:
        """Say when and where the i-th pose is."""
        x, y = self.positions_cm[i, -1]
        return f"{self.ticks[i] / TICKS_HZ:.6f} s, tip ({x:.2f}, {y:.2f}) cm"


def motor_positions(made: StepTrain) -> MotorPositions:
    """Return the motors' positions around every tick with a step."""
    every = np.sort(np.concatenate([steps.ticks for steps in made.steps]))
    ticks = every[np.diff(every, prepend=-1) > 0]
    before = np.empty((len(ticks), len(made.steps)), np.int64)
    after = np.empty_like(before)
    for motor, (steps, start) in enumerate(zip(made.steps, made.start_usteps, strict=True)):
        positions = np.concatenate([[start], start + np.cumsum(steps.directions, dtype=np.int64)])
        before[:, motor] = positions[np.searchsorted(steps.ticks, ticks, side="left")]
        after[:, motor] = positions[np.searchsorted(steps.ticks, ticks, side="right")]
    return MotorPositions(ticks, before, after)


def poses_of(arm: ArmSpec, transmission: Transmission, made: StepTrain, at: MotorPositions) -> Poses:
    """Return the poses of the whole motion."""
    ends = np.array([made.start_usteps, made.end_usteps], np.float64)
    middles = np.concatenate([ends[:1], 0.5 * (at.before_usteps + at.after_usteps), ends[1:]])
    half_usteps_cm = 0.5 * transmission.levers_cm(arm.link_lengths_cm)
    moved = np.abs(at.after_usteps - at.before_usteps) @ half_usteps_cm
    q_rad = transmission.q_rad(middles)
    positions = joint_positions_cm(np.array(arm.link_lengths_cm, np.float64), arm.base_cm, q_rad)
    ticks = np.concatenate([[0], at.ticks, [made.duration_ticks]])
    return Poses(ticks, q_rad, positions, np.concatenate([[0.0], moved, [0.0]]))
