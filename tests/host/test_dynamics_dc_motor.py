"""Arm and motors together: SciPy's integrator of eighth order, energy balance, and the paper's motor as printed."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from planarm.dynamics.dc_motor import (
    Control,
    DcMotors,
    Move,
    derivative,
    integrate,
    needed_current,
    reference,
    resting_state,
    run_moves,
)
from planarm.dynamics.rigid_body import RigidBody, gravity_torques, inertia_matrix, inverse_dynamics
from planarm.scene import DcMotorSpec

GRAVITY = (0.0, -9.80665)


def arm(links, gravity=GRAVITY):
    """Links of 0.3 m and 0.4 kg, thinner outwards."""
    lengths = np.full(links, 0.9 / links)
    masses = np.linspace(1.2, 0.6, links) / links
    return RigidBody.from_links(lengths, masses, 0.5 * lengths, masses * lengths**2 / 12.0, 0.0, gravity)


def usual(links):
    spec = DcMotorSpec.usual(links)
    return DcMotors.from_spec(spec, np.full(links, 0.05)), Control.of(spec), spec


def moves_of(links, seed, count=2):
    rng = np.random.default_rng(seed)
    poses = rng.uniform(-1.0, 1.0, (count + 1, links))
    return [Move(a, b, float(rng.uniform(0.6, 1.2))) for a, b in pairwise(poses)]


@pytest.mark.parametrize(("links", "feed_forward"), [(3, True), (3, False), (4, True), (7, False)])
def test_runge_kutta_agrees_with_scipy_s_integrator_of_eighth_order(links, feed_forward):
    """Angles, speeds, currents and both energies within 1e-6, relative to the largest of each kind."""
    body, (motors, control, spec) = arm(links), usual(links)
    control = Control.of(spec, feed_forward=feed_forward)
    move = moves_of(links, links)[0]
    ours = run_moves(body, motors, control, [move], 5e-5)
    at_s = np.linspace(0.0, move.duration_s, 9)[1:]
    theirs = solve_ivp(
        lambda t, y: derivative(body, motors, control, move, t, y),
        (0.0, move.duration_s),
        resting_state(body, motors, move.start_rad),
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        t_eval=at_s,
        max_step=2e-3,
    )
    indices = np.round(at_s / move.duration_s * (len(ours.t_s) - 1)).astype(int)
    same = np.isclose(ours.t_s[indices], at_s, rtol=0, atol=1e-12)
    assert same.any()
    for part in range(5):
        rows = slice(part * links, (part + 1) * links)
        mine, other = ours.states[indices[same], rows], theirs.y.T[same, rows]
        assert np.abs(mine - other).max() <= 1e-6 * max(1.0, np.abs(other).max())


@pytest.mark.parametrize("links", [3, 7])
def test_halving_the_step_changes_the_energy_by_less_than_a_thousandth(links):
    body, (motors, control, _) = arm(links), usual(links)
    moves = moves_of(links, 10 + links)
    coarse, fine = (run_moves(body, motors, control, moves, step).states[-1] for step in (2e-4, 1e-4))
    for part in (3, 4):
        rows = slice(part * links, (part + 1) * links)
        assert coarse[rows].sum() == pytest.approx(fine[rows].sum(), rel=1e-3)


def test_the_motion_is_that_of_the_equation_written_out_for_one_link():
    """One link by hand: (m l^2 / 3 + N^2 J) q'' = N Kt i - b q' - m g l / 2 cos q, L i' = V - R i - N Ke q'."""
    length, mass = 0.4, 0.8
    body = RigidBody.from_links([length], [mass], [0.5 * length], [mass * length**2 / 12.0], 0.0, GRAVITY)
    motors = DcMotors(*(np.array([x]) for x in (0.5, 1e-3, 0.03, 0.04, 4e-6, 2e-6, 60.0, 0.1)))
    control = Control(np.array([9.0]), np.array([1.5]), False)
    move = Move(np.array([0.2]), np.array([1.1]), 0.8)
    state = np.array([0.4, -0.7, 1.3, 5.0, 4.0])
    t = 0.3
    x = t / 0.8
    r, rd = 0.2 + 0.9 * (10 * x**3 - 15 * x**4 + 6 * x**5), 0.9 * 30 * x**2 * (1 - x) ** 2 / 0.8
    volts = 9.0 * (r - 0.4) + 1.5 * (rd + 0.7)
    inertia = mass * length**2 / 3.0 + 60.0**2 * 4e-6
    torque = 60 * 0.03 * 1.3 - (60**2 * 2e-6 + 0.1) * -0.7 - mass * 9.80665 * 0.5 * length * np.cos(0.4)
    power = volts * 1.3
    wanted = [-0.7, torque / inertia, (volts - 0.5 * 1.3 - 60 * 0.04 * -0.7) / 1e-3, max(power, 0.0), power]
    assert derivative(body, motors, control, move, t, state) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("links", [3, 4, 7])
def test_with_feed_forward_the_arm_follows_its_reference(links):
    """Which is independent of how the voltage was made: the currents are those of inverse dynamics."""
    body, (motors, control, _) = arm(links), usual(links)
    (move,) = moves_of(links, 20 + links, 1)
    made = run_moves(body, motors, control, [move], 1e-4)
    for k in range(0, len(made.t_s), 500):
        r, rd, rdd = reference(move, made.t_s[k])
        assert made.part(0)[k] == pytest.approx(r, abs=1e-6)
        assert made.part(1)[k] == pytest.approx(rd, abs=1e-5)
        torque = inverse_dynamics(body, r, rd, rdd) + motors.reflected_kg_m2 * rdd + motors.viscous_nm_s * rd
        current = torque / (motors.gear_ratio * motors.torque_constant_nm_a)
        assert needed_current(body, motors, move, made.t_s[k]) == pytest.approx(current, rel=1e-12)
        assert made.part(2)[k] == pytest.approx(current, abs=1e-4)


def test_what_the_motors_take_is_what_the_arm_gains_and_what_is_lost():
    """Net energy = kinetic + potential + winding energy gained, plus heat and friction; Kt = Ke."""
    body, (motors, _, spec) = arm(3), usual(3)
    made = run_moves(body, motors, Control.of(spec, feed_forward=False), moves_of(3, 5), 5e-5)
    q, qd, current, _, net = (made.part(k) for k in range(5))

    def stored(k):
        potential = -float(body.moments_kg_m @ np.sin(np.cumsum(q[k])) * GRAVITY[1])
        moving = inertia_matrix(body, q[k]) + np.diag(motors.reflected_kg_m2)
        return potential + 0.5 * qd[k] @ moving @ qd[k] + 0.5 * motors.inductance_h @ current[k] ** 2

    lost_w = (motors.resistance_ohm * current**2 + motors.viscous_nm_s * qd**2).sum(axis=1)
    lost = float(((lost_w[1:] + lost_w[:-1]) * np.diff(made.t_s)).sum() / 2.0)
    assert net[-1].sum() == pytest.approx(stored(-1) - stored(0) + lost, rel=1e-5)
    assert (np.diff(made.part(3), axis=0) >= 0.0).all()
    assert (made.part(3)[-1] >= net[-1] - 1e-9).all()


def as_printed(links):
    """Table 7 with the corrected signs of eq. 2; J and Kd are not printed and are 0, a gear is not mentioned."""
    one = np.ones(links)
    motors = DcMotors(one, 0.5 * one, 0.01 * one, 0.02 * one, 0 * one, 0.1 * one, one, 0 * one)
    return motors, Control(0.1 * one, 0 * one, False)


def test_the_motors_of_table_7_do_not_move_the_arm():
    """Three links of 0.3 m and 0.1 kg, half a turn asked of joint 1, ten seconds given."""
    lengths, masses = np.full(3, 0.3), np.full(3, 0.1)
    motors, control = as_printed(3)
    move = Move(np.zeros(3), np.array([np.pi, 0.0, 0.0]), 10.0)
    flat = RigidBody.from_links(lengths, masses, 0.5 * lengths, masses * 0.09 / 12.0)
    moved = run_moves(flat, motors, control, [move], 2e-3, settle_s=5.0).part(0)
    assert np.abs(moved[:, 0]).max() < 0.1 * np.pi
    assert moved[-1, 0] > 0.0

    upright = RigidBody.from_links(lengths, masses, 0.5 * lengths, masses * 0.09 / 12.0, 0.0, GRAVITY)
    let_go = Move(np.zeros(3), np.array([np.pi, 0.0, 0.0]), 30.0)
    state = resting_state(upright, motors, np.zeros(3))
    needed_v = gravity_torques(upright, np.zeros(3)) / 0.01
    assert needed_v[0] > 300 * 0.1 * np.pi  # the most that the printed gain gives at half a turn of error
    state[6:9] = 0.0
    fell = integrate(upright, motors, control, let_go, state, 15_000)
    assert np.cumsum(fell[-1, :3])[0] < -0.4 * np.pi  # asked to turn up and over, link 1 hangs down
