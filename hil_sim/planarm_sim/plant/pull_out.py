"""How fast a motor can turn a load: speed raised at constant acceleration until the rotor falls behind its driver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planarm_sim.plant.build import CYCLES_PER_S
from planarm_sim.plant.plant import PHASE_PER_STEP, Plant
from planarm_sim.plant.spec import Joint, Link, Motor, Rig

__all__ = ["pull_out_steps_s"]

MICROSTEPS = 16
LOAD_ROTORS = 4.0
"""Inertia of the load, in those of the rotor."""


def pull_out_steps_s(
    motor: Motor, load_nm: float, *, acceleration_steps_s2: float = 2000.0, limit_steps_s: float = 12_000.0
) -> float:
    """Return the speed at which the rotor first loses a step, full steps a second; infinity if not below the limit.

    Args:
        motor: without gear; its driver makes 1/16 steps.
        load_nm: dry friction that it turns against.
        acceleration_steps_s2: of the speed, from standstill.
        limit_steps_s: where to give up.
    """
    inertia = LOAD_ROTORS * motor.rotor_inertia_kg_m2
    load = Link(length_m=0.05, mass_kg=1e-6, com_m=0.0, inertia_kg_m2=inertia)
    rig = Rig((load,), (Joint(coulomb_nm=load_nm),), (replace(motor, gear_ratio=1.0, backlash_rad=0.0),), (0.0,))
    plant = Plant(rig, sample_cycles=0)
    duration_s = limit_steps_s / acceleration_steps_s2
    count = int(0.5 * limit_steps_s * duration_s * MICROSTEPS)
    at_s = np.sqrt(2.0 * np.arange(1, count + 1) / (MICROSTEPS * acceleration_steps_s2))
    events = np.ones((count + 1, 4), np.int64)
    events[:, 0] = np.concatenate([[0], np.rint(at_s * CYCLES_PER_S)])
    events[:, 1] = 0
    events[:, 2] = np.arange(count + 1) * (PHASE_PER_STEP // MICROSTEPS)
    plant.take(events)
    while plant.cycle < duration_s * CYCLES_PER_S:
        plant.run_to(plant.cycle + CYCLES_PER_S // 50)
        if slips := plant.slips():
            return acceleration_steps_s2 * slips[0].cycle / CYCLES_PER_S
    return float("inf")
