"""DC motors on the joints, and the motion of arm and motors together (paper A, eq. 2, corrected).

Behind its gear N the motor of joint j turns with N q_j', carries the current i_j and is fed with the voltage V_j:

    (D(q) + diag(N^2 J)) q'' = N Kt i - diag(N^2 B + b) q' - c(q, q') - G(q)
    L i' = V - R i - N Ke q'

with rotor inertia J, the rotor's viscous friction B, the joint's own b, and D, c, G of `rigid_body`. The paper prints
the damping with the wrong sign, leaves gravity to eq. 3 and divides by J + D as if it were a number (docs/errata.md).
The voltage is V = Kp (r - q) + Kd (r' - q'), r being the reference, a quintic from rest to rest; with feed-forward the
voltage that the reference itself needs is added.

Everything is integrated by the classical Runge-Kutta method of fourth order, as in the paper, and the energies with it:
the power that joint j draws is V i; what it consumes is the integral of max(V i, 0), what it takes net that of V i.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.dynamics.rigid_body import RigidBody, inertia_matrix, inverse_dynamics
from planarm.scene import DcMotorSpec, Scene
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]

DERIVATIVE_S = 1e-5
"""The feed-forward's rate of current is a difference over this time: its error, of second order, is below 1e-8."""


class DcMotors(NamedTuple):
    """The motors of an arm as kernels read them, each array of shape (n,), SI units, at the motor's shaft."""

    resistance_ohm: Floats
    inductance_h: Floats
    torque_constant_nm_a: Floats
    back_emf_v_s: Floats
    """Equal to the torque constant in SI units for an ideal motor; a scene knows one of them only."""
    rotor_inertia_kg_m2: Floats
    rotor_viscous_nm_s: Floats
    gear_ratio: Floats
    joint_viscous_nm_s: Floats
    """The joint's own friction, beside the motor's."""

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """Return the motors that a scene describes."""
        return cls.from_spec(motor_spec(scene), scene.mechanics.viscous_friction_nm_s)

    @classmethod
    def from_spec(cls, spec: DcMotorSpec, joint_viscous_nm_s: ArrayLike) -> Self:
        """Return the motors of a table [dc_motors], with the joints' own friction of shape (n,)."""
        constant = np.array(spec.torque_constant_nm_a)
        return cls(
            resistance_ohm=np.array(spec.resistance_ohm),
            inductance_h=np.array(spec.inductance_h),
            torque_constant_nm_a=constant,
            back_emf_v_s=constant,
            rotor_inertia_kg_m2=np.array(spec.rotor_inertia_kg_m2),
            rotor_viscous_nm_s=np.array(spec.rotor_viscous_nm_s),
            gear_ratio=np.array(spec.gear_ratio),
            joint_viscous_nm_s=np.asarray(joint_viscous_nm_s, np.float64),
        )

    @property
    def reflected_kg_m2(self) -> Floats:
        """The rotors' inertia behind their gears, shape (n,)."""
        return self.rotor_inertia_kg_m2 * self.gear_ratio**2

    @property
    def viscous_nm_s(self) -> Floats:
        """All friction of each joint behind its gear, shape (n,)."""
        return self.rotor_viscous_nm_s * self.gear_ratio**2 + self.joint_viscous_nm_s


def motor_spec(scene: Scene) -> DcMotorSpec:
    """Return the scene's table [dc_motors], or what a scene without one means."""
    return scene.dc_motors or DcMotorSpec.usual(len(scene.arm.link_lengths_cm))


class Control(NamedTuple):
    """What sets the voltages."""

    p_gain_v_rad: Floats
    """Volts for a radian of error of the joint, shape (n,)."""
    d_gain_v_s_rad: Floats
    feed_forward: bool
    """True when the voltage that the reference itself needs is added."""

    @classmethod
    def of(cls, spec: DcMotorSpec, *, feed_forward: bool = True) -> Self:
        """Return the control that a table [dc_motors] describes."""
        return cls(np.array(spec.p_gain_v_rad), np.array(spec.d_gain_v_s_rad), feed_forward)


class Move(NamedTuple):
    """A quintic from rest to rest along the straight line between two configurations."""

    start_rad: Floats
    end_rad: Floats
    duration_s: float


class Run(NamedTuple):
    """An integrated motion, m steps of n joints."""

    t_s: Floats
    """Shape (m + 1,)."""
    states: Floats
    """Angles, speeds and currents, then consumed and net energy since the start in joules; shape (m + 1, 5 n)."""

    def part(self, index: int) -> Floats:
        """Return one of angles (0), speeds, currents, consumed and net energies (4), shape (m + 1, n)."""
        joints = self.states.shape[1] // 5
        return self.states[:, index * joints : (index + 1) * joints]


def resting_state(body: RigidBody, motors: DcMotors, q_rad: Floats) -> Floats:
    """Return the state of an arm that the motors hold at rest, with no energy spent yet, shape (5 n,)."""
    still = np.zeros(len(q_rad))
    current_a = inverse_dynamics(body, q_rad, still, still) / (motors.gear_ratio * motors.torque_constant_nm_a)
    return np.concatenate([q_rad, still, current_a, still, still])


def run_moves(
    body: RigidBody, motors: DcMotors, control: Control, moves: list[Move], step_s: float, settle_s: float = 0.0
) -> Run:
    """Integrate moves one after the other, from rest; each is cut into whole steps of at most `step_s`.

    Args:
        body: the arm.
        motors: its motors.
        control: what sets the voltages.
        moves: at least one, each beginning where the one before ends.
        step_s: largest step; above about 2.8 L / R the method is unstable.
        settle_s: how long the last configuration is held afterwards.
    """
    state = resting_state(body, motors, moves[0].start_rad)
    if settle_s > 0.0:
        moves = [*moves, Move(moves[-1].end_rad, moves[-1].end_rad, settle_s)]
    times, states = [np.zeros(1)], [state[None]]
    for move in moves:
        steps = max(1, int(np.ceil(move.duration_s / step_s - 1e-9)))
        made = integrate(body, motors, control, move, state, steps)
        times.append(times[-1][-1] + move.duration_s * np.arange(1, steps + 1) / steps)
        states.append(made[1:])
        state = made[-1]
    return Run(np.concatenate(times), np.concatenate(states))


@kernel
def integrate(
    body: RigidBody, motors: DcMotors, control: Control, move: Move, state: Floats, steps: int
) -> NDArray[np.float64]:
    """Return the states of one move, shape (steps + 1, 5 n), by the Runge-Kutta method of fourth order."""
    out = np.empty((steps + 1, state.shape[0]))
    out[0] = state
    h = move.duration_s / steps
    for k in range(steps):
        t, y = k * h, out[k]
        k1 = derivative(body, motors, control, move, t, y)
        k2 = derivative(body, motors, control, move, t + 0.5 * h, y + 0.5 * h * k1)
        k3 = derivative(body, motors, control, move, t + 0.5 * h, y + 0.5 * h * k2)
        k4 = derivative(body, motors, control, move, t + h, y + h * k3)
        out[k + 1] = y + (h / 6.0) * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return out


@kernel
def derivative(
    body: RigidBody, motors: DcMotors, control: Control, move: Move, t_s: float, state: Floats
) -> NDArray[np.float64]:
    """Return the state's rate of change at a time since the move's start, shape (5 n,): the module's equations."""
    n = state.shape[0] // 5
    q, qd, current = state[:n], state[n : 2 * n], state[2 * n : 3 * n]
    gear, constant = motors.gear_ratio, motors.torque_constant_nm_a
    viscous = motors.rotor_viscous_nm_s * gear * gear + motors.joint_viscous_nm_s
    left = inertia_matrix(body, q)
    for j in range(n):
        left[j, j] += motors.rotor_inertia_kg_m2[j] * gear[j] * gear[j]
    force = gear * constant * current - viscous * qd - inverse_dynamics(body, q, qd, np.zeros(n))
    solve_in_place(left, force)
    r, rd, _ = reference(move, t_s)
    volts = control.p_gain_v_rad * (r - q) + control.d_gain_v_s_rad * (rd - qd)
    if control.feed_forward:
        volts = volts + needed_volts(body, motors, move, t_s)
    out = np.empty(5 * n)
    out[:n], out[n : 2 * n] = qd, force
    for j in range(n):
        back = motors.back_emf_v_s[j] * gear[j] * qd[j]
        out[2 * n + j] = (volts[j] - motors.resistance_ohm[j] * current[j] - back) / motors.inductance_h[j]
        power = volts[j] * current[j]
        out[3 * n + j], out[4 * n + j] = max(power, 0.0), power
    return out


@kernel
def needed_volts(body: RigidBody, motors: DcMotors, move: Move, t_s: float) -> NDArray[np.float64]:
    """Return the voltages, shape (n,), with which the reference is followed exactly."""
    before = needed_current(body, motors, move, t_s - DERIVATIVE_S)
    after = needed_current(body, motors, move, t_s + DERIVATIVE_S)
    _, rd, _ = reference(move, t_s)
    now = needed_current(body, motors, move, t_s)
    rate = (after - before) / (2.0 * DERIVATIVE_S)
    return motors.resistance_ohm * now + motors.inductance_h * rate + motors.back_emf_v_s * motors.gear_ratio * rd


@kernel
def needed_current(body: RigidBody, motors: DcMotors, move: Move, t_s: float) -> NDArray[np.float64]:
    """Return the currents, shape (n,), with which the reference is followed exactly."""
    r, rd, rdd = reference(move, t_s)
    gear = motors.gear_ratio
    viscous = motors.rotor_viscous_nm_s * gear * gear + motors.joint_viscous_nm_s
    torque = inverse_dynamics(body, r, rd, rdd) + motors.rotor_inertia_kg_m2 * gear * gear * rdd + viscous * rd
    return torque / (gear * motors.torque_constant_nm_a)


@kernel
def reference(move: Move, t_s: float) -> tuple[Floats, Floats, Floats]:
    """Return angles, speeds and accelerations of a move at a time; outside of it the polynomial's, not those of rest.

    So the difference that makes the rate of current does not see the jump of the jerk at the move's ends.
    """
    share = t_s / move.duration_s
    way = move.end_rad - move.start_rad
    s = share * share * share * (10.0 + share * (-15.0 + 6.0 * share))
    sd = 30.0 * share * share * (1.0 - share) * (1.0 - share) / move.duration_s
    sdd = 60.0 * share * (1.0 - share) * (1.0 - 2.0 * share) / (move.duration_s * move.duration_s)
    return move.start_rad + s * way, sd * way, sdd * way


@kernel
def solve_in_place(matrix: Floats, right: Floats) -> None:
    """Solve a small symmetric positive definite system by Cholesky's method; `right` becomes the solution."""
    n = right.shape[0]
    for j in range(n):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] * matrix[j, k]
        matrix[j, j] = np.sqrt(matrix[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for i in range(n):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
