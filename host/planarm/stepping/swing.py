"""How rotors and links swing about a motion: the lag of every rotor behind its field, along the expanded plan.

A stepper's rotor hangs in the field of its coils like a mass on a spring. With N teeth, the field's electrical phase f
(a quarter turn a full step), the rotor's angle theta, the torque constant k and the phases' currents a and b, both of
them I cos f and I sin f where the supply can drive them,

    J theta'' = k (b cos N theta - a sin N theta) - T sin 4 N theta - c theta' - (torque of the gear) / g

so that at full current the rotor is pulled back by k I sin(f - N theta): most at a lag of one full step, less beyond,
and forwards from two full steps on, where four of them are lost (P. Acarnley, Stepping Motors, 4th ed., chapters 3 and
4: static torque, single-step response; D. W. Jones, Stepping Motor Physics: the frequency sqrt(k I N / J) of small
swings counts the load's inertia). Behind the gear, a spring with damping and play, hangs the arm,

    D(q) q'' = C^T (torques of the gears) - friction - (centrifugal torques) - (gravity),

whose inertia and torques are those of the planned pose: swings are some thousandths of a radian, and so slow that the
planned speeds give the centrifugal torques. What swings is hardly damped, so jumps of the acceleration that come in the
time of a natural frequency add up; the steps themselves and the detent torque do, too, at low speeds.

The path clock may be slowed down on the way, as the device does (docs/decisions/0026): from a moment of the path on its
rate falls by a share of the segment's allowance until all motors may stop at once, rests, and rises again.

Time steps are symplectic Euler's, which neither damps nor feeds a swing.
"""

from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import bare_kernel
from planarm_wire.messages import GENTLE_PERCENT, TICKS_HZ

Floats = NDArray[np.float64]
Ticks = NDArray[np.int64]

PHASES = 1024
"""Places of the field in an electrical turn: 256 to a full step, the finest that drivers make."""
RAD_PER_PHASE = 2.0 * pi / PHASES
FINE = 4096
SINES = np.sin(np.arange(FINE) * (2.0 * pi / FINE))
"""A turn of the sine; between two of its places a Taylor series of second order errs by 1e-10."""

LOST_RAD = pi
"""A rotor that is two full steps behind falls into the next stable place."""


class Links(NamedTuple):
    """The arm along its motion, at even times of the path; n joints, as many motors."""

    node_s: float
    """Time between nodes."""
    mobility: Floats
    """Inverse of the inertia matrix, shape (nodes, n, n)."""
    turning_nm: Floats
    """Torques that the planned speeds ask of the joints without any acceleration, shape (nodes, n)."""
    held_nm: Floats
    """Torques that hold the arm at rest, shape (nodes, n)."""
    coulomb_nm: Floats
    """Friction of each joint, shape (n,)."""
    viscous_nm_s: Floats
    """Friction that grows with speed, shape (n,)."""
    creep_rad_s: Floats
    """Speed up to which dry friction grows from 0 to all of itself, shape (n,): steps of time cannot follow a jump."""
    coupling: Floats
    """How far each motor turns, behind its gear, when each joint turns once, shape (n, n)."""
    zero_rad: Floats
    """Joint angles at which the field of every motor is at place 0, shape (n,)."""


class Rotors(NamedTuple):
    """The motors and what is between them and the arm; shape (n,) each."""

    gear: Floats
    """Turns of the rotor for one behind the gear, negative where it is reversed."""
    stiffness_nm_rad: Floats
    gear_damping_nm_s: Floats
    half_play_rad: Floats
    inertia_kg_m2: Floats
    damping_nm_s: Floats
    teeth: Floats
    constant_nm_a: Floats
    detent_nm: Floats
    current_a: Floats
    resistance_ohm: Floats
    flux_ohm: Floats
    """Inductance by the length of a step."""
    supply_v: Floats


class Field(NamedTuple):
    """Where the drivers put the field: all motors' steps, one motor after the other."""

    ticks: Ticks
    """Path time of each step; the first entry of a motor is its place before the motion."""
    phases: Ticks
    """The field from then on, in PHASES a turn, not wrapped."""
    first: Ticks
    """Index of each motor's first entry, then the number of all, shape (n + 1,)."""


class Holds(NamedTuple):
    """How the path clock may change, and where it is held; none: it runs on."""

    slow_per_s: Floats
    """Largest slowing at each node."""
    fast_per_s: Floats
    over: Floats
    """Speed at each node in start-stop speeds of the fastest motor: below 1 the clock may freeze."""
    begin_s: Floats
    """Path times at which it begins to slow down, ascending, shape (holds,)."""
    pause_s: Floats
    """How long it rests there, shape (holds,)."""
    share: Floats
    """Of the largest slowing, shape (holds,)."""


class Span(NamedTuple):
    """What part of a motion is followed, and how finely."""

    from_s: float
    """Path time at the start."""
    to_s: float
    """Path time at which it ends."""
    step_s: float
    steps_after: int
    """Steps after the end, or after the last hold is over and the clock runs as fast as ever."""
    most_steps: int
    """Where to give up: a clock that may hardly change can take for ever."""


RUNS, SLOWS, RESTS = 0, 1, 2
RESUMING_SHARE = 0.01 * GENTLE_PERCENT
"""Of the largest speeding up: what the device takes."""
SLOWEST_RATE = 0.02
ANGLE, SPEED, ROTOR, ROTOR_SPEED, CURRENT_A, CURRENT_B, TORQUE, ENTRY = range(8)
"""Rows of the state: joints, rotors, currents; room for the joints' torques, and each field's entry that holds."""
STATE_ROWS = 8


@bare_kernel
def largest_lags(
    links: Links,
    rotors: Rotors,
    field: Field,
    holds: Holds,
    span: Span,
    state: Floats,
    lags_rad: Floats,
    at_s: Floats,
) -> float:
    """Let the arm follow its field, and find each rotor's largest lag; stops where a rotor loses its place.

    Args:
        links: the arm.
        rotors: its motors.
        field: what the drivers do.
        holds: when the path clock is held.
        span: which part of the motion.
        state: at its start, then at its end, shape (STATE_ROWS, n).
        lags_rad: raised to the largest lag of each rotor in electrical radians, either sense, shape (n,).
        at_s: set to the path time of each, shape (n,).

    Returns:
        Path time at the end.
    """
    step_s, held = span.step_s, holds.begin_s.shape[0]
    tau, rate, mode, hold, rest_s = span.from_s, 1.0, RUNS, 0, 0.0
    made, last = 0, span.most_steps
    while made < last:
        made += 1
        node = min(int(tau / links.node_s), links.mobility.shape[0] - 1)
        if mode == RUNS:
            if hold < held and tau >= holds.begin_s[hold]:
                mode = SLOWS
            elif rate < 1.0:
                rate = min(1.0, rate + RESUMING_SHARE * holds.fast_per_s[node] * step_s)
                if rate == 1.0 and hold == held:
                    last = min(last, made + span.steps_after)
        if mode == SLOWS:
            rate = max(SLOWEST_RATE, rate - holds.share[hold] * holds.slow_per_s[node] * step_s)
            if rate * holds.over[node] <= 1.0:
                mode, rest_s = RESTS, holds.pause_s[hold]
        elif mode == RESTS:
            rest_s -= step_s
            if rest_s <= 0.0:
                mode, hold = RUNS, hold + 1
        running = 0.0 if mode == RESTS else rate
        if tau < span.to_s and tau + running * step_s >= span.to_s:
            last = min(last, made + span.steps_after)
        push_joints(links, node, running, state)
        turn_rotors(links, rotors, field, int((tau + 0.5 * running * step_s) * TICKS_HZ), step_s, state)
        tau += running * step_s
        if swing_on(links, rotors, field, node, step_s, state, lags_rad, at_s, tau):
            break
    return tau


@bare_kernel
def push_joints(links: Links, node: int, rate: float, state: Floats) -> None:
    """Write the torques on the joints but those of the gears: gravity, centrifugal torques, friction."""
    for i in range(state.shape[1]):
        speed = state[SPEED, i]
        rubbing = min(1.0, max(-1.0, speed / links.creep_rad_s[i]))
        state[TORQUE, i] = (
            -links.held_nm[node, i]
            - rate * rate * links.turning_nm[node, i]
            - links.viscous_nm_s[i] * speed
            - links.coulomb_nm[i] * rubbing
        )


@bare_kernel
def turn_rotors(links: Links, rotors: Rotors, field: Field, now: int, step_s: float, state: Floats) -> None:
    """Step the rotors' speeds and currents, and add the torques of the gears to those on the joints."""
    for m in range(state.shape[1]):
        entry = int(state[ENTRY, m])
        while entry + 1 < field.first[m + 1] and field.ticks[entry + 1] <= now:
            entry += 1
        state[ENTRY, m] = entry
        gear, speed = rotors.gear[m], state[ROTOR_SPEED, m]
        slack, slack_rate = -state[ROTOR, m] / gear, -speed / gear
        for i in range(state.shape[1]):
            slack += links.coupling[m, i] * (state[ANGLE, i] - links.zero_rad[i])
            slack_rate += links.coupling[m, i] * state[SPEED, i]
        geared, half_play = 0.0, rotors.half_play_rad[m]
        if abs(slack) >= half_play:
            beyond = slack - half_play if slack > 0.0 else slack + half_play
            geared = -rotors.stiffness_nm_rad[m] * beyond - rotors.gear_damping_nm_s[m] * slack_rate
            if half_play > 0.0 and geared * slack > 0.0:
                geared = 0.0  # teeth push, they do not pull
        for i in range(state.shape[1]):
            state[TORQUE, i] += links.coupling[m, i] * geared
        # Sine and cosine of N theta.
        angle = rotors.teeth[m] * state[ROTOR, m]
        near = int(np.floor(angle * (FINE / (2.0 * pi)) + 0.5))
        off = angle - near * (2.0 * pi / FINE)
        sine_0, cosine_0 = SINES[near & (FINE - 1)], SINES[(near + FINE // 4) & (FINE - 1)]
        sine = sine_0 + off * (cosine_0 - 0.5 * off * sine_0)
        cosine = cosine_0 - off * (sine_0 + 0.5 * off * cosine_0)
        # Each phase gets as near to its current as the supply can drive it against the back-EMF.
        emf, flux = rotors.constant_nm_a[m] * speed, rotors.flux_ohm[m]
        scale = 1.0 / (flux + rotors.resistance_ohm[m])
        swing, fine = rotors.supply_v[m] * scale, (field.phases[entry] * (FINE // PHASES)) & (FINE - 1)
        free = (flux * state[CURRENT_A, m] + emf * sine) * scale
        wanted = rotors.current_a[m] * SINES[(fine + FINE // 4) & (FINE - 1)]
        a = min(max(wanted, free - swing), free + swing)
        free = (flux * state[CURRENT_B, m] - emf * cosine) * scale
        b = min(max(rotors.current_a[m] * SINES[fine], free - swing), free + swing)
        state[CURRENT_A, m], state[CURRENT_B, m] = a, b
        pull = rotors.constant_nm_a[m] * (b * cosine - a * sine)
        pull -= 4.0 * rotors.detent_nm[m] * sine * cosine * (cosine * cosine - sine * sine)
        pull -= geared / gear + rotors.damping_nm_s[m] * speed
        state[ROTOR_SPEED, m] = speed + step_s * pull / rotors.inertia_kg_m2[m]


@bare_kernel
def swing_on(
    links: Links,
    rotors: Rotors,
    field: Field,
    node: int,
    step_s: float,
    state: Floats,
    lags_rad: Floats,
    at_s: Floats,
    tau: float,
) -> bool:
    """Step the joints' speeds, and all angles; note the lags, and tell whether a rotor lost its place."""
    lost = False
    for i in range(state.shape[1]):
        spin = 0.0
        for j in range(state.shape[1]):
            spin += links.mobility[node, i, j] * state[TORQUE, j]
        state[SPEED, i] += step_s * spin
    for m in range(state.shape[1]):
        state[ANGLE, m] += step_s * state[SPEED, m]
        state[ROTOR, m] += step_s * state[ROTOR_SPEED, m]
        phase = field.phases[int(state[ENTRY, m])] * RAD_PER_PHASE
        lag = abs(phase - rotors.teeth[m] * state[ROTOR, m])
        if lag > lags_rad[m]:
            lags_rad[m], at_s[m] = lag, tau
            lost = lost or lag > LOST_RAD
    return lost
