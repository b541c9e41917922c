"""Pull-out torque: worked corner speeds, the curve's shape, gears, coupled motors."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from host_scenes import make_scene
from planarm.dynamics.pull_out import Drives, corner_rad_s, pull_out_nm
from planarm.dynamics.rigid_body import RigidBody
from planarm.scene import JointSpec, MotorSpec


def joint_with(gear=1.0, **motor):
    return JointSpec(200, 16, gear, "a4988", 2.0, 10.0, motor=replace(MotorSpec(), **motor))


@pytest.mark.parametrize(
    ("inductance_mh", "current_a", "supply_v", "full_steps_s"),
    # Full steps a second by V / (2 L I), worked by hand.
    [(2.8, 1.7, 12.0, 1261.0), (2.8, 1.7, 24.0, 2521.0), (4.2, 1.5, 12.0, 952.0), (4.2, 1.5, 24.0, 1905.0)],
)
def test_corner_speeds_are_the_worked_ones(inductance_mh, current_a, supply_v, full_steps_s):
    made = joint_with(inductance_h=1e-3 * inductance_mh, current_a=current_a, supply_v=supply_v)
    assert corner_rad_s(made) * 200 / (2 * pi) == pytest.approx(full_steps_s, abs=0.6)
    assert corner_rad_s(replace(made, gear_ratio=5.0)) == pytest.approx(corner_rad_s(made) / 5.0)


def test_the_torque_is_flat_then_falls_as_one_over_speed():
    scene = replace(make_scene(), joints=(joint_with(5.0), joint_with(5.0)))
    drives = Drives.of(scene, 0.5)
    corner, flat = drives.corner_rad_s[0], drives.flat_nm[0]
    assert flat == pytest.approx(0.5 * 5.0 * MotorSpec().peak_torque_nm)
    for speed in (0.0, 0.5 * corner, -corner):
        assert pull_out_nm(drives, 0, speed) == pytest.approx(flat)
    for times in (2.0, 5.0):
        assert pull_out_nm(drives, 0, -times * corner) == pytest.approx(flat / times)


def test_rotors_count_with_the_square_of_their_gear():
    scene = replace(make_scene(), joints=(joint_with(5.0), joint_with(3.0, rotor_inertia_kg_m2=1e-5)))
    assert Drives.of(scene, 1.0).rotors_kg_m2 == pytest.approx(np.diag([25.0 * 5.4e-6, 9e-5]))


def test_a_belt_driven_elbow_shares_torques_as_power_says():
    # Motor 2 stands in the base and turns by theta1 + theta2.
    scene = replace(make_scene(), joints=(joint_with(5.0), joint_with(5.0)), coupling=((1.0, 0.0), (1.0, 1.0)))
    drives = Drives.of(scene, 1.0)
    rng = np.random.default_rng(0)
    tau, qd = rng.normal(size=(2, 2))
    assert (drives.to_motors @ tau) @ (drives.coupling @ qd) == pytest.approx(tau @ qd)
    rotor = 25.0 * 5.4e-6
    assert 0.5 * qd @ drives.rotors_kg_m2 @ qd == pytest.approx(0.5 * rotor * (qd[0] ** 2 + (qd[0] + qd[1]) ** 2))


def test_a_scene_s_arm_is_built_in_si():
    # Two thin rods of 0.4 kg/m, 0.3 and 0.2 m: moments and inertia at full stretch are those of one rod of 0.5 m.
    scene = make_scene()
    scene = replace(scene, mechanics=replace(scene.mechanics, gravity=True))
    body = RigidBody.of(scene)
    assert body.moments_kg_m.sum() == pytest.approx(0.4 * 0.5 * 0.25)
    assert body.products_kg_m2.sum() == pytest.approx(0.4 * 0.5 * 0.5**2 / 3.0)
    assert body.gravity_m_s2.tolist() == [0.0, -9.80665]
