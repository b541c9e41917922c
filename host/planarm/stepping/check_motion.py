"""Certificate, part two: the motion that was planned, on a dense grid, and the steps held against it.

Speeds and accelerations are differences of the planned angles, so neither the path's derivatives nor the solver are
asked.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from planarm.model.transmission import Transmission, motor_axes
from planarm.scene import JointSpec, Scene
from planarm.stepping.certificate import Check, at_most
from planarm.stepping.poses import MotorPositions
from planarm.stepping.quantise import hysteresis_usteps, timing_usteps
from planarm.stepping.train import Floats, StepTrain
from planarm.trajectory.motion import Trajectory
from planarm_wire.messages import TICKS_HZ

POINTS_PER_S = 10_000
LEAST_POINTS = 1_000
ROUNDING = 1e-6
"""Share of a limit by which differences of doubles may miss it: 1e-16 rad over (0.1 ms)^2 is 1e-8 rad/s^2."""

JERK_ROUNDING_RAD_S3 = 0.05
"""By how much third differences of doubles may miss a jerk: 8 x 1e-15 rad over (0.1 ms)^3 is 0.01 rad/s^3."""


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """The planned angles at even times, the only thing that these checks take from the planner.

    Attributes:
        t_s: from start to end, shape (n,).
        q_rad: shape (n, joints).
    """

    t_s: Floats
    q_rad: Floats

    @classmethod
    def of(cls, trajectory: Trajectory) -> Self:
        """Look at a motion POINTS_PER_S times a second."""
        count = max(LEAST_POINTS, int(POINTS_PER_S * trajectory.duration_s))
        t_s = np.linspace(0.0, trajectory.duration_s, count)
        return cls(t_s, trajectory.sample(t_s)[0])

    @property
    def speeds_rad_s(self) -> Floats:
        """Mean speed between neighbouring times, shape (n - 1, joints)."""
        return np.asarray(np.diff(self.q_rad, axis=0) / self.t_s[1])

    @property
    def accelerations_rad_s2(self) -> Floats:
        """Acceleration around each inner time, shape (n - 2, joints)."""
        return np.asarray(np.diff(self.q_rad, n=2, axis=0) / self.t_s[1] ** 2)

    @property
    def jerks_rad_s3(self) -> Floats:
        """Jerk around the middle of each three neighbouring intervals, shape (n - 3, joints)."""
        return np.asarray(np.diff(self.q_rad, n=3, axis=0) / self.t_s[1] ** 3)


def check_limits(planned: Planned, joints: tuple[JointSpec, ...]) -> list[Check]:
    """Check each joint's planned speed and acceleration, and its jerk where that has a limit."""
    t_s = planned.t_s
    speeds, accelerations = np.abs(planned.speeds_rad_s), np.abs(planned.accelerations_rad_s2)
    checks = []
    for number, joint in enumerate(joints, start=1):
        for name, values, limit, unit, key in (
            ("speed", speeds, joint.max_speed_rad_s, "rad/s", "max_speed_deg_s"),
            ("acceleration", accelerations, joint.max_acceleration_rad_s2, "rad/s^2", "max_acceleration_deg_s2"),
        ):
            worst = int(np.argmax(values[:, number - 1]))
            value, where = values[worst, number - 1], f"{t_s[worst]:.6f} s"
            setting = f"joints[{number}].{key}"
            checks.append(
                at_most(f"joint {number} planned {name}", value, limit, unit, where, setting, limit * ROUNDING)
            )
        if joint.max_jerk_rad_s3 is not None:
            checks.append(_check_jerk(planned, number, joint.max_jerk_rad_s3))
    return checks


def _check_jerk(planned: Planned, number: int, limit: float) -> Check:
    jerks = np.abs(planned.jerks_rad_s3[:, number - 1])
    worst = int(np.argmax(jerks))
    where, setting = f"{planned.t_s[worst]:.6f} s", f"joints[{number}].max_jerk_deg_s3"
    return at_most(f"joint {number} planned jerk", jerks[worst], limit, "rad/s^3", where, setting, JERK_ROUNDING_RAD_S3)


def check_deviation(trajectory: Trajectory, scene: Scene, made: StepTrain, at: MotorPositions) -> list[Check]:
    """Check how far each motor is from its planned angle: around every step of any motor, and at both ends."""
    transmission = Transmission.of(scene)
    ticks = np.concatenate([[0], at.ticks, [made.duration_ticks]])
    planned = transmission.usteps(trajectory.sample(ticks / TICKS_HZ)[0])
    deviation = np.abs(np.concatenate([[made.start_usteps], at.after_usteps, [made.end_usteps]]) - planned)
    before: Floats = np.abs(np.concatenate([[made.start_usteps], at.before_usteps, [made.end_usteps]]) - planned)
    deviation = np.maximum(deviation, before)
    checks = []
    for number, axis in enumerate(motor_axes(scene.joints, scene.coupling), start=1):
        worst = int(np.argmax(deviation[:, number - 1]))
        value, allowed = (
            deviation[worst, number - 1],
            0.5 + timing_usteps(scene.board.joints) + hysteresis_usteps(axis, scene.board),
        )
        where = f"{ticks[worst] / TICKS_HZ:.6f} s"
        checks.append(at_most(f"joint {number} deviation from the plan", value, allowed, "usteps", where))
    return checks
