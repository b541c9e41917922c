"""What an edge between two configurations costs: inverse dynamics on a quintic from rest to rest (paper A, section 2).

The arm goes straight in joint space from a to b, q = a + (b - a) s(t / T) with s(x) = 10 x^3 - 15 x^4 + 6 x^5, in the
shortest T that the joints' speeds and accelerations allow, or in a given one. Joint j's motor then gives the torque
tau_j (arm, rotors and friction) and draws the power

    p_j = hold_j + loss_j tau_j^2 + ratio_j tau_j q_j'

For a DC motor loss = R / (N Kt)^2, the heat of the current i = tau / (N Kt), and ratio = Ke / Kt, which is 1 in SI
units; hold is 0. A stepper's driver keeps the current whatever the load: hold = R I^2, loss = 0. Consumed energy is the
sum over the joints of the integrals of max(p_j, 0): nothing comes back. Net energy is that of the integrals of p_j: a
motor that is driven feeds back, and the energy can be negative. With ratio 1 it is the difference of potential energy,
plus what is lost, hold and loss and friction, which is never negative: so net costs are searched with the potential
subtracted. The energy in the windings, L i^2 / 2, is left out here (`dc_motor` has it).

Forth and back along the same line differ in the sign of speed and friction only, so both are told at once.
"""

from math import sqrt
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from planarm.dynamics.dc_motor import DcMotors
from planarm.dynamics.rigid_body import RigidBody, potential_energy_j
from planarm.scene import Scene
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]

CONSUMED, NET, TIME, TRAVEL = 0, 1, 2, 3
"""What an edge's cost is: joules consumed, joules lost (net less potential), seconds, or radians of joint travel."""

PEAK_SPEED = 15.0 / 8.0
PEAK_ACCELERATION = 10.0 / sqrt(3.0)
"""Of the quintic, in shares of the way over T and T^2."""


SHORTEST_S = 1e-9
"""An edge that takes less goes nowhere and costs nothing: its ends differ by rounding."""


def _quadrature(panels: int, points: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Return s, s', s'' of the quintic over [0, 1] and the weights of Gauss' rule on each of the panels."""
    x, w = np.polynomial.legendre.leggauss(points)
    t = np.concatenate([(k + 0.5 + 0.5 * x) / panels for k in range(panels)])
    s = t**3 * (10.0 + t * (-15.0 + 6.0 * t))
    sd = 30.0 * t**2 * (1.0 - t) ** 2
    sdd = 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)
    return s, sd, sdd, np.tile(0.5 * w / panels, panels)


_S, _SD, _SDD, _WEIGHT = _quadrature(4, 4)


class EdgeModel(NamedTuple):
    """An arm and its motors, for the cost of edges; arrays of shape (n,), SI units at the joints."""

    body: RigidBody
    inertia_kg_m2: Floats
    """Of the rotors behind their gears."""
    viscous_nm_s: Floats
    hold_w: Floats
    loss_w_nm2: Floats
    ratio: Floats
    speed_rad_s: Floats
    """What the joints may reach."""
    acceleration_rad_s2: Floats
    edge_s: float
    """Duration of every edge; 0 for the shortest that the joints allow."""

    @classmethod
    def dc(cls, body: RigidBody, motors: DcMotors, scene: Scene, edge_s: float = 0.0) -> Self:
        """Return the model of an arm with DC motors, within the limits of the scene's joints."""
        force = motors.gear_ratio * motors.torque_constant_nm_a
        return cls(
            body=body,
            inertia_kg_m2=motors.reflected_kg_m2,
            viscous_nm_s=motors.viscous_nm_s,
            hold_w=np.zeros(len(force)),
            loss_w_nm2=motors.resistance_ohm / force**2,
            ratio=motors.back_emf_v_s / motors.torque_constant_nm_a,
            speed_rad_s=np.array([joint.max_speed_rad_s for joint in scene.joints]),
            acceleration_rad_s2=np.array([joint.max_acceleration_rad_s2 for joint in scene.joints]),
            edge_s=edge_s,
        )

    @classmethod
    def stepper(cls, body: RigidBody, scene: Scene, edge_s: float = 0.0) -> Self:
        """Return the model of an arm with the scene's stepper motors: both phases carry I cos and I sin, so R I^2."""
        motors = [joint.motor for joint in scene.joints]
        rotors = [joint.motor.rotor_inertia_kg_m2 * joint.gear_ratio**2 for joint in scene.joints]
        count = len(motors)
        return cls(
            body=body,
            inertia_kg_m2=np.array(rotors),
            viscous_nm_s=np.array(scene.mechanics.viscous_friction_nm_s),
            hold_w=np.array([motor.resistance_ohm * motor.current_a**2 for motor in motors]),
            loss_w_nm2=np.zeros(count),
            ratio=np.ones(count),
            speed_rad_s=np.array([joint.max_speed_rad_s for joint in scene.joints]),
            acceleration_rad_s2=np.array([joint.max_acceleration_rad_s2 for joint in scene.joints]),
            edge_s=edge_s,
        )


@kernel
def edge_duration_s(model: EdgeModel, a_rad: Floats, b_rad: Floats) -> float:
    """Return how long the quintic from a to b takes."""
    if model.edge_s > 0.0:
        return model.edge_s
    longest = 0.0
    for j in range(a_rad.shape[0]):
        way = abs(b_rad[j] - a_rad[j])
        longest = max(
            longest,
            PEAK_SPEED * way / model.speed_rad_s[j],
            sqrt(PEAK_ACCELERATION * way / model.acceleration_rad_s2[j]),
        )
    return longest


@kernel
def edge_energy(model: EdgeModel, a_rad: Floats, b_rad: Floats) -> NDArray[np.float64]:
    """Return the energies of an edge in joules, shape (4, n): consumed and net from a to b, then from b to a."""
    n = a_rad.shape[0]
    out = np.zeros((4, n))
    duration = edge_duration_s(model, a_rad, b_rad)
    if duration < SHORTEST_S:
        return out
    products, moments = model.body.products_kg_m2, model.body.moments_kg_m
    gravity_x, gravity_y = model.body.gravity_m_s2[0], model.body.gravity_m_s2[1]
    cosine, sine, turn = np.empty(n), np.empty(n), np.empty(n)
    for p in range(_S.shape[0]):
        rate, bend, weight = _SD[p] / duration, _SDD[p] / (duration * duration), _WEIGHT[p] * duration
        phi, dphi = 0.0, 0.0
        for j in range(n):
            way = b_rad[j] - a_rad[j]
            phi, dphi = phi + a_rad[j] + _S[p] * way, dphi + way
            cosine[j], sine[j], turn[j] = np.cos(phi), np.sin(phi), dphi
        torque = 0.0
        for j in range(n - 1, -1, -1):
            torque += moments[j] * (gravity_x * sine[j] - gravity_y * cosine[j])
            for k in range(n):
                apart_cosine = cosine[j] * cosine[k] + sine[j] * sine[k]
                apart_sine = sine[j] * cosine[k] - cosine[j] * sine[k]
                torque += products[j, k] * turn[k] * (apart_cosine * bend + apart_sine * turn[k] * rate * rate)
            way = b_rad[j] - a_rad[j]
            steady, speed = torque + model.inertia_kg_m2[j] * way * bend, way * rate
            drag = model.viscous_nm_s[j] * speed
            for back in range(2):
                sign = 1.0 - 2.0 * back
                tau = steady + sign * drag
                power = model.hold_w[j] + model.loss_w_nm2[j] * tau * tau + sign * model.ratio[j] * tau * speed
                out[2 * back, j] += weight * max(power, 0.0)
                out[2 * back + 1, j] += weight * power
    return out


@kernel
def edge_costs(model: EdgeModel, kind: int, a_rad: Floats, b_rad: Floats) -> tuple[float, float]:
    """Return what the edge costs from a to b and from b to a, in the kind's unit; never negative.

    NET is told less the difference of potential energy: what is lost.
    """
    if kind == TRAVEL:
        apart = 0.0
        for j in range(a_rad.shape[0]):
            apart += (b_rad[j] - a_rad[j]) ** 2
        return sqrt(apart), sqrt(apart)
    if kind == TIME:
        duration = edge_duration_s(model, a_rad, b_rad)
        return duration, duration
    energy = edge_energy(model, a_rad, b_rad)
    first = 1 if kind == NET else 0
    forth, back = 0.0, 0.0
    for j in range(a_rad.shape[0]):
        forth += energy[first, j]
        back += energy[first + 2, j]
    if kind == NET:
        rise = potential_energy_j(model.body, b_rad) - potential_energy_j(model.body, a_rad)
        return max(forth - rise, 0.0), max(back + rise, 0.0)
    return forth, back
