"""What the kernels take of a rig: arrays and numbers instead of a description."""

from __future__ import annotations

from itertools import product

import numpy as np

from planarm_sim.plant import layout
from planarm_sim.plant.rigid_body import inertia_constants
from planarm_sim.plant.spec import Rig

__all__ = ["CYCLES_PER_S", "body_of", "drive_of", "fastest_per_s", "fitting_step", "start_of", "switches_of"]

CYCLES_PER_S = 16_000_000
LONGEST_STEP_CYCLES = 800
"""50 us, a chopper's period: a thirtieth of an electrical turn at 2,500 full steps a second."""
STABLE_SHARE = 0.25
"""Longest step as a share of the fastest vibration's 1 / omega; the method is stable up to 2.8."""


def body_of(rig: Rig) -> layout.Body:
    """The links, as the kernels take them."""
    a, b = inertia_constants(rig.links)
    return layout.Body(
        a=a,
        b=b,
        lengths=np.array([link.length_m for link in rig.links]),
        half_widths=np.array([max(0.5 * link.width_m, 5e-4) for link in rig.links]),
        base=np.array(rig.base_m, dtype=float),
        gravity=float(rig.gravity_m_s2),
        viscous=np.array([joint.viscous_nm_s for joint in rig.joints]),
        stops=np.array([joint.stops_rad for joint in rig.joints], dtype=float),
    )


def drive_of(rig: Rig) -> layout.Drive:
    """Motors and gears, as the kernels take them."""
    motors = rig.motors
    return layout.Drive(
        coupling=np.ascontiguousarray(rig.coupling_matrix[: len(motors)]),
        zero=rig.zeros,
        gear=np.array([(-1.0 if m.reversed else 1.0) / m.gear_ratio for m in motors]),
        half_play=np.array([0.5 * m.backlash_rad for m in motors]),
        stiffness=np.array([m.stiffness_nm_rad for m in motors]),
        gear_damping=np.array([m.output_damping_nm_s for m in motors]),
        teeth=np.array([m.steps_per_rev / 4.0 for m in motors]),
        torque_constant=np.array([m.torque_constant_nm_a for m in motors]),
        detent=np.array([m.detent_torque_nm for m in motors]),
        inertia=np.array([m.rotor_inertia_kg_m2 for m in motors]),
        damping=np.array([m.damping_nm_s for m in motors]),
        resistance=np.array([m.resistance_ohm for m in motors]),
        inductance=np.array([m.inductance_h for m in motors]),
        current=np.array([m.current_a for m in motors]),
    )


def start_of(rig: Rig, drive: layout.Drive) -> layout.State:
    """The arm at rest where the rig says, its drivers off."""
    n, m = len(rig.links), len(rig.motors)
    start = np.array(rig.start_rad, dtype=float)
    rotors = drive.coupling @ (start - drive.zero) / drive.gear
    phase = np.rint(rotors * drive.teeth * 512.0 / np.pi) * (np.pi / 512.0)
    return layout.State(
        y=np.concatenate([np.cumsum(start), np.zeros(n), rotors, np.zeros(m)]),
        currents=np.zeros((m, 2)),
        phase=phase,
        on=np.zeros(m, np.int64),
        supply=np.array([motor.supply_v for motor in rig.motors]),
        lost=np.zeros(m, np.int64),
        friction=np.zeros(n),
        rotor_friction=np.zeros(m),
        coulomb=np.array([joint.coulomb_nm for joint in rig.joints]),
        rotor_coulomb=np.array([motor.coulomb_nm for motor in rig.motors]),
        outside=np.zeros(n),
        touching=np.zeros((n, len(rig.obstacles))),
        stopped=np.zeros(n, np.int64),
    )


def switches_of(rig: Rig) -> layout.Switches:
    """The limit switches, as the arm finds them at its start."""
    pressed = [(rig.start_rad[s.joint] >= s.at_rad) == s.above for s in rig.switches]
    return layout.Switches(
        joint=np.array([s.joint for s in rig.switches], dtype=np.int64),
        at=np.array([s.at_rad for s in rig.switches], dtype=float),
        above=np.array([s.above for s in rig.switches], dtype=np.int64),
        pressed=np.array(pressed, dtype=np.int64),
    )


def fitting_step(rig: Rig) -> int:
    """Return the longest step, 800 cycles halved so often as is needed, that follows the arm's fastest vibration."""
    fastest, step = fastest_per_s(rig), LONGEST_STEP_CYCLES
    while step > 1 and step / CYCLES_PER_S * fastest > STABLE_SHARE and step % 2 == 0:
        step //= 2
    return step


def fastest_per_s(rig: Rig) -> float:
    """Return the largest magnitude of an eigenvalue of the arm around its rest, gears meshed, without gravity.

    Vibrations of rotors and links on the gears and in the motors' fields, and what damping brings to rest faster than
    that. The links' inertia depends on the pose: all ways to lie stretched or folded are looked at, where it is least.
    """
    drive, n, count = drive_of(rig), len(rig.links), len(rig.links) + len(rig.motors)
    a, _ = inertia_constants(rig.links)
    joints = np.eye(n, count) - np.eye(n, count, k=-1)  # of the links' directions
    joints[:, n:] = 0.0
    gears = drive.coupling @ joints
    gears[:, n:] = -np.diag(drive.gear)
    fields = [(m.peak_torque_nm / 4.0 + m.detent_torque_nm) * m.steps_per_rev for m in rig.motors]
    stiffness = gears.T * drive.stiffness @ gears + np.diag([*np.zeros(n), *fields])
    viscous = np.array([joint.viscous_nm_s for joint in rig.joints])
    damping = gears.T * drive.gear_damping @ gears + joints.T * viscous @ joints
    damping += np.diag([*np.zeros(n), *drive.damping])
    fastest, mass = 0.0, np.diag([*np.zeros(n), *drive.inertia])
    for signs in product((1.0, -1.0), repeat=n - 1):
        along = np.array([1.0, *signs])
        mass[:n, :n] = a * np.outer(along, along)
        change = np.zeros((2 * count, 2 * count))
        change[:count, count:] = np.eye(count)
        change[count:] = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
        fastest = max(fastest, float(np.abs(np.linalg.eigvals(change)).max()))
    return fastest
