"""The certificate's torques, against the planner's equations of motion and against closed forms."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from host_scenes import make_scene
from motion_paths import joint, joint_line
from planarm.dynamics.pull_out import Drives, pull_out_nm
from planarm.dynamics.rigid_body import RigidBody, inverse_dynamics
from planarm.scene.mechanics import MechanicsSpec
from planarm.stepping.check_motion import Planned
from planarm.stepping.check_torque import check_torque, joint_torques_nm, motor_torque_shares
from planarm.trajectory.timing import time_path


def random_mechanics(rng, links):
    def draw(low, high):
        return tuple(rng.uniform(low, high, links).tolist())

    return MechanicsSpec(
        gravity=bool(rng.random() < 0.5),
        link_masses_kg=draw(0.05, 1.0),
        link_com_share=draw(0.1, 0.9),
        link_inertias_kg_m2=draw(0.0, 0.02),
        end_masses_kg=draw(0.0, 0.5),
        coulomb_friction_nm=draw(0.0, 0.1),
        viscous_friction_nm_s=draw(0.0, 0.1),
        backlash_rad=(0.0,) * links,
        stiffness_nm_rad=(1000.0,) * links,
        hard_stops_rad=((-np.inf, np.inf),) * links,
    )


@pytest.mark.parametrize("links", [1, 2, 3, 4])
def test_newton_and_euler_agree_with_lagrange(links):
    rng = np.random.default_rng(links)
    lengths = tuple(rng.uniform(5.0, 40.0, links).tolist())
    mechanics = random_mechanics(rng, links)
    scene = make_scene()
    scene = replace(scene, arm=replace(scene.arm, link_lengths_cm=lengths), mechanics=mechanics)
    body = RigidBody.of(scene)
    q, qd, qdd = rng.uniform(-3.0, 3.0, (3, 50, links))
    found = joint_torques_nm(lengths, mechanics, q, qd, qdd)
    wanted = [inverse_dynamics(body, *row) for row in zip(q, qd, qdd, strict=True)]
    assert found == pytest.approx(np.array(wanted), rel=1e-9, abs=1e-12)


def test_motors_share_the_joints_torques_by_their_coupling():
    """A belt-driven elbow's motor carries the forearm's torque, and the shoulder's motor what is left of its own."""
    rng = np.random.default_rng(5)
    scene = replace(make_scene(), coupling=((1.0, 0.0), (1.0, 1.0)), mechanics=random_mechanics(rng, 2))
    drives = Drives.of(scene, 1.0)
    tau, qd, qdd = rng.uniform(-1.0, 1.0, (3, 20, 2))
    at_joints = tau + drives.coulomb_nm * np.sign(qd) + drives.viscous_nm_s * qd + qdd @ drives.rotors_kg_m2
    speeds = qd @ drives.coupling.T
    given = np.array([[pull_out_nm(drives, m, speeds[i, m]) for m in range(2)] for i in range(20)])
    wanted = np.abs(at_joints @ drives.to_motors.T) / given
    assert motor_torque_shares(scene, tau, qd, qdd) == pytest.approx(wanted, rel=1e-9)


def test_a_payload_held_out_in_gravity_is_its_weight_times_the_lever():
    """2 kg at 0.5 m on joint 1's motor, 0.40 N m x 1.2 A / (sqrt 2 x 1.7 A), geared 5 : 1; the motion hardly moves."""
    free = ((-np.inf, np.inf),) * 2
    bare = MechanicsSpec(
        True, (1e-9, 1e-9), (0.5, 0.5), (0.0, 0.0), (0.0, 2.0), (0.0, 0.0), (0.0, 0.0), (0, 0), (1, 1), free
    )
    scene = replace(make_scene(), joints=(joint(), joint()), mechanics=bare)
    still = time_path(joint_line((0.0, 0.0), (0.001, 0.001)), [joint(0.001, 0.01)] * 2)
    first, second = check_torque(Planned.of(still), scene)
    peak = 0.40 * 1.2 / (2**0.5 * 1.7) * 5.0
    assert first.value == pytest.approx(2.0 * 9.80665 * 0.5 / peak, rel=0.01)
    assert second.value == pytest.approx(2.0 * 9.80665 * 0.2 / peak, rel=0.01)
    assert first.verdict == "red"
    assert "payload" not in first.setting
    assert "end_masses_kg" in first.setting


@pytest.mark.parametrize(("payload_kg", "verdict"), [(0.0, "green"), (0.25, "amber"), (2.5, "red")])
def test_more_payload_than_the_motors_can_swing_turns_it_red(payload_kg, verdict):
    scene = make_scene()
    scene = replace(scene, mechanics=replace(scene.mechanics, end_masses_kg=(0.0, payload_kg)))
    motion = time_path(joint_line((0.0, 0.0), (pi / 2, 0.1)), scene.joints)
    assert check_torque(Planned.of(motion), scene)[0].verdict == verdict
