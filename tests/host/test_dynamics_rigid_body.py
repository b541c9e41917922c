"""The equation of motion against Lagrange's equations of independent energies, textbook forms, and conservation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from planarm.dynamics.rigid_body import (
    RigidBody,
    christoffel,
    gravity_torques,
    inertia_matrix,
    inverse_dynamics,
    kinetic_energy_j,
    path_torques,
    potential_energy_j,
)


class Masses:
    """An arm of links with masses, in plain numpy: energies from positions and their differences by angle."""

    def __init__(self, rng, count):
        self.lengths = rng.uniform(0.1, 0.6, count)
        self.masses = rng.uniform(0.1, 2.0, count)
        self.centres = self.lengths * rng.uniform(0.1, 0.9, count)
        self.inertias = rng.uniform(0.001, 0.05, count)
        self.ends = rng.uniform(0.0, 0.5, count)
        self.gravity = (float(rng.uniform(-1.0, 1.0)), -9.8)

    def body(self):
        return RigidBody.from_links(self.lengths, self.masses, self.centres, self.inertias, self.ends, self.gravity)

    def points(self, q):
        """Each mass and its place: the links' centres, then their ends."""
        at, heading, centres, ends = np.zeros(2), 0.0, [], []
        for k in range(len(q)):
            heading = heading + q[k]
            along = np.array([np.cos(heading), np.sin(heading)])
            centres.append(at + self.centres[k] * along)
            at = at + self.lengths[k] * along
            ends.append(at)
        return np.concatenate([self.masses, self.ends]), np.array(centres + ends)

    def kinetic(self, q, qd):
        h = 1e-6
        masses, ahead = self.points(q + h * qd)
        _, behind = self.points(q - h * qd)
        velocities = (ahead - behind) / (2.0 * h)
        return 0.5 * masses @ (velocities**2).sum(axis=1) + 0.5 * self.inertias @ np.cumsum(qd) ** 2

    def potential(self, q):
        masses, places = self.points(q)
        return -float(masses @ (places @ np.array(self.gravity)))


def gradient(f, x, h=1e-4):
    steps = h * np.eye(len(x))
    # Fourth order, so that a large h keeps the differences of differences exact to 1e-8.
    return np.array([(8 * (f(x + e) - f(x - e)) - (f(x + 2 * e) - f(x - 2 * e))) / (12 * h) for e in steps])


def lagrange(arm, q, qd, qdd):
    """d/dt dT/dqd - dT/dq + dV/dq; dT/dqd is linear in qd, so its differences are exact at any step."""

    def momentum(at, speed):
        return gradient(lambda v: arm.kinetic(at, v), speed, 1.0)

    h = 1e-3
    along = (
        8 * (momentum(q + h * qd, qd) - momentum(q - h * qd, qd))
        - (momentum(q + 2 * h * qd, qd) - momentum(q - 2 * h * qd, qd))
    ) / (12 * h)
    return (
        along + momentum(q, qdd) - gradient(lambda at: arm.kinetic(at, qd), q, 1e-3) + gradient(arm.potential, q, 1e-3)
    )


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 6))
def test_torques_are_those_of_lagrange_s_equations(seed, count):
    rng = np.random.default_rng(seed)
    arm = Masses(rng, count)
    q, qd, qdd = rng.uniform(-3.0, 3.0, (3, count))
    expected = lagrange(arm, q, qd, qdd)
    assert inverse_dynamics(arm.body(), q, qd, qdd) == pytest.approx(expected, rel=1e-5, abs=1e-5)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 6))
def test_the_parts_make_the_whole(seed, count):
    rng = np.random.default_rng(seed)
    body = Masses(rng, count).body()
    q, qd, qdd = rng.uniform(-3.0, 3.0, (3, count))
    d, c, g = inertia_matrix(body, q), christoffel(body, q), gravity_torques(body, q)
    assert d == pytest.approx(d.T)
    assert (np.linalg.eigvalsh(d) > 0.0).all()
    assert c == pytest.approx(c.transpose(0, 2, 1))
    assert d @ qdd + qd @ c @ qd + g == pytest.approx(inverse_dynamics(body, q, qd, qdd))
    # Christoffel symbols of the first kind: dD_ij/dq_k + dD_ik/dq_j - dD_jk/dq_i, halved.
    h = 1e-6
    slope = np.stack(
        [(inertia_matrix(body, q + h * e) - inertia_matrix(body, q - h * e)) / (2 * h) for e in np.eye(count)], axis=2
    )
    symbols = 0.5 * (slope + slope.transpose(0, 2, 1) - slope.transpose(2, 0, 1))
    assert c == pytest.approx(symbols, abs=1e-7)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 6))
def test_energies_are_those_of_the_masses(seed, count):
    rng = np.random.default_rng(seed)
    arm = Masses(rng, count)
    q, qd = rng.uniform(-3.0, 3.0, (2, count))
    assert kinetic_energy_j(arm.body(), q, qd) == pytest.approx(arm.kinetic(q, qd), rel=1e-7)
    assert potential_energy_j(arm.body(), q) == pytest.approx(arm.potential(q), abs=1e-12)


def test_two_links_are_the_textbook_s():
    # Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, planar elbow manipulator: d11, d12, d22, h, phi1, phi2.
    m1, m2, l1, c1, c2, i1, i2, g = 1.3, 0.7, 0.3, 0.14, 0.11, 0.02, 0.01, 9.81
    body = RigidBody.from_links([l1, 0.2], [m1, m2], [c1, c2], [i1, i2], gravity_m_s2=(0.0, -g))
    q = np.array([0.4, -1.1])
    d11 = m1 * c1**2 + m2 * (l1**2 + c2**2 + 2 * l1 * c2 * np.cos(q[1])) + i1 + i2
    d12 = m2 * (c2**2 + l1 * c2 * np.cos(q[1])) + i2
    d22 = m2 * c2**2 + i2
    h = -m2 * l1 * c2 * np.sin(q[1])
    assert inertia_matrix(body, q) == pytest.approx(np.array([[d11, d12], [d12, d22]]))
    assert christoffel(body, q) == pytest.approx(np.array([[[0.0, h], [h, h]], [[-h, 0.0], [0.0, 0.0]]]))
    phi1 = (m1 * c1 + m2 * l1) * g * np.cos(q[0]) + m2 * c2 * g * np.cos(q.sum())
    assert gravity_torques(body, q) == pytest.approx([phi1, m2 * c2 * g * np.cos(q.sum())])


def test_a_free_fall_keeps_its_energy():
    body = Masses(np.random.default_rng(5), 3).body()

    def fall(_t, state):
        q, qd = state[:3], state[3:]
        drift = inverse_dynamics(body, q, qd, np.zeros(3))
        return np.concatenate([qd, -np.linalg.solve(inertia_matrix(body, q), drift)])

    path = solve_ivp(fall, (0.0, 2.0), [0.3, -0.5, 1.0, 0.0, 1.0, 0.0], "DOP853", rtol=1e-11, atol=1e-12)
    energies = [kinetic_energy_j(body, s[:3], s[3:]) + potential_energy_j(body, s[:3]) for s in path.y.T]
    assert np.ptp(energies) < 1e-8
    assert np.ptp([kinetic_energy_j(body, s[:3], s[3:]) for s in path.y.T]) > 1.0


def test_a_path_s_torques_are_linear_in_its_acceleration_and_squared_rate():
    rng = np.random.default_rng(1)
    body = Masses(rng, 3).body()
    q, dq, ddq = rng.uniform(-2.0, 2.0, (3, 4, 3))
    a, b, g = path_torques(body, q, dq, ddq)
    for i, (u, rate) in enumerate([(0.0, 0.0), (1.3, 0.0), (0.0, 2.0), (-0.7, 1.1)]):
        exact = inverse_dynamics(body, q[i], dq[i] * rate, dq[i] * u + ddq[i] * rate**2)
        assert a[i] * u + b[i] * rate**2 + g[i] == pytest.approx(exact)
