"""Forces from outside: contacts and hard stops as stiff springs with dampers, and what faults push with."""

from __future__ import annotations

import numpy as np

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there
from planarm_sim.plant.contact import Obstacles, touch
from planarm_sim.plant.layout import LEFT, STOPPED, TOUCHED, Body, Floats, State, Work, mark

CONTACT_N_M = 5e4
CONTACT_N_S_M = 60.0
"""A steel post that a light arm dents by a tenth of a millimetre at 5 N, and does not bounce off."""
STOP_NM_RAD = 2000.0
STOP_NM_S = 2.0


@inner
def push(body: Body, obstacles: Obstacles, state: State, work: Work, cycle: int, marks: Floats, marked: int) -> int:
    """Write into work.pushed the torques on the directions by contacts, stops and outside torques, for this step."""
    n = len(body.lengths)
    pushed, y = work.pushed, state.y
    pushed[:] = 0.0
    for i in range(n):
        q = y[i] - (y[i - 1] if i else 0.0)
        speed = y[n + i] - (y[n + i - 1] if i else 0.0)
        torque = 0.0
        if q < body.stops[i, 0]:
            torque = max(0.0, STOP_NM_RAD * (body.stops[i, 0] - q) - STOP_NM_S * speed)
        elif q > body.stops[i, 1]:
            torque = min(0.0, STOP_NM_RAD * (body.stops[i, 1] - q) - STOP_NM_S * speed)
        hit = 0 if torque == 0.0 else 1
        if hit and not state.stopped[i]:
            marked = mark(marks, marked, cycle, STOPPED, i, 0, q)
        state.stopped[i] = hit
        torque += state.outside[i]
        pushed[i] += torque
        if i:
            pushed[i - 1] -= torque
    for k in range(len(obstacles.radii)):
        x, yy = body.base[0], body.base[1]
        for i in range(n):
            bx, by = x + body.lengths[i] * np.cos(y[i]), yy + body.lengths[i] * np.sin(y[i])
            depth, nx, ny, place = touch(x, yy, bx, by, body.half_widths[i], obstacles, k)
            force = 0.0
            if depth > 0.0:
                force = press(body, state, pushed, i, place, depth, nx, ny)
            if depth > 0.0 and state.touching[i, k] == 0.0:
                marked = mark(marks, marked, cycle, TOUCHED, i, k, place)
                state.touching[i, k] = 1e-12
            elif depth <= 0.0 and state.touching[i, k] > 0.0:
                marked = mark(marks, marked, cycle, LEFT, i, k, state.touching[i, k])
                state.touching[i, k] = 0.0
            state.touching[i, k] = max(state.touching[i, k], force)
            x, yy = bx, by
    return marked


@inner
def press(body: Body, state: State, pushed: Floats, i: int, place: float, depth: float, nx: float, ny: float) -> float:
    """Add the torques of a contact at a place of link i; return the force in newtons."""
    n = len(body.lengths)
    away = 0.0
    for k in range(i + 1):
        arm = body.lengths[k] * (place if k == i else 1.0)
        away += arm * (ny * np.cos(state.y[k]) - nx * np.sin(state.y[k])) * state.y[n + k]
    force = max(0.0, CONTACT_N_M * depth - CONTACT_N_S_M * away)
    for k in range(i + 1):
        arm = body.lengths[k] * (place if k == i else 1.0)
        pushed[k] += force * arm * (ny * np.cos(state.y[k]) - nx * np.sin(state.y[k]))
    return force
