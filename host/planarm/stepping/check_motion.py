"""Certificate, part two: the motion that was planned, on a dense grid, and the steps held against it.

Speeds and accelerations are differences of the planned angles, so neither the path's derivatives nor the solver are
asked.
"""

import numpy as np

from planarm.model.transmission import Transmission, motor_axes
from planarm.scene import JointSpec, Matrix
from planarm.stepping.certificate import Check, at_most
from planarm.stepping.quantise import TIMING_USTEPS, hysteresis_usteps
from planarm.stepping.train import Floats, StepTrain
from planarm.trajectory.motion import Trajectory
from planarm_wire.messages import TICKS_HZ

POINTS_PER_S = 10_000
LEAST_POINTS = 1_000
ROUNDING = 1e-6
"""Share of a limit by which differences of doubles may miss it: 1e-16 rad over (0.1 ms)^2 is 1e-8 rad/s^2."""


def check_limits(trajectory: Trajectory, joints: tuple[JointSpec, ...]) -> list[Check]:
    """Check each joint's planned speed and acceleration."""
    if trajectory.duration_s == 0.0:
        return []
    count = max(LEAST_POINTS, int(POINTS_PER_S * trajectory.duration_s))
    t_s = np.linspace(0.0, trajectory.duration_s, count)
    q_rad, _, _ = trajectory.sample(t_s)
    step_s = t_s[1]
    speeds = np.abs(np.diff(q_rad, axis=0)) / step_s
    accelerations = np.abs(np.diff(q_rad, n=2, axis=0)) / step_s**2
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
    return checks


def check_deviation(
    trajectory: Trajectory, made: StepTrain, joints: tuple[JointSpec, ...], coupling: Matrix | None = None
) -> list[Check]:
    """Check how far each motor's steps are from the planned angle: before and after every step, and at both ends."""
    transmission = Transmission.from_joints(joints, coupling)
    end_tick = np.array([0, made.duration_ticks])
    checks = []
    for number, (axis, steps) in enumerate(zip(motor_axes(joints, coupling), made.steps, strict=True), start=1):
        start = made.start_usteps[number - 1]
        after = start + np.cumsum(steps.directions, dtype=np.int64)
        final = int(after[-1]) if len(after) else start
        ticks = np.concatenate([steps.ticks, steps.ticks, end_tick])
        positions = np.concatenate([after, after - steps.directions, [start, final]])
        planned = transmission.usteps(trajectory.sample(ticks / TICKS_HZ)[0])[:, number - 1]
        deviation: Floats = np.abs(positions - planned)
        worst = int(np.argmax(deviation))
        allowed = 0.5 + TIMING_USTEPS + hysteresis_usteps(axis)
        where = f"{ticks[worst] / TICKS_HZ:.6f} s"
        checks.append(at_most(f"joint {number} deviation from the plan", deviation[worst], allowed, "usteps", where))
    return checks
