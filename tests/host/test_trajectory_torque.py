"""Timing under torque that falls with speed: closed forms, limits by inverse dynamics of differences, and what cannot
be."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from host_scenes import make_scene
from motion_paths import joint_line, tip_path, tip_points, waves
from planarm.dynamics.motor_terms import Load, motor_terms
from planarm.dynamics.rigid_body import inverse_dynamics
from planarm.errors import TimingError
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion, time_path


def scene_with(*, gear=5.0, speed=50.0, acceleration=1e4, friction=0.0, viscous=0.0, payload=0.0, **more):
    scene = make_scene()
    joint = replace(scene.joints[0], gear_ratio=gear, max_speed_rad_s=speed, max_acceleration_rad_s2=acceleration)
    mechanics = replace(
        scene.mechanics,
        coulomb_friction_nm=(friction, friction),
        viscous_friction_nm_s=(viscous, viscous),
        end_masses_kg=(0.0, payload),
        gravity=more.pop("gravity", False),
    )
    motor = replace(joint.motor, **more.pop("motor", {}))
    return replace(scene, mechanics=mechanics, joints=(replace(joint, motor=motor),) * 2, **more)


def bang_bang_s(way, inertia, flat, corner, viscous=0.0):
    """Rest to rest under |inertia w'| <= flat min(1, corner / w): speed up and slow down are mirror images.

    Below the corner w = (T / J) t. Above it w w' = T corner / J, so w^2 = corner^2 + 2 (T corner / J) t, and the way is
    the integral of w: (w^3 - corner^3) / (3 T corner / J).
    """
    assert viscous == 0.0
    a = flat / inertia
    if a * way <= corner**2:
        return 2.0 * sqrt(way / a)
    top = brentq(lambda w: 0.5 * corner**2 / a + (w**3 - corner**3) / (3.0 * a * corner) - 0.5 * way, corner, 1e4)
    return 2.0 * (corner / a + (top**2 - corner**2) / (2.0 * a * corner))


@settings(max_examples=25, deadline=None)
@given(way=st.floats(0.05, 3.0), volts=st.floats(6.0, 48.0), gear=st.floats(1.0, 10.0), share=st.floats(0.3, 1.0))
def test_one_joint_takes_the_time_of_the_closed_form_below_and_above_the_corner(way, volts, gear, share):
    scene = scene_with(gear=gear, motor={"supply_v": volts})
    load = Load.of(scene, 0.5)
    # Joint 1 turns the straight arm: its inertia is constant, and joint 2 only has to hold on.
    inertia = load.body.products_kg_m2.sum() + load.drives.rotors_kg_m2[0, 0]
    strong = load._replace(drives=load.drives._replace(flat_nm=load.drives.flat_nm * np.array([1.0, 100.0])))
    made = time_path(joint_line((0.0, 0.0), (way, 0.0)), scene.joints, share, strong)
    expected = bang_bang_s(way, inertia, share * strong.drives.flat_nm[0], strong.drives.corner_rad_s[0])
    assert made.duration_s == pytest.approx(expected, rel=2e-3)


def random_path(seed):
    rng = np.random.default_rng(seed)
    return tip_path(tip_points(rng, 5), float(rng.uniform(0.1, 2.0))) if seed % 2 else waves(rng)


def torque_use(trajectory, scene, share, torque_share, count=4001):
    """Use of what gravity and friction leave, by inverse dynamics of differences of positions; own pull-out formula."""
    load = Load.of(scene, torque_share)
    t_s, h = np.linspace(0.0, trajectory.duration_s, count)[1:-1], 1e-5
    # Accelerations and friction jump at gridpoints only; differences across a jump mix both sides.
    t_s = t_s[np.abs(t_s[:, None] - trajectory.t_s).min(axis=1) > 2.0 * h]
    q, ahead, behind = (trajectory.sample(t_s + d)[0] for d in (0.0, h, -h))
    qd, qdd = (ahead - behind) / (2 * h), (ahead - 2 * q + behind) / h**2
    use = np.zeros((len(t_s), 2))
    for i in range(len(t_s)):
        gravity = inverse_dynamics(load.body, q[i], np.zeros(2), np.zeros(2))
        friction = np.array(scene.mechanics.coulomb_friction_nm) * np.sign(qd[i])
        moving = inverse_dynamics(load.body, q[i], qd[i], qdd[i]) - gravity + load.drives.rotors_kg_m2 @ qdd[i]
        moving = load.drives.to_motors @ (moving + np.array(scene.mechanics.viscous_friction_nm_s) * qd[i])
        held = load.drives.to_motors @ (gravity + friction)
        turning = np.abs(load.drives.coupling @ qd[i])
        there = load.drives.flat_nm * np.minimum(1.0, load.drives.corner_rad_s / np.maximum(turning, 1e-9))
        left = there - np.sign(moving) * held
        assert (left > 0.0).all()
        use[i] = np.abs(moving) / (share * left)
    return use


SCENES = {
    "flat": {},
    "with gravity, friction and payload": {
        "gravity": True,
        "friction": 0.02,
        "viscous": 0.01,
        "payload": 0.05,
        "gear": 10.0,
    },
    "slow supply": {"gear": 20.0, "motor": {"supply_v": 6.0}, "viscous": 0.05},
    "belt-driven elbow": {"coupling": ((1.0, 0.0), (1.0, 1.0)), "gravity": True, "gear": 10.0},
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("seed", range(6))
def test_the_true_torque_is_kept_everywhere_and_used(name, seed):
    scene = scene_with(**SCENES[name])
    path = random_path(seed)
    made = fastest_motion(path, Limits.of_joints(scene.joints, 0.8, Load.of(scene, 0.5)))
    use = torque_use(made, scene, 0.8, 0.5)
    assert use.max() <= 1.0005  # angles are rounded: 1e-16 / (1e-5)^2
    assert np.median(use.max(axis=1)) > 0.97


@pytest.mark.parametrize("seed", range(4))
def test_a_higher_supply_is_never_slower_and_a_loose_torque_changes_nothing(seed):
    path = random_path(seed)
    durations = []
    for volts in (4.0, 8.0, 24.0):
        scene = scene_with(gear=20.0, motor={"supply_v": volts})
        durations.append(time_path(path, scene.joints, load=Load.of(scene, 0.5)).duration_s)
    assert durations[0] > durations[1] * 1.01
    assert durations[1] >= durations[2] * (1.0 - 1e-4)
    scene = scene_with(speed=1.0, acceleration=2.0)
    loose = time_path(path, scene.joints, load=Load.of(scene, 1.0))
    assert loose.duration_s == pytest.approx(time_path(path, scene.joints).duration_s, rel=1e-4)


def test_what_a_motor_cannot_hold_is_told_with_joint_place_and_setting():
    scene = scene_with(gravity=True, gear=1.0)
    with pytest.raises(
        TimingError, match=r"joint 1 cannot move at s = 0.000: .* take 0.\d+ N m .* may use 0.09\d+ N m; .*joints\[1\]"
    ):
        time_path(joint_line((0.0, 0.0), (1.0, 0.0)), scene.joints, load=Load.of(scene, 0.5))


def test_a_cap_on_the_path_s_speed_is_kept():
    scene = scene_with()
    path = joint_line((0.0, 0.0), (1.0, 0.5))
    made = time_path(path, scene.joints, speed_cap=lambda s: np.where(s < 0.5, 0.3, 10.0))
    assert made.s_dot[made.s < 0.5].max() == pytest.approx(0.3)
    assert made.s_dot.max() > 1.0


def test_terms_are_those_of_inverse_dynamics_along_a_path():
    scene = scene_with(**SCENES["belt-driven elbow"], friction=0.1, viscous=0.2)
    load = Load.of(scene, 0.5)
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 5, 2))
    terms = motor_terms(load, q, dq, ddq, np.sign(dq))
    u, rate = 0.7, 1.3
    for i in range(5):
        qd, qdd = dq[i] * rate, dq[i] * u + ddq[i] * rate**2
        tau = inverse_dynamics(load.body, q[i], qd, qdd) + load.drives.rotors_kg_m2 @ qdd + 0.1 * np.sign(qd) + 0.2 * qd
        made = terms.a[i] * u + terms.b[i] * rate**2 + terms.v[i] * rate + terms.h[i]
        assert made == pytest.approx(load.drives.to_motors @ tau)
        assert terms.w[i] * rate == pytest.approx(load.drives.coupling @ qd)
