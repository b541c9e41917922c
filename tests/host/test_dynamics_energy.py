"""The cost of an edge: against the integrated motion, an independent integral, and what energy must obey."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from planarm.dynamics.dc_motor import Control, DcMotors, Move, run_moves
from planarm.dynamics.energy import (
    CONSUMED,
    NET,
    TIME,
    TRAVEL,
    EdgeModel,
    edge_costs,
    edge_duration_s,
    edge_energy,
)
from planarm.dynamics.rigid_body import RigidBody, inverse_dynamics, potential_energy_j
from planarm.scene import DcMotorSpec, MotorSpec, parse_scene

SCENE = parse_scene(
    """
[arm]
link_lengths_cm = [30, 25, 15]
link_width_cm = 2
elbow = "either"
[workspace]
x_cm = [-80, 80]
y_cm = [-80, 80]
[planner]
algorithm = "mpd_star_lite"
[mechanics]
gravity = true
end_masses_kg = [0.3, 0.2, 0.4]
[task]
start_deg = [0, 0, 0]
goal_deg = [90, 0, 0]
"""
    + 3 * "[[joints]]\nmax_speed_deg_s = 120\nmax_acceleration_deg_s2 = 400\n",
    "energy.toml",
)
BODY, MOTORS = RigidBody.of(SCENE), DcMotors.of(SCENE)
MODEL = EdgeModel.dc(BODY, MOTORS, SCENE)
poses = st.lists(st.floats(-2.5, 2.5), min_size=3, max_size=3).map(np.array)


@pytest.mark.parametrize("seed", range(4))
def test_the_edge_s_energy_is_that_of_the_integrated_motion(seed):
    """RK4 with PD and feed-forward, winding energy included there, against inverse dynamics and Gauss' rule."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-1.5, 1.5, (2, 3))
    duration = edge_duration_s(MODEL, a, b)
    made = run_moves(BODY, MOTORS, Control.of(DcMotorSpec.usual(3)), [Move(a, b, duration)], 1e-4)
    energy = edge_energy(MODEL, a, b)
    largest = energy[0].sum()
    assert made.part(3)[-1] == pytest.approx(energy[0], abs=4e-3 * largest)
    assert made.part(4)[-1] == pytest.approx(energy[1], abs=1e-3 * largest)


@given(poses, poses)
@settings(max_examples=25, deadline=None)
def test_net_energy_is_an_independent_integral(a, b):
    duration = edge_duration_s(MODEL, a, b)
    if duration < 1e-3:
        return

    def power(t, joint):
        x = t / duration
        s, sd, sdd = x**3 * (10 - 15 * x + 6 * x * x), 30 * x**2 * (1 - x) ** 2, 60 * x * (1 - x) * (1 - 2 * x)
        q, qd, qdd = a + (b - a) * s, (b - a) * sd / duration, (b - a) * sdd / duration**2
        tau = inverse_dynamics(BODY, q, qd, qdd) + MOTORS.reflected_kg_m2 * qdd + MOTORS.viscous_nm_s * qd
        current = tau / (MOTORS.gear_ratio * MOTORS.torque_constant_nm_a)
        volts = MOTORS.resistance_ohm * current + MOTORS.back_emf_v_s * MOTORS.gear_ratio * qd
        return (volts * current)[joint]

    energy = edge_energy(MODEL, a, b)
    for joint in range(3):
        exact, _ = quad(power, 0.0, duration, args=(joint,), epsabs=1e-9, epsrel=1e-9, limit=200)
        assert energy[1, joint] == pytest.approx(exact, abs=2e-3 * (1.0 + energy[0].sum()))


@given(poses, poses)
@settings(max_examples=200, deadline=None)
def test_consumed_is_never_less_than_net_nor_than_the_rise_of_potential_energy(a, b):
    energy = edge_energy(MODEL, a, b)
    rise = potential_energy_j(BODY, b) - potential_energy_j(BODY, a)
    rounding = 2e-3 * (1.0 + energy[[0, 2]].sum())
    assert (energy[[0, 2]] >= energy[[1, 3]] - 1e-12).all()
    assert (energy[[0, 2]] >= 0.0).all()
    assert energy[0].sum() >= rise - rounding
    assert energy[1].sum() >= rise - rounding  # what is lost is never negative
    assert energy[1].sum() + energy[3].sum() >= 0.0  # no perpetual motion there and back
    lost = edge_costs(MODEL, NET, a, b)
    assert lost == pytest.approx((energy[1].sum() - rise, energy[3].sum() + rise), abs=rounding)


def test_letting_an_arm_down_gives_energy_back_and_lifting_it_costs():
    up, down = np.array([1.5, 0.0, 0.0]), np.array([0.0, 0.0, 0.0])
    energy = edge_energy(MODEL._replace(edge_s=3.0), up, down)
    assert energy[1].sum() < 0.0 < energy[3].sum()
    assert energy[0].sum() >= 0.0


@given(poses, poses)
@settings(max_examples=50, deadline=None)
def test_back_is_the_edge_told_from_the_other_end(a, b):
    forth, back = edge_energy(MODEL, a, b), edge_energy(MODEL, b, a)
    assert forth[[0, 1]] == pytest.approx(back[[2, 3]], rel=1e-9, abs=1e-9)
    for kind in (CONSUMED, NET, TIME, TRAVEL):
        assert edge_costs(MODEL, kind, a, b) == pytest.approx(edge_costs(MODEL, kind, b, a)[::-1], rel=1e-9, abs=1e-9)


@given(poses, poses)
@settings(max_examples=50, deadline=None)
def test_an_edge_takes_the_joints_to_a_limit_and_not_beyond(a, b):
    duration = edge_duration_s(MODEL, a, b)
    if duration == 0.0:
        assert (a == b).all()
        return
    x = np.linspace(0.0, 1.0, 20_001)
    speed = (30 * x**2 * (1 - x) ** 2).max() * np.abs(b - a) / duration / MODEL.speed_rad_s
    bend = np.abs(60 * x * (1 - x) * (1 - 2 * x)).max() * np.abs(b - a) / duration**2 / MODEL.acceleration_rad_s2
    assert max(speed.max(), bend.max()) == pytest.approx(1.0, abs=1e-6)


def test_a_stepper_draws_its_holding_current_whatever_it_does():
    """17HS4401 at 1.2 A: 1.5 ohm x 1.44 A^2 = 2.16 W a motor (MotionKing's data), so energy is nearly time."""
    model = EdgeModel.stepper(BODY, SCENE, edge_s=2.0)
    motor = MotorSpec()
    hold = 3 * 2.0 * motor.resistance_ohm * motor.current_a**2
    still = np.array([0.3, -0.2, 0.1])
    energy = edge_energy(model, still, still + 1e-9)
    assert energy.sum(axis=1) == pytest.approx(hold, rel=1e-3)
    up = edge_energy(model, np.zeros(3), np.array([0.5, 0.0, 0.0]))
    rise = potential_energy_j(BODY, np.array([0.5, 0.0, 0.0])) - potential_energy_j(BODY, np.zeros(3))
    assert up[0].sum() >= hold + rise


def test_equal_constants_are_what_makes_net_energy_a_matter_of_heights():
    """With Table 7's Ke = 2 Kt the back-EMF takes twice the work of lifting; heat and friction are the same."""
    other = EdgeModel.dc(BODY, MOTORS._replace(back_emf_v_s=2.0 * MOTORS.back_emf_v_s), SCENE, edge_s=20.0)
    a, b = np.array([-1.2, 0.0, 0.0]), np.array([1.2, 0.0, 0.0])
    rise = potential_energy_j(BODY, b) - potential_energy_j(BODY, a)
    same = MODEL._replace(edge_s=20.0)
    more = edge_energy(other, a, b)[1].sum() - edge_energy(same, a, b)[1].sum()
    drag = 1.2 * 1.2 * 4.0 * (10.0 / 7.0) / 20.0 * float(MOTORS.viscous_nm_s[0])  # b way^2 / T, integral of s'^2 = 10/7
    assert more == pytest.approx(rise + drag, rel=1e-3)


def test_the_scene_s_motors_are_in_si_units():
    spec = replace(DcMotorSpec.usual(3), inductance_h=(1e-3,) * 3)
    motors = DcMotors.from_spec(spec, np.zeros(3))
    assert motors.inductance_h == pytest.approx(1e-3)
    assert motors.rotor_inertia_kg_m2 == pytest.approx(33.0 * 1e-7)
    assert (motors.back_emf_v_s == motors.torque_constant_nm_a).all()
