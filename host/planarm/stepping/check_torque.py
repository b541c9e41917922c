"""Certificate: the torque that the planned motion asks of each motor, against what the motor can give at its speed.

The planner's dynamics are Lagrange's equations in the links' headings; here the same torques come from Newton's and
Euler's: accelerations from the base outwards, forces and moments from the tip inwards. Neither knows of the other.
"""

import numpy as np

from planarm.scene import MechanicsSpec, Scene
from planarm.stepping.certificate import Check, at_most
from planarm.stepping.check_motion import Planned
from planarm.stepping.train import Floats

GRAVITY_M_S2 = 9.80665

STRIDE = 5
"""Torques are looked at every 0.5 ms: they are smooth but where the acceleration jumps, and after a jump they last."""

MOST_SHARE = 1.0
AMBER_SHARE = 0.5
"""Share of the pull-out torque: at all of it the motor falls out of step by the model; what the model leaves out
(resonance, supply, temperature) is usually given half of it."""


def check_torque(planned: Planned, scene: Scene) -> list[Check]:
    """Check the largest share of each motor's pull-out torque that the motion takes."""
    speeds = (0.5 * (planned.speeds_rad_s[1:] + planned.speeds_rad_s[:-1]))[::STRIDE]
    accelerations = planned.accelerations_rad_s2[::STRIDE]
    joints_nm = joint_torques_nm(
        scene.arm.link_lengths_cm, scene.mechanics, planned.q_rad[1:-1:STRIDE], speeds, accelerations
    )
    shares = motor_torque_shares(scene, joints_nm, speeds, accelerations)
    checks = []
    for number in range(1, shares.shape[1] + 1):
        worst = int(np.argmax(shares[:, number - 1]))
        where = f"{planned.t_s[STRIDE * worst + 1]:.6f} s"
        setting = f"joints[{number}].max_acceleration_deg_s2 or mechanics.end_masses_kg"
        name = f"joint {number} share of the pull-out torque"
        checks.append(at_most(name, shares[worst, number - 1], MOST_SHARE, "", where, setting, amber=AMBER_SHARE))
    return checks


def joint_torques_nm(
    link_lengths_cm: tuple[float, ...],
    mechanics: MechanicsSpec,
    q_rad: Floats,
    qd_rad_s: Floats,
    qdd_rad_s2: Floats,
) -> Floats:
    """Return the torque at each joint without friction and rotors, in N m, for a motion of shape (n, joints) each."""
    heading, turn, spin = (np.cumsum(values, axis=1) for values in (q_rad, qd_rad_s, qdd_rad_s2))
    along = np.stack([np.cos(heading), np.sin(heading)], axis=2)
    across = np.stack([-along[..., 1], along[..., 0]], axis=2)
    # Acceleration of a point at distance 1 along each link relative to its inner joint.
    relative = across * spin[..., None] - along * (turn**2)[..., None]
    # To stand still in gravity is to be accelerated upwards.
    acceleration = np.tile([0.0, GRAVITY_M_S2 if mechanics.gravity else 0.0], (len(q_rad), 1))
    joint_accelerations = []
    for link, length_cm in enumerate(link_lengths_cm):
        joint_accelerations.append(acceleration)
        acceleration = acceleration + 0.01 * length_cm * relative[:, link]
    force, moment = np.zeros((len(q_rad), 2)), np.zeros(len(q_rad))
    torques = np.zeros(q_rad.shape)
    for link in range(len(link_lengths_cm) - 1, -1, -1):
        length = 0.01 * link_lengths_cm[link]
        # What the links beyond ask of this one's outer end acts with the whole link as lever.
        moment = moment + length * _cross(along[:, link], force)
        for mass, lever in (
            (mechanics.link_masses_kg[link], mechanics.link_com_share[link] * length),
            (mechanics.end_masses_kg[link], length),
        ):
            push = mass * (joint_accelerations[link] + lever * relative[:, link])
            force = force + push
            moment = moment + lever * _cross(along[:, link], push)
        moment = moment + mechanics.link_inertias_kg_m2[link] * spin[:, link]
        torques[:, link] = moment
    return torques


def motor_torque_shares(scene: Scene, joints_nm: Floats, qd_rad_s: Floats, qdd_rad_s2: Floats) -> Floats:
    """Return the share of its pull-out torque that each motor gives, shape (n, motors)."""
    torques = at_motors_nm(scene, joints_nm, qd_rad_s, qdd_rad_s2)
    return np.asarray(np.abs(torques) / pull_outs_nm(scene, qd_rad_s))


def at_motors_nm(scene: Scene, joints_nm: Floats, qd_rad_s: Floats, qdd_rad_s2: Floats) -> Floats:
    """Return the torque at each motor's own shaft, friction and rotor included, in N m, shape (n, motors)."""
    mechanics, coupling = scene.mechanics, np.array(scene.coupling)
    friction = np.array(mechanics.coulomb_friction_nm) * np.sign(qd_rad_s)
    friction = friction + np.array(mechanics.viscous_friction_nm_s) * qd_rad_s
    # Virtual work: motors that turn by C dq share the joints' torques as C^T tau_motors = tau_joints.
    behind_gears = np.linalg.solve(coupling.T, (joints_nm + friction).T).T
    accelerations = qdd_rad_s2 @ coupling.T
    torques = np.empty_like(behind_gears)
    for m, joint in enumerate(scene.joints):
        rotor = joint.motor.rotor_inertia_kg_m2 * joint.gear_ratio
        torques[:, m] = behind_gears[:, m] / joint.gear_ratio + rotor * accelerations[:, m]
    return torques


def pull_outs_nm(scene: Scene, qd_rad_s: Floats) -> Floats:
    """Return the pull-out torque that each motor has at its own shaft at these joint speeds, shape (n, motors)."""
    speeds: Floats = np.abs(qd_rad_s @ np.array(scene.coupling).T)
    given: Floats = np.empty_like(speeds)
    for m, joint in enumerate(scene.joints):
        motor = joint.motor
        full_steps_s = speeds[:, m] * joint.gear_ratio * joint.steps_per_rev / (2.0 * np.pi)
        corner = motor.supply_v / (2.0 * motor.inductance_h * motor.current_a)
        given[:, m] = motor.peak_torque_nm * np.minimum(1.0, corner / np.maximum(full_steps_s, corner))
    return given


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
