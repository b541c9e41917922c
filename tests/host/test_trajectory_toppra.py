"""The timing against toppra, the usual library for it, where toppra is a fair oracle: speed, acceleration, constant
torque.

Between its gridpoints toppra exceeds limits a little and so can be a little faster: the durations agree within 1 %.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from host_scenes import make_scene
from motion_paths import joint
from planarm.dynamics.motor_terms import Load
from planarm.dynamics.rigid_body import inverse_dynamics
from planarm.model.arm import Arm
from planarm.smoothing.joint_spline import JointSpline
from planarm.trajectory.check import limit_use
from planarm.trajectory.limits import HEADROOM, Limits
from planarm.trajectory.timing import fastest_motion

toppra = pytest.importorskip("toppra", reason="toppra has wheels for Linux only")

GRIDPOINTS = 1000


def random_spline(rng, joints):
    """A smooth path through random way-points, as a spline of scipy and as ours."""
    count = int(rng.integers(3, 8))
    spline = CubicSpline(np.arange(count), rng.uniform(-2.0, 2.0, (count, joints)))
    arm = Arm((10.0,) * joints, (0.0, 0.0), ((-9.0, 9.0),) * joints)
    ours = JointSpline(arm, spline.x, np.ascontiguousarray(spline.c[::-1].transpose(1, 0, 2)), np.zeros(0))
    return spline, ours


def toppra_s(spline, constraints):
    toppra.setup_logging("ERROR")
    path = toppra.SplineInterpolator(spline.x, spline(spline.x))
    grid = np.linspace(spline.x[0], spline.x[-1], GRIDPOINTS)
    solver = toppra.algorithm.TOPPRA(constraints, path, gridpoints=grid, solver_wrapper="seidel")
    _, rates, _ = solver.compute_parameterization(0.0, 0.0)
    return float(np.sum(2.0 * np.diff(grid) / (rates[1:] + rates[:-1])))


def both_ways(limits):
    return np.stack([-limits, limits], axis=1)


def test_durations_are_toppra_s_within_one_percent(sized):
    count = sized(12, 240)
    worst = 0.0
    for seed in range(count):
        rng = np.random.default_rng(seed)
        joints = int(rng.integers(1, 5))
        spline, ours = random_spline(rng, joints)
        speeds, accelerations = rng.uniform(0.5, 4.0, joints), rng.uniform(2.0, 30.0, joints)
        limits = Limits.of_joints([joint(*both) for both in zip(speeds, accelerations, strict=True)], 1.0)
        made = fastest_motion(ours, limits)
        assert limit_use(made, limits).largest <= 1.0 + 1e-9
        expected = toppra_s(
            spline,
            [
                toppra.constraint.JointVelocityConstraint(both_ways(HEADROOM * speeds)),
                toppra.constraint.JointAccelerationConstraint(both_ways(HEADROOM * accelerations)),
            ],
        )
        worst = max(worst, abs(made.duration_s / expected - 1.0))
        assert made.duration_s == pytest.approx(expected, rel=0.01), f"seed {seed}"
    print(f"{count} random paths, largest difference of durations {100.0 * worst:.3f} %")


def test_durations_under_constant_torque_are_toppra_s_within_one_percent(sized):
    for seed in range(sized(4, 60)):
        rng = np.random.default_rng(seed)
        spline, ours = random_spline(rng, 2)
        scene = make_scene()
        # A supply so high that the torque never falls, and no friction that grows with speed.
        motor = replace(scene.joints[0].motor, supply_v=1e6)
        one = replace(scene.joints[0], gear_ratio=8.0, max_speed_rad_s=3.0, max_acceleration_rad_s2=1e4, motor=motor)
        mechanics = replace(
            scene.mechanics, gravity=True, coulomb_friction_nm=(0.05, 0.02), viscous_friction_nm_s=(0.0, 0.0)
        )
        load = Load.of(replace(scene, joints=(one, one), mechanics=mechanics), 0.8)
        limits = Limits.of_joints([one, one], 1.0, load)
        made = fastest_motion(ours, limits)
        assert limit_use(made, limits).largest <= 1.0 + 1e-9

        def torques(q, qd, qdd, load=load):
            return inverse_dynamics(load.body, q, qd, qdd) + load.drives.rotors_kg_m2 @ qdd

        expected = toppra_s(
            spline,
            [
                toppra.constraint.JointVelocityConstraint(both_ways(HEADROOM * limits.speeds_rad_s)),
                toppra.constraint.JointTorqueConstraint(
                    torques, both_ways(load.drives.flat_nm), np.array([0.05, 0.02])
                ),
            ],
        )
        assert made.duration_s == pytest.approx(expected, rel=0.01), f"seed {seed}"
