"""The arm, its gears and its motors through time: one compiled loop of equal steps.

A step takes, in this order: what the drivers ask for, the currents (`motor`), contacts and stops as stiff springs
(`forces`), the motion of rotors and links by the classical Runge-Kutta method with those held, and dry friction
(`friction`). Friction of the last step takes part in the next one's Runge-Kutta stages, so that what sticks does not
creep.
"""

from __future__ import annotations

import numpy as np

from planarm_sim.cpu.compiled import inner, kernel  # kernel_cache: see there
from planarm_sim.plant.contact import Obstacles
from planarm_sim.plant.forces import push
from planarm_sim.plant.friction import rub
from planarm_sim.plant.layout import SLIPPED, SWITCHED, Body, Drive, Floats, Ints, State, Switches, Work, mark
from planarm_sim.plant.motor import chopped, drained, torque_nm
from planarm_sim.plant.rigid_body import add_inertia_torques, mass_matrix, solve_in_place


@kernel
def advance(
    body: Body,
    drive: Drive,
    obstacles: Obstacles,
    switches: Switches,
    state: State,
    work: Work,
    cycle: int,
    steps: int,
    step_cycles: int,
    events: Ints,
    log: Floats,
    log_every: int,
    marks: Floats,
) -> tuple[int, int]:
    """Run `steps` steps from `cycle` on.

    Args:
        body: links and joints.
        drive: motors and gears.
        obstacles: what the links can hit.
        switches: limit switches.
        state: changed in place.
        work: room.
        cycle: now; a multiple of `step_cycles`.
        steps: how many.
        step_cycles: length of a step.
        events: what the drivers ask for: cycle, motor, phase in 1/256 of a full step, on; in order of time. An event
            counts from the step on whose middle is not before it.
        log: filled with cycle and y, one row for each multiple of `log_every` cycles that a step ends on.
        log_every: cycles.
        marks: filled with what happened.

    Returns:
        Numbers of rows in log and marks.
    """
    h = step_cycles * 62.5e-9
    logged = marked = following = 0
    half = step_cycles // 2
    for _ in range(steps):
        while following < len(events) and events[following, 0] <= cycle + half:
            m = events[following, 1]
            state.phase[m] = events[following, 2] * (np.pi / 512.0)
            state.on[m] = events[following, 3]
            following += 1
        update_currents(drive, state, h)
        marked = push(body, obstacles, state, work, cycle, marks, marked)
        runge_kutta(body, drive, state, work, h)
        rub(body, drive, state, work, h)
        cycle += step_cycles
        marked = note_slips(drive, state, cycle, marks, marked)
        marked = note_switches(switches, state, cycle, marks, marked)
        if cycle % log_every == 0 and logged < len(log):
            log[logged, 0] = cycle
            for i in range(len(state.y)):
                log[logged, 1 + i] = state.y[i]
            logged += 1
    return logged, marked


@inner
def update_currents(drive: Drive, state: State, h: float) -> None:
    """Step the currents, with the rotors where they will be in the middle of the step."""
    n2 = 2 * state.coulomb.size
    motors = len(drive.gear)
    for m in range(motors):
        speed = state.y[n2 + motors + m]
        angle = drive.teeth[m] * (state.y[n2 + m] + 0.5 * h * speed)
        emf = drive.torque_constant[m] * speed
        emf_a, emf_b = -emf * np.sin(angle), emf * np.cos(angle)
        r, l_over_h, supply = drive.resistance[m], drive.inductance[m] / h, state.supply[m]
        a, b = state.currents[m, 0], state.currents[m, 1]
        if state.on[m]:
            wanted = drive.current[m]
            state.currents[m, 0] = chopped(a, wanted * np.cos(state.phase[m]), emf_a, supply, r, l_over_h)
            state.currents[m, 1] = chopped(b, wanted * np.sin(state.phase[m]), emf_b, supply, r, l_over_h)
        elif a != 0.0 or b != 0.0:
            state.currents[m, 0] = drained(a, emf_a, supply, r, l_over_h)
            state.currents[m, 1] = drained(b, emf_b, supply, r, l_over_h)


@inner
def runge_kutta(body: Body, drive: Drive, state: State, work: Work, h: float) -> None:
    """Move links and rotors by one step."""
    y, at, k = state.y, work.y, work.stages
    size = len(y)
    slopes(body, drive, state, work, y, k[0])
    for stage in range(1, 4):
        reach = h if stage == 3 else 0.5 * h
        for i in range(size):
            at[i] = y[i] + reach * k[stage - 1, i]
        slopes(body, drive, state, work, at, k[stage])
    for i in range(size):
        y[i] += h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])


@inner
def slopes(body: Body, drive: Drive, state: State, work: Work, y: Floats, out: Floats) -> None:
    """Write dy/dt."""
    n, motors = len(body.lengths), len(drive.gear)
    phi, dphi = y[:n], y[n : 2 * n]
    torques = out[n : 2 * n]
    for i in range(n):
        out[i] = dphi[i]
        speed = dphi[i] - (dphi[i - 1] if i else 0.0)
        work.joint[i] = state.friction[i] - body.viscous[i] * speed
    for m in range(motors):
        turned = speed = 0.0
        for i in range(n):
            q = phi[i] - (phi[i - 1] if i else 0.0) - drive.zero[i]
            turned += drive.coupling[m, i] * q
            speed += drive.coupling[m, i] * (dphi[i] - (dphi[i - 1] if i else 0.0))
        rotor, rotor_speed = y[2 * n + m], y[2 * n + motors + m]
        slack = turned - drive.gear[m] * rotor
        half_play = drive.half_play[m]
        torque = 0.0
        if abs(slack) >= half_play:
            beyond = slack - half_play if slack > 0.0 else slack + half_play
            torque = -drive.stiffness[m] * beyond - drive.gear_damping[m] * (speed - drive.gear[m] * rotor_speed)
            if half_play > 0.0 and torque * slack > 0.0:
                torque = 0.0  # teeth push, they do not pull
        for i in range(n):
            work.joint[i] += drive.coupling[m, i] * torque
        angle = drive.teeth[m] * rotor
        electric = torque_nm(
            drive.torque_constant[m],
            drive.detent[m],
            state.currents[m, 0],
            state.currents[m, 1],
            np.sin(angle),
            np.cos(angle),
        )
        out[2 * n + m] = rotor_speed
        out[2 * n + motors + m] = (
            electric - drive.gear[m] * torque - drive.damping[m] * rotor_speed + state.rotor_friction[m]
        ) / drive.inertia[m]
    for i in range(n):
        torques[i] = work.pushed[i] + work.joint[i] - (work.joint[i + 1] if i + 1 < n else 0.0)
    add_inertia_torques(body.a, body.b, body.gravity, phi, dphi, torques)
    mass_matrix(body.a, phi, work.mass)
    solve_in_place(work.mass, torques)


@inner
def note_slips(drive: Drive, state: State, cycle: int, marks: Floats, marked: int) -> int:
    """Note each electrical turn, four full steps, by which a rotor falls behind or gets ahead of its driver."""
    n2, motors = 2 * state.coulomb.size, len(drive.gear)
    for m in range(motors):
        behind = state.phase[m] - drive.teeth[m] * state.y[n2 + m] - 2.0 * np.pi * state.lost[m]
        if abs(behind) > 1.1 * np.pi:  # a little beyond the middle, so that a rotor there is noted once
            turns = 1 if behind > 0.0 else -1
            state.lost[m] += turns
            marked = mark(marks, marked, cycle, SLIPPED, m, turns, state.y[n2 + motors + m])
    return marked


@inner
def note_switches(switches: Switches, state: State, cycle: int, marks: Floats, marked: int) -> int:
    """Note each limit switch that a joint begins or ceases to press."""
    for k in range(len(switches.joint)):
        i = switches.joint[k]
        q = state.y[i] - (state.y[i - 1] if i else 0.0)
        pressed = 1 if (q >= switches.at[k]) == (switches.above[k] == 1) else 0
        if pressed != switches.pressed[k]:
            switches.pressed[k] = pressed
            marked = mark(marks, marked, cycle, SWITCHED, k, pressed, q)
    return marked
