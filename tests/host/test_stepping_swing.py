"""Swings of rotors and links: closed forms, a plain integration of the whole arm, and what the certificate says."""

from bisect import bisect_right
from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from joint_motions import laden, on_its_way, through
from planarm.dynamics.rigid_body import RigidBody, inertia_matrix, inverse_dynamics
from planarm.errors import TimingError
from planarm.scene.motor import MotorSpec
from planarm.stepping.calmer import with_advice
from planarm.stepping.certify import certify
from planarm.stepping.check_motion import Planned
from planarm.stepping.check_swing import check_swing, held_runs, holds_of
from planarm.stepping.expand import expand
from planarm.stepping.swinging import Swinging, _rotors

CALM = MotorSpec(detent_torque_nm=0.0, current_a=1.7)


def swinging_of(scene, poses_rad):
    trajectory, _, segments = through(scene, poses_rad)
    planned = Planned.of(trajectory)
    return Swinging.of(planned, expand(segments), scene), planned, segments


def frictionless(joints, stiffness_nm_rad=1e5, **joint):
    scene = laden(joints, (0.5,) * joints, motor=CALM, microsteps=32, **joint)
    nothing = (0.0,) * joints
    mechanics = replace(
        scene.mechanics,
        coulomb_friction_nm=nothing,
        viscous_friction_nm_s=nothing,
        stiffness_nm_rad=(stiffness_nm_rad,) * joints,
    )
    return replace(scene, mechanics=mechanics)


def test_a_jump_of_the_acceleration_swings_twice_as_far_as_its_torque():
    """The undamped oscillator: from rest under a constant torque it swings to twice the angle that balances it."""
    scene = frictionless(1, max_acceleration_rad_s2=16.0, max_speed_rad_s=3.0)
    swinging, planned, _ = swinging_of(scene, [[0.0], [1.2]])
    motor, joint = scene.joints[0].motor, scene.joints[0]
    arm = inertia_matrix(RigidBody.of(scene), np.zeros(1))[0, 0]
    reflected = motor.rotor_inertia_kg_m2 * joint.gear_ratio**2
    torque = (arm + reflected) * planned.accelerations_rad_s2.max()
    # sin(lag) swings: energy of a torque T over the lag x is that of the field, T x = k (1 - cos x).
    share = torque / (motor.peak_torque_nm * joint.gear_ratio)
    wanted = 2.0 * share
    for _ in range(20):
        wanted = np.arccos(1.0 - share * wanted)
    found = swinging.follow(swinging.start, 0.2)  # before it brakes
    assert planned.accelerations_rad_s2[:1900].min() > 0.0
    assert 0.3 < wanted < 1.0
    assert found.lags_rad[0] == pytest.approx(wanted, rel=0.05)


def test_small_swings_have_the_frequency_of_field_gear_and_inertia():
    scene = frictionless(1, stiffness_nm_rad=300.0)
    swinging, _, _ = swinging_of(scene, [[0.0], [1.0]])
    joint = scene.joints[0]
    inertia = inertia_matrix(RigidBody.of(scene), np.zeros(1))[0, 0]
    field = joint.motor.peak_torque_nm * joint.steps_per_rev / 4.0 * joint.gear_ratio**2
    stiffness = field * 300.0 / (field + 300.0)
    omega = sqrt(stiffness / inertia)  # the rotor's own inertia is a hundredth of the arm's
    still = replace(swinging, field=swinging.field._replace(first=np.array([0, 1])))
    state = still.start.state.copy()
    state[0] += 1e-4  # the arm alone; the rotor follows within a fiftieth of a period
    run, angles = replace(still.start, state=state), []
    for at_s in np.arange(0.001, 0.6, 0.001):
        run = still.follow(run, float(at_s))
        angles.append(run.state[0, 0])
    angles = np.array(angles) - still.start.state[0, 0]
    ups = np.flatnonzero((angles[:-1] < 0.0) & (angles[1:] >= 0.0))
    period_s = (ups[-1] - ups[0]) * 0.001 / (len(ups) - 1)
    assert 2.0 * pi / period_s == pytest.approx(omega, rel=0.03)


def plain_lags(scene, train, until_s):
    """Largest lags by Lagrange's equations of the whole arm at its own pose, integrated with error control."""
    body, joints, n = RigidBody.of(scene), scene.joints, len(scene.joints)
    rotors, coupling, mechanics = _rotors(scene), np.array(scene.coupling), scene.mechanics
    zero = np.array([joint.zero_offset_rad for joint in joints])
    positions = [
        start + np.concatenate([[0], np.cumsum(steps.directions)])
        for start, steps in zip(train.start_usteps, train.steps, strict=True)
    ]
    to_field = np.array([0.5 * pi / joint.microsteps for joint in joints])
    ticks = [steps.ticks.tolist() for steps in train.steps]
    viscous, coulomb = np.array(mechanics.viscous_friction_nm_s), np.array(mechanics.coulomb_friction_nm)
    still, beside = np.zeros(n), 4.0 * rotors.teeth
    peak = rotors.constant_nm_a * rotors.current_a

    def fields(t):
        return to_field * [at[bisect_right(of, t * 16e6)] for at, of in zip(positions, ticks, strict=True)]

    def slopes(t, y):
        q, qd, rotor, speed = y.reshape(4, n)
        slack = coupling @ (q - zero) - rotor / rotors.gear
        beyond = np.sign(slack) * np.maximum(np.abs(slack) - rotors.half_play_rad, 0.0)
        geared = -rotors.stiffness_nm_rad * beyond
        geared -= (beyond != 0.0) * rotors.gear_damping_nm_s * (coupling @ qd - speed / rotors.gear)
        friction = viscous * qd + coulomb * np.tanh(qd / 0.002)
        push = coupling.T @ geared - friction - inverse_dynamics(body, q, qd, still)
        pull = peak * np.sin(fields(t) - rotors.teeth * rotor)
        pull -= rotors.detent_nm * np.sin(beside * rotor) + rotors.damping_nm_s * speed
        spin = (pull - geared / rotors.gear) / rotors.inertia_kg_m2
        return np.concatenate([qd, np.linalg.solve(inertia_matrix(body, q), push), speed, spin])

    rotor = fields(0.0) / rotors.teeth
    y = np.concatenate([zero + np.linalg.solve(coupling, rotor / rotors.gear), np.zeros(n), rotor, np.zeros(n)])
    # With a tenth of these errors the lags differ by at most 0.011.
    found = solve_ivp(slopes, (0.0, until_s), y, "RK45", rtol=1e-4, atol=1e-7, max_step=2e-4)
    lags = [np.abs(fields(t) - rotors.teeth * y[2 * n : 3 * n]) for t, y in zip(found.t, found.y.T, strict=True)]
    return np.max(lags, axis=0)


@pytest.mark.parametrize(("joints", "seed"), [(1, 1), (2, 2), (3, 3), (4, 11)])
def test_lags_are_those_of_the_whole_arm_integrated_with_error_control(joints, seed):
    """Of these motions. Of other random ones of four joints a lag may be off by three tenths."""
    rng = np.random.default_rng(seed)
    scene = laden(joints, (0.0,) * joints, microsteps=4)
    mechanics = replace(scene.mechanics, gravity=joints % 2 == 0, backlash_rad=(0.001 * (joints > 2),) * joints)
    unit = np.eye(joints)
    coupled = unit + np.eye(joints, k=-1) if joints == 2 else unit
    scene = replace(scene, mechanics=mechanics, coupling=tuple(map(tuple, coupled.tolist())))
    trajectory, _, segments = through(scene, rng.uniform(-1.0, 1.0, (2, joints)))
    made = expand(segments)
    swinging = Swinging.of(Planned.of(trajectory), made, scene)
    until_s = min(0.3, trajectory.duration_s)
    found = swinging.follow(swinging.start, until_s).lags_rad
    assert found == pytest.approx(plain_lags(scene, made, until_s), rel=0.15, abs=0.03)


def test_a_run_in_parts_is_the_run_in_one():
    swinging, _, _ = swinging_of(laden(2), [[0.0, 0.5], [0.7, -0.4]])
    whole = swinging.follow(swinging.start, swinging.path_s)
    run = parts = swinging.start
    for to_s in (0.2, 0.2001, 0.5, swinging.path_s):
        run = swinging.follow(run, to_s)
        parts = parts.worse(run)
    assert parts.lags_rad == pytest.approx(whole.lags_rad, rel=1e-12)
    assert run.state == pytest.approx(whole.state, rel=1e-9, abs=1e-12)


def test_a_hold_comes_to_rest_pauses_and_runs_on_to_the_same_end():
    scene = laden(2)
    swinging, planned, segments = swinging_of(scene, [[0.0, 0.5], [1.2, -0.4]])
    none = holds_of(swinging, planned, segments, scene)
    one = none._replace(begin_s=np.array([0.5]), pause_s=np.array([3.0]), share=np.array([0.5]))
    here = swinging.follow(swinging.start, 0.5)
    resting = swinging.follow(here, 0.501, one, 0.0)  # within a pause of 3 s the path goes no further
    assert resting.path_s < 0.9
    # After the pause the swing has died away: the rotors stand as they would at rest where the path is.
    quiet = one._replace(pause_s=np.array([3.0]))
    run = swinging.follow(here, swinging.path_s, quiet, 0.0)
    assert run.path_s > resting.path_s
    braked = swinging.follow(here, swinging.path_s, one._replace(share=np.array([1.0])), 0.0)
    assert braked.path_s < run.path_s, "with all of the slowing it rests sooner and runs at full rate sooner"
    # A hold of a clock that may not change at all never comes to rest and changes nothing.
    stiff = one._replace(slow_per_s=0.0 * one.slow_per_s)
    assert swinging.follow(here, swinging.path_s, stiff).lags_rad == pytest.approx(
        swinging.follow(here, swinging.path_s).lags_rad
    )


def test_numbers_that_are_none_turn_the_check_red():
    scene = laden(1)
    trajectory, _, segments = through(scene, [[0.0], [1.0]])
    broken = replace(scene, mechanics=replace(scene.mechanics, viscous_friction_nm_s=(float("nan"),)))
    checks = check_swing(Planned.of(trajectory), segments, expand(segments), broken)
    assert [check.verdict for check in checks][:2] == ["red", "red"]


HEAVY = (0.3, 0.3, 0.3)
SHAKEN = np.radians([[0.9 * k + 3.0 * (k % 2), 40, -30] for k in range(7)])


def shaken():
    """Three heavy links that go to and fro in about the time of a swing."""
    scene = on_its_way(laden(3, HEAVY), SHAKEN)
    return scene, *through(scene, SHAKEN)


def lags(certificate):
    return [check for check in certificate.checks if "lag of the rotor" in check.name]


def test_a_motion_that_shakes_a_heavy_arm_is_refused_with_place_and_remedy():
    scene, *plan = shaken()
    certificate = certify(scene, *plan)
    first = lags(certificate)[0]
    assert first.verdict == "red"
    assert first.value > first.limit == pytest.approx(1.0 + 0.5 / 8)
    for word in ("joint 1 lag of the rotor", "full steps", "tip (", "max_acceleration_deg_s2", "max_jerk_deg_s3"):
        assert word in certificate.explain(), certificate.explain()
    # What the torque check says of it: nothing.
    assert all(check.verdict != "red" for check in certificate.checks if "pull-out" in check.name)


def test_the_advice_is_what_passes():
    scene, *plan = shaken()
    only_lags = replace(certify(scene, *plan), checks=tuple(lags(certify(scene, *plan))))

    def timing(changed):
        return through(changed, SHAKEN)[0]

    told = next(check for check in with_advice(scene, only_lags, timing).checks if check.verdict == "red").setting
    values = [float(word) for word in told.split("(to ")[1].split(", tried)")[0].split(", ")]
    joints = tuple(
        replace(one, max_acceleration_rad_s2=np.radians(value)) for one, value in zip(scene.joints, values, strict=True)
    )
    calm = replace(scene, joints=joints)
    assert all(check.verdict != "red" for check in lags(certify(calm, *through(calm, SHAKEN))))
    assert values[0] < np.degrees(scene.joints[0].max_acceleration_rad_s2)

    def never(_scene):
        raise TimingError("no")

    assert with_advice(scene, only_lags, never) is only_lags
    others = replace(
        only_lags, checks=(*only_lags.checks, replace(lags(only_lags)[0], name="timing error", verdict="red"))
    )
    assert with_advice(scene, others, timing) is others


def test_a_light_arm_is_far_from_its_limits():
    poses = np.radians([[0, 40], [50, -40]])
    scene = on_its_way(laden(2, (0.0, 0.0)), poses)
    found = lags(certify(scene, *through(scene, poses)))
    assert len(found) == 6
    assert all(check.verdict == "green" and check.value < 0.6 for check in found)


def test_every_moment_is_tried_where_the_hard_test_is_not_quiet():
    """The largest lag with one hold is at least that of any hold that is tried by itself."""
    poses = np.radians([[0, 40, -30], [60, 20, 40]])
    scene = laden(3, HEAVY)
    swinging, planned, segments = swinging_of(scene, poses)
    holds = holds_of(swinging, planned, segments, scene)
    running = swinging.follow(swinging.start, swinging.path_s)
    held, _ = held_runs(swinging, holds, running, np.full(3, 3.0))
    assert (held.lags_rad >= running.lags_rad - 1e-12).all()
    here = swinging.follow(swinging.start, 0.4)
    one = holds._replace(begin_s=np.array([here.path_s]), pause_s=np.array([0.1]), share=np.array([0.5]))
    alone = swinging.follow(here, swinging.path_s, one, 0.2)
    assert held.lags_rad.max() > 0.8 * alone.lags_rad.max()
    assert held.lags_rad.max() > running.lags_rad.max()


def test_an_upright_arm_begins_where_it_is_held():
    """Let alone at its start it rests: rotors lag and gears are strained by the weight, which is 0.15 kg at 0.22 m."""
    scene = laden(1)
    scene = replace(scene, mechanics=replace(scene.mechanics, gravity=True))
    swinging, _, _ = swinging_of(scene, [[0.0], [1.0]])
    motor, lengths = scene.joints[0].motor, scene.arm.link_lengths_cm
    arm_m = 0.01 * lengths[0]
    weight = 9.80665 * arm_m * (0.15 + 0.5 * scene.mechanics.link_masses_kg[0])
    lag = np.arcsin(weight / scene.joints[0].gear_ratio / motor.peak_torque_nm)
    still = replace(swinging, field=swinging.field._replace(first=np.array([0, 1])))
    run = still.follow(still.start, 0.3)
    assert run.lags_rad[0] == pytest.approx(lag, rel=0.25)  # detent torque moves it a little
