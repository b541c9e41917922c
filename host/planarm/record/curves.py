"""Curves over time, planned and real, at few enough moments for a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planarm.dynamics.pull_out import Drives
from planarm.dynamics.rigid_body import RigidBody
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.plan import Plan
from planarm.record.arm_findings import ArmFindings
from planarm.scene import Scene
from planarm.stepping.check_torque import joint_torques_nm, motor_torque_shares
from planarm_wire.messages import TICKS_HZ

Floats = NDArray[np.float64]
Ticks = NDArray[np.int64]

MOMENTS = 700
"""Moments a curve is told at: more than a page has pixels for it."""
WITHIN = 4
"""Step rates are looked at this many times between two moments, and the largest counts."""


def planned_curves(plan: Plan) -> dict[str, Any]:
    """Return the planned motion: angles, speeds, accelerations, torque, energy, the tip's way, step rates."""
    t_s = np.linspace(0.0, plan.trajectory.duration_s, MOMENTS)
    q, qd, qdd = plan.trajectory.sample(t_s)
    scene = plan.scene
    tip_cm = forward(Arm.from_spec(scene.arm), q)[:, -1]
    joints_nm = joint_torques_nm(scene.arm.link_lengths_cm, scene.mechanics, q, qd, qdd)
    shares = motor_torque_shares(scene, joints_nm, qd, qdd)
    steps = plan.train.steps
    return {
        "t_s": rounded(t_s, 6),
        "q_deg": columns(np.degrees(q), 4),
        "speed_deg_s": columns(np.degrees(qd), 3),
        "acceleration_deg_s2": columns(np.degrees(qdd), 2),
        "tip_cm": columns(tip_cm, 4),
        "torque_percent": columns(100.0 * shares, 2),
        "torque_nm": columns(shares * available_nm(scene, qd), 5),
        "step_rate_hz": [rounded(step_rates_hz(j.ticks / TICKS_HZ, j.directions, t_s), 1) for j in steps],
        **_energies(scene, t_s, q, qd, joints_nm),
    }


def real_curves(arm: ArmFindings, scene: Scene) -> dict[str, Any]:
    """Return what the emulated arm did: angles, the tip's way, and its error with no peak left out."""
    t_s, record = arm.t_s, arm.record
    moments = np.linspace(t_s[0], t_s[-1], MOMENTS) if len(t_s) > MOMENTS else t_s
    kept = np.minimum(np.searchsorted(t_s, moments), len(t_s) - 1)
    q_rad = record.q_rad[-len(t_s) :]
    peaks = np.maximum.reduceat(arm.tip_error_mm, kept) if len(kept) else arm.tip_error_mm
    return {
        "t_s": rounded(t_s[kept], 6),
        "q_deg": columns(np.degrees(q_rad[kept]), 4),
        "tip_cm": columns(forward(Arm.from_spec(scene.arm), q_rad[kept])[:, -1], 4),
        "tip_error_mm": rounded(peaks, 4),
    }


def pin_curves(times_s: Sequence[Floats], directions: Sequence[NDArray[np.int8]], end_s: float) -> dict[str, Any]:
    """Return the step rates that the pins show, for each joint's steps at `times_s` since the plan's zero."""
    t_s = np.linspace(0.0, max(end_s, 1e-6), MOMENTS)
    rates = [step_rates_hz(times, signs, t_s) for times, signs in zip(times_s, directions, strict=True)]
    return {"t_s": rounded(t_s, 6), "step_rate_hz": [rounded(rate, 1) for rate in rates]}


def step_rates_hz(times_s: Floats, directions: NDArray[np.int8], t_s: Floats) -> Floats:
    """Return the signed step rate at even moments: one over the interval around each, the largest up to the next.

    Args:
        times_s: moments of the steps, ascending, shape (n,).
        directions: +1 or -1 for each.
        t_s: where the rate is wanted, shape (m,).
    """
    if len(times_s) < 2:
        return np.zeros(len(t_s))
    pace = (t_s[-1] - t_s[0]) / max(1, len(t_s) - 1)
    looked_at = (t_s[:, None] + pace * np.arange(WITHIN) / WITHIN).ravel()
    after = np.searchsorted(times_s, looked_at, side="right")
    inside = (after > 0) & (after < len(times_s))
    after = np.clip(after, 1, len(times_s) - 1)
    gaps = times_s[after] - times_s[after - 1]
    rates = np.where(inside, directions[after] / np.maximum(gaps, 1.0 / TICKS_HZ), 0.0).reshape(-1, WITHIN)
    return np.asarray(rates[np.arange(len(rates)), np.abs(rates).argmax(axis=1)])


def available_nm(scene: Scene, qd_rad_s: Floats) -> Floats:
    """Return the pull-out torque of each motor behind its gear at the joints' speeds, shape (n, motors)."""
    drives = Drives.of(scene, 1.0)
    speeds = np.abs(qd_rad_s @ drives.coupling.T)
    return np.asarray(drives.flat_nm * np.minimum(1.0, drives.corner_rad_s / np.maximum(speeds, drives.corner_rad_s)))


def _energies(scene: Scene, t_s: Floats, q: Floats, qd: Floats, joints_nm: Floats) -> dict[str, Any]:
    """Return the arm's kinetic energy, and the work that the joints gave and took back until each moment."""
    body, mechanics = RigidBody.of(scene), scene.mechanics
    heading, turn = np.cumsum(q, axis=1), np.cumsum(qd, axis=1)
    apart = np.cos(heading[:, :, None] - heading[:, None, :])
    kinetic_j = 0.5 * np.einsum("jk,njk,nj,nk->n", body.products_kg_m2, apart, turn, turn)
    friction = np.array(mechanics.coulomb_friction_nm) * np.sign(qd) + np.array(mechanics.viscous_friction_nm_s) * qd
    power_w = ((joints_nm + friction) * qd).sum(axis=1)
    work_j = np.concatenate([[0.0], np.cumsum(0.5 * (power_w[1:] + power_w[:-1]) * np.diff(t_s))])
    copper_w = sum(joint.motor.current_a**2 * joint.motor.resistance_ohm for joint in scene.joints)
    return {
        "kinetic_mj": rounded(1e3 * kinetic_j, 4),
        "work_mj": rounded(1e3 * work_j, 4),
        "power_w": rounded(power_w, 5),
        "copper_w": round(copper_w, 4),
    }


def columns(values: Floats, digits: int) -> list[list[float]]:
    """Return the columns of an array of shape (n, k) as k lists."""
    return [rounded(column, digits) for column in np.asarray(values).T]


def rounded(values: Floats, digits: int) -> list[float]:
    """Return numbers for JSON, rounded; a negative zero is none."""
    return [float(value) for value in np.round(np.asarray(values, np.float64), digits) + 0.0]
