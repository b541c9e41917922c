"""Dry friction as impulses: they bring a joint to rest, or slow it by all that friction has."""

from __future__ import annotations

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there
from planarm_sim.plant.layout import Body, Drive, State, Work
from planarm_sim.plant.rigid_body import mass_matrix, solve_in_place, substitute

FRICTION_SWEEPS = 8


@inner
def rub(body: Body, drive: Drive, state: State, work: Work, h: float) -> None:
    """Dry friction of rotors and joints: impulses that bring them to rest as far as friction can."""
    n, motors = len(body.lengths), len(drive.gear)
    y = state.y
    for m in range(motors):
        most = state.rotor_coulomb[m]
        if most > 0.0:
            wanted = state.rotor_friction[m] - y[2 * n + motors + m] * drive.inertia[m] / h
            got = min(max(wanted, -most), most)
            y[2 * n + motors + m] += (got - state.rotor_friction[m]) * h / drive.inertia[m]
            state.rotor_friction[m] = got
        else:
            state.rotor_friction[m] = 0.0
    if not state.coulomb.any():
        state.friction[:] = 0.0
        return
    mass_matrix(body.a, y[:n], work.mass)
    for i in range(n):
        column = work.inverse[i]
        column[:] = 0.0
        column[i] = 1.0
        if i:
            column[i - 1] = -1.0
        if i == 0:
            solve_in_place(work.mass, column)
        else:
            substitute(work.mass, column)
    work.impulse[:] = 0.0
    for _ in range(FRICTION_SWEEPS):
        for i in range(n):
            speed = y[n + i] - (y[n + i - 1] if i else 0.0)
            for j in range(n):
                speed += work.impulse[j] * (work.inverse[j, i] - (work.inverse[j, i - 1] if i else 0.0))
            answer = work.inverse[i, i] - (work.inverse[i, i - 1] if i else 0.0)
            most = state.coulomb[i] * h
            total = state.friction[i] * h + work.impulse[i] - speed / answer
            work.impulse[i] = min(max(total, -most), most) - state.friction[i] * h
    for j in range(n):
        state.friction[j] += work.impulse[j] / h
        for i in range(n):
            y[n + i] += work.impulse[j] * work.inverse[j, i]
