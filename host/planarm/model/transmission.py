"""Joint angles to micro-steps and back: gears, senses of turning, zeros, and motors that move several joints.

Motor m stands at usteps_m = K_m sum_j C_mj (q_j - zero_j), with K_m the micro-steps of one radian behind its gear,
negative where it is reversed, and C the coupling matrix. C is the unit matrix when each motor sits on its own joint; a
belt-driven elbow, whose motor stands in the base, has C = [[1, 0], [1, 1]]: its motor turns by theta1 + theta2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.scene import JointSpec, Matrix, Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Transmission:
    """The map between joint angles and micro-steps.

    Attributes:
        usteps_per_rad: micro-steps of each motor for one radian of each joint, signed, shape (motors, joints).
        rad_per_ustep: its inverse: what a micro-step of each motor does to each joint, shape (joints, motors).
        zero_rad: the joint angles at which every motor stands at micro-step 0, shape (joints,).
    """

    usteps_per_rad: Floats
    rad_per_ustep: Floats
    zero_rad: Floats

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """Return the transmission that a scene describes."""
        return cls.from_joints(scene.joints, scene.coupling)

    @classmethod
    def from_joints(cls, joints: Sequence[JointSpec], coupling: Matrix | None = None) -> Self:
        """Return the transmission of these joints; without a coupling each motor moves its own joint.

        Raises:
            numpy.linalg.LinAlgError: the coupling has no inverse; scenes are checked for that when they are read.
        """
        senses = np.array([-1.0 if joint.reversed else 1.0 for joint in joints])
        gears = senses * np.array([joint.usteps_per_rad for joint in joints])
        matrix = gears[:, None] * (np.eye(len(joints)) if coupling is None else np.array(coupling))
        return cls(matrix, np.linalg.inv(matrix), np.array([joint.zero_offset_rad for joint in joints]))

    def usteps(self, q_rad: ArrayLike) -> Floats:
        """Return where the motors stand, shape (..., motors), for joint angles of shape (..., joints); not rounded."""
        offset: Floats = np.asarray(q_rad, np.float64) - self.zero_rad
        return offset @ self.usteps_per_rad.T

    def q_rad(self, usteps: ArrayLike) -> Floats:
        """Return the joint angles, shape (..., joints), for motors at `usteps`, shape (..., motors)."""
        turned: Floats = np.asarray(usteps, np.float64) @ self.rad_per_ustep.T
        return turned + self.zero_rad

    def rates(self, q_dot: ArrayLike) -> Floats:
        """Return the motors' rates in micro-steps per unit of what the joints' rates, shape (..., joints), are per."""
        rates: Floats = np.asarray(q_dot, np.float64) @ self.usteps_per_rad.T
        return rates

    def levers_cm(self, link_lengths_cm: Sequence[float]) -> Floats:
        """Return how far a micro-step of each motor can move a point of the arm, at most, shape (motors,).

        Link i's direction turns by what all joints up to it turn by, and carries everything beyond it along.
        """
        headings = np.cumsum(self.rad_per_ustep, axis=0)
        levers: Floats = np.asarray(link_lengths_cm) @ np.abs(headings)
        return levers


def motor_axes(joints: Sequence[JointSpec], coupling: Matrix | None = None) -> tuple[JointSpec, ...]:
    """Return each motor's own axis as a joint: the limits are the most that the joints' limits can ask of the motor."""
    weights = np.eye(len(joints)) if coupling is None else np.abs(np.array(coupling))
    speeds = weights @ np.array([joint.max_speed_rad_s for joint in joints])
    accelerations = weights @ np.array([joint.max_acceleration_rad_s2 for joint in joints])
    return tuple(
        replace(joint, max_speed_rad_s=float(speed), max_acceleration_rad_s2=float(acceleration))
        for joint, speed, acceleration in zip(joints, speeds, accelerations, strict=True)
    )
