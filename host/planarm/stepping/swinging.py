"""A planned motion as a swinging arm: its inertia, its motors and their field, for `planarm.stepping.swing`.

The arm's inertia comes from the certificate's own torques (Newton and Euler) at unit accelerations, the field from the
expanded segments.
"""

from dataclasses import dataclass, replace
from math import ceil, sqrt
from typing import Self

import numpy as np

from planarm.scene import Scene
from planarm.stepping.check_motion import Planned
from planarm.stepping.check_torque import joint_torques_nm
from planarm.stepping.swing import (
    ANGLE,
    CURRENT_A,
    CURRENT_B,
    ENTRY,
    PHASES,
    RAD_PER_PHASE,
    ROTOR,
    STATE_ROWS,
    Field,
    Holds,
    Links,
    Rotors,
    Span,
    largest_lags,
)
from planarm.stepping.train import Floats, StepTrain, Ticks
from planarm_wire.messages import TICKS_HZ

NODE_S = 0.005
"""How long the arm's inertia counts as constant: at 2 rad/s a joint turns by a hundredth of a radian."""

SHARE_OF_A_SWING = 0.5
"""Length of a step by the fastest swing's 1 / omega: its frequency is then found 1 % too high."""
STEPS_PER_TURN = 24.0
"""Steps to an electrical turn of the field at its fastest."""
STIFFEST = 20.0
"""A gear counts as no stiffer than so many fields, so that steps need not be shorter: it takes a twentieth of a lag."""

GEAR_DAMPING = 0.05
"""Of critical, for the rotor on its gear."""

MOST_STRETCH = 5.0
"""Holds may make the motion so many times as long; beyond, the clock hardly changes, and nothing swings."""

CREEP_STEPS = 3.0
LEAST_CREEP_RAD_S = 1e-4
"""Speeds up to which dry friction grows: what it can take from a joint's speed in so many steps, or at least this."""

NO_HOLDS = Holds(*(np.ones(1) for _ in range(3)), *(np.empty(0) for _ in range(3)))


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """How far an arm has come.

    Attributes:
        state: of joints and rotors, shape (STATE_ROWS, n).
        path_s: path time.
        lags_rad: each rotor's largest lag on the way, in electrical radians, shape (n,).
        at_s: path time of each, shape (n,).
    """

    state: Floats
    path_s: float
    lags_rad: Floats
    at_s: Floats

    def worse(self, other: Self) -> Self:
        """Return this run with the larger of both's lags."""
        at_s = np.where(other.lags_rad > self.lags_rad, other.at_s, self.at_s)
        return replace(self, lags_rad=np.maximum(self.lags_rad, other.lags_rad), at_s=at_s)


@dataclass(frozen=True, slots=True, eq=False)
class Swinging:
    """A motion as `planarm.stepping.swing` follows it."""

    links: Links
    rotors: Rotors
    field: Field
    path_s: float
    step_s: float
    start: Run
    """Before the motion."""
    nodes: Ticks
    """Indices of the nodes' middles in the planned angles."""

    @classmethod
    def of(cls, planned: Planned, made: StepTrain, scene: Scene) -> Self:
        """Return the motion of a scene's arm that these steps make."""
        step_s = float(planned.t_s[1])
        stride = max(1, round(NODE_S / step_s))
        nodes = np.arange(stride // 2, len(planned.t_s) - 1, stride)
        mobility, turning, held = _arm_at(planned, nodes, scene)
        coupling, mechanics = np.array(scene.coupling), scene.mechanics
        rotors = _rotors(scene)
        field = _field_of(made, scene)
        largest = float(np.sqrt((mobility**2).sum(axis=(1, 2)).max()) * np.linalg.norm(coupling, 2) ** 2)
        step_s = _step_s(rotors, largest, made, scene)
        coulomb = np.array(mechanics.coulomb_friction_nm)
        links = Links(
            stride * float(planned.t_s[1]),
            mobility,
            turning,
            held,
            coulomb,
            np.array(mechanics.viscous_friction_nm_s),
            np.maximum(LEAST_CREEP_RAD_S, CREEP_STEPS * step_s * largest * coulomb),
            coupling,
            np.array([joint.zero_offset_rad for joint in scene.joints]),
        )
        rotors = rotors._replace(flux_ohm=rotors.flux_ohm / step_s)
        return cls(links, rotors, field, float(planned.t_s[-1]), step_s, _start(links, rotors, field), nodes)

    def follow(self, run: Run, to_s: float, holds: Holds = NO_HOLDS, after_s: float = 0.0) -> Run:
        """Go on from where a run is, up to a path time or until holds are over, and some time more.

        A run whose lag is beyond `LOST_RAD` ends there. Lags are those of this part.
        """
        after = ceil(after_s / self.step_s)
        longest_s = (to_s - run.path_s) * (MOST_STRETCH if len(holds.begin_s) else 1.0)
        span = Span(run.path_s, to_s, self.step_s, after, ceil(longest_s / self.step_s) + after + 1)
        state, lags_rad, at_s = run.state.copy(), np.zeros(len(run.lags_rad)), np.zeros(len(run.lags_rad))
        path_s = largest_lags(self.links, self.rotors, self.field, holds, span, state, lags_rad, at_s)
        if not np.isfinite(state).all():
            lags_rad[:] = np.nan  # no check holds with that
        return Run(state, path_s, lags_rad, at_s)


def _arm_at(planned: Planned, nodes: Ticks, scene: Scene) -> tuple[Floats, Floats, Floats]:
    """Return inverse inertia, centrifugal torques and what holds the arm, at the nodes."""
    q_rad, speeds = planned.q_rad[nodes], planned.speeds_rad_s[nodes]
    still = np.zeros_like(q_rad)
    lengths, mechanics, joints = scene.arm.link_lengths_cm, scene.mechanics, q_rad.shape[1]
    held = joint_torques_nm(lengths, mechanics, q_rad, still, still)
    turning = joint_torques_nm(lengths, mechanics, q_rad, speeds, still) - held
    # All unit accelerations at once, one block of poses for each joint.
    unit = np.repeat(np.eye(joints), len(nodes), axis=0)
    poses, resting = np.tile(q_rad, (joints, 1)), np.zeros((joints * len(nodes), joints))
    inertia = joint_torques_nm(lengths, mechanics, poses, resting, unit) - np.tile(held, (joints, 1))
    matrices = inertia.reshape(joints, len(nodes), joints).transpose(1, 2, 0)
    return np.array(np.linalg.inv(matrices), np.float64), turning, held


def _rotors(scene: Scene) -> Rotors:
    """Return a scene's motors; `flux_ohm` is still their inductance."""
    motors = [joint.motor for joint in scene.joints]
    gears = np.array([(-1.0 if joint.reversed else 1.0) * joint.gear_ratio for joint in scene.joints])
    teeth = np.array([joint.steps_per_rev / 4.0 for joint in scene.joints])
    peak = np.array([motor.peak_torque_nm for motor in motors])
    inertia = np.array([motor.rotor_inertia_kg_m2 for motor in motors])
    detent = np.array([motor.detent_torque_nm for motor in motors])
    field = teeth * (peak + 4.0 * detent)
    stiffness = np.minimum(np.array(scene.mechanics.stiffness_nm_rad), STIFFEST * field * gears**2)
    return Rotors(
        gear=gears,
        stiffness_nm_rad=stiffness,
        gear_damping_nm_s=2.0 * GEAR_DAMPING * np.sqrt(stiffness * inertia * gears**2),
        half_play_rad=0.5 * np.array(scene.mechanics.backlash_rad),
        inertia_kg_m2=inertia,
        damping_nm_s=np.array([motor.rotor_damping_nm_s for motor in motors]),
        teeth=teeth,
        constant_nm_a=peak / np.array([motor.current_a for motor in motors]),
        detent_nm=detent,
        current_a=np.array([motor.current_a for motor in motors]),
        resistance_ohm=np.array([motor.resistance_ohm for motor in motors]),
        flux_ohm=np.array([motor.inductance_h for motor in motors]),
        supply_v=np.array([motor.supply_v for motor in motors]),
    )


def _field_of(made: StepTrain, scene: Scene) -> Field:
    """Return where the drivers put the field: micro-step 0 is a full step's place."""
    ticks, phases = [], []
    for steps, start, joint in zip(made.steps, made.start_usteps, scene.joints, strict=True):
        ticks.append(np.concatenate([[0], steps.ticks]))
        at = start + np.concatenate([[0], np.cumsum(steps.directions, dtype=np.int64)])
        phases.append(np.rint(at * (0.25 * PHASES / joint.microsteps)).astype(np.int64))
    first = np.cumsum([0, *(len(one) for one in ticks)])
    return Field(np.concatenate(ticks), np.concatenate(phases), first)


def _start(links: Links, rotors: Rotors, field: Field) -> Run:
    """Return the arm at rest: every rotor lags behind its field, and every gear is strained, by what holds the arm."""
    state = np.zeros((STATE_ROWS, len(rotors.gear)))
    phase_rad = field.phases[field.first[:-1]] * RAD_PER_PHASE
    geared_nm = np.linalg.solve(links.coupling.T, links.held_nm[0])
    share = geared_nm / rotors.gear / (rotors.constant_nm_a * rotors.current_a)
    strain = geared_nm / rotors.stiffness_nm_rad + np.sign(geared_nm) * rotors.half_play_rad
    state[ROTOR] = (phase_rad - np.arcsin(np.clip(share, -1.0, 1.0))) / rotors.teeth
    state[ANGLE] = links.zero_rad + np.linalg.solve(links.coupling, state[ROTOR] / rotors.gear - strain)
    state[CURRENT_A] = rotors.current_a * np.cos(phase_rad)
    state[CURRENT_B] = rotors.current_a * np.sin(phase_rad)
    state[ENTRY] = field.first[:-1]
    return Run(state, 0.0, np.zeros(len(rotors.gear)), np.zeros(len(rotors.gear)))


def _step_s(rotors: Rotors, largest_mobility: float, made: StepTrain, scene: Scene) -> float:
    """Return a length of step that follows the fastest swing and the fastest turn of a field."""
    field = rotors.teeth * (rotors.constant_nm_a * rotors.current_a + 4.0 * rotors.detent_nm)
    on_gear = (rotors.stiffness_nm_rad / rotors.gear**2 + field) / rotors.inertia_kg_m2
    step_s = SHARE_OF_A_SWING / sqrt(on_gear.max() + rotors.stiffness_nm_rad.max() * largest_mobility)
    for steps, joint in zip(made.steps, scene.joints, strict=True):
        if len(steps.ticks) > joint.microsteps:
            full_step = int((steps.ticks[joint.microsteps :] - steps.ticks[: -joint.microsteps]).min())
            full_step = max(full_step, joint.microsteps * made.board.min_interval_ticks)  # of steps that are no plan's
            step_s = min(step_s, 4.0 * full_step / TICKS_HZ / STEPS_PER_TURN)
    return step_s
