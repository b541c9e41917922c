"""The kernel that reads edges as drivers do: which steps are taken, which rules are broken, and with what consequence.

A step is decided when its pulse has been high for the least time and DIR for the least hold: it is then taken at that
moment, so that nothing later can change it. A row of `DriverState` is one driver; times are clock cycles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu.compiled import inner, kernel  # kernel_cache: see there

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

NS_PER_CYCLE = 62.5
PHASE_PER_STEP = 256
"""Phases are in 1/256 of a full step."""
PHASE_TURN = 1024
NEVER = -(1 << 60)

# Inputs of a driver: columns of the pin table.
IN_STEP, IN_DIR, IN_ENABLE, IN_SLEEP, IN_MODE = 0, 1, 2, 3, 4
INPUTS = 7

# Columns of a driver's state.
(
    STEP,
    DIR,
    ENABLED,
    AWAKE,
    MODE_BITS,
    POWERED,
    ROSE,
    FELL,
    TURNED,
    ENABLED_AT,
    AWAKE_AT,
    MODE_AT,
    PENDING,
    FORWARD,
    SIZE,
    OLD_SIZE,
    PHASE,
    COUNTED,
    PULSES,
    WANTED,
    PENDING_SIZE,
) = range(21)
STATE_COLUMNS = 21
"""WANTED is what the pulses asked for, COUNTED what the driver made of them, both in phase units since the start."""

# Columns of a driver's limits, nanoseconds; negative: no such rule. The first eight are `planarm_wire.drivers.RULES`.
HIGH, LOW, PERIOD, SETUP, HOLD, ENABLE, MODE, WAKE, COUNTS_DISABLED, HOME, ENABLE_ON = range(11)
LIMIT_COLUMNS = 11

# Columns of what comes out.
EVENT_COLUMNS = 4  # cycle, driver, phase, whether current flows
VIOLATION_COLUMNS = 4  # cycle, driver, rule, measured in nanoseconds


@kernel
def judge_edges(
    state: Ints,
    limits: Floats,
    pins: Ints,
    sizes: Ints,
    edges: Ints,
    until: int,
    events: Ints,
    violations: Floats,
) -> tuple[int, int]:
    """Let every driver see the edges and the time up to `until`.

    Args:
        state: one row a driver, STATE_COLUMNS.
        limits: one row a driver, LIMIT_COLUMNS.
        pins: one row a driver, INPUTS columns: the chip's pin number, -1 where the input is strapped.
        sizes: one row a driver: phase units of a step by the levels of its mode pins as a number, 8 columns.
        edges: cycle, pin and level in order of time, shape (n, 3).
        until: cycle up to which time has passed; pulses that are long enough by then are taken.
        events: filled with what changed for the motors, EVENT_COLUMNS; room for 2 n + drivers rows.
        violations: filled with the rules broken, VIOLATION_COLUMNS; room for 4 n rows.

    Returns:
        Numbers of events and of violations.
    """
    made = broken = 0
    for i in range(len(edges)):
        cycle, pin, level = edges[i, 0], edges[i, 1], edges[i, 2]
        for d in range(len(state)):
            for role in range(INPUTS):
                if pins[d, role] == pin:
                    made = settle(state[d], limits[d], d, cycle, events, made)
                    if role == IN_STEP:
                        if level:
                            broken = on_rise(state[d], limits[d], d, cycle, violations, broken)
                        else:
                            broken = on_fall(state[d], limits[d], d, cycle, violations, broken)
                    elif role == IN_DIR:
                        broken = on_dir(state[d], limits[d], d, cycle, level, violations, broken)
                    elif role == IN_ENABLE:
                        made = on_enable(state[d], d, cycle, level == limits[d, ENABLE_ON], events, made)
                    elif role == IN_SLEEP:
                        made = on_awake(state[d], limits[d], d, cycle, level, events, made)
                    else:
                        on_mode(state[d], sizes[d], role - IN_MODE, level, cycle)
    for d in range(len(state)):
        made = settle(state[d], limits[d], d, until, events, made)
    return made, broken


@inner
def settle(s: Ints, limit: Floats, d: int, now: int, events: Ints, made: int) -> int:
    """Take the pending step when its pulse is long enough by now."""
    if not s[PENDING]:
        return made
    needed = np.ceil(max(limit[HIGH], limit[HOLD]) / NS_PER_CYCLE)
    due = s[ROSE] + np.int64(needed)
    if now < due:
        return made
    s[PENDING] = 0
    before = s[PHASE]
    s[PHASE] = next_phase(before, s[PENDING_SIZE], s[FORWARD] == 1)
    s[COUNTED] += s[PHASE] - before
    return emit(s, d, due, events, made)


@inner
def next_phase(phase: int, size: int, forward: bool) -> int:
    """Return the neighbouring position of a resolution; off its positions, the next one on the way."""
    off = phase % size
    if forward:
        return phase + size - off
    return phase - (size if off == 0 else off)


@inner
def emit(s: Ints, d: int, cycle: int, events: Ints, made: int) -> int:
    """Write an event: the driver's phase, and whether current flows."""
    events[made, 0], events[made, 1], events[made, 2] = cycle, d, s[PHASE]
    events[made, 3] = s[ENABLED] & s[AWAKE] & s[POWERED]
    return made + 1


@inner
def on_rise(s: Ints, limit: Floats, d: int, cycle: int, violations: Floats, broken: int) -> int:
    """A pulse begins: it becomes pending unless a rule makes it void."""
    s[STEP] = 1
    s[PULSES] += 1
    previous, s[ROSE] = s[ROSE], cycle
    forward, size = s[DIR], s[SIZE]
    s[WANTED] += (1 if forward else -1) * size
    void = not s[POWERED] or not s[AWAKE] or (not s[ENABLED] and limit[COUNTS_DISABLED] == 0.0)
    for rule, since in ((LOW, s[FELL]), (PERIOD, previous), (ENABLE, s[ENABLED_AT]), (WAKE, s[AWAKE_AT])):
        measured = (cycle - since) * NS_PER_CYCLE
        relevant = s[POWERED] == 1 and (rule != ENABLE or s[ENABLED] == 1) and (rule != WAKE or s[AWAKE] == 1)
        if relevant and limit[rule] > 0.0 and measured < limit[rule]:
            broken = violate(violations, broken, d, cycle, rule, measured)
            void = True
    s[PENDING] = 0
    if void:
        return broken
    measured = (cycle - s[TURNED]) * NS_PER_CYCLE
    if limit[SETUP] > 0.0 and measured < limit[SETUP]:
        broken = violate(violations, broken, d, cycle, SETUP, measured)
        forward = 1 - forward
    measured = (cycle - s[MODE_AT]) * NS_PER_CYCLE
    if limit[MODE] > 0.0 and measured < limit[MODE]:
        broken = violate(violations, broken, d, cycle, MODE, measured)
        size = s[OLD_SIZE]
    s[PENDING], s[FORWARD], s[PENDING_SIZE] = 1, forward, size
    return broken


@inner
def on_fall(s: Ints, limit: Floats, d: int, cycle: int, violations: Floats, broken: int) -> int:
    """A pulse ends: too soon, and it was none."""
    s[STEP] = 0
    s[FELL] = cycle
    measured = (cycle - s[ROSE]) * NS_PER_CYCLE
    if s[PENDING] and measured < limit[HIGH]:
        s[PENDING] = 0
        return violate(violations, broken, d, cycle, HIGH, measured)
    return broken


@inner
def on_dir(s: Ints, limit: Floats, d: int, cycle: int, level: int, violations: Floats, broken: int) -> int:
    """DIR changes: within the hold time after a rise, the step goes the new way."""
    if s[DIR] == level:
        return broken
    s[DIR] = level
    s[TURNED] = cycle
    measured = (cycle - s[ROSE]) * NS_PER_CYCLE
    if s[PENDING] and limit[HOLD] > 0.0 and measured < limit[HOLD]:
        s[FORWARD] = level
        return violate(violations, broken, d, cycle, HOLD, measured)
    return broken


@inner
def on_enable(s: Ints, d: int, cycle: int, enabled: bool, events: Ints, made: int) -> int:
    """ENABLE changes: current flows, or not."""
    if enabled and not s[ENABLED]:
        s[ENABLED_AT] = cycle
    s[ENABLED] = 1 if enabled else 0
    return emit(s, d, cycle, events, made)


@inner
def on_awake(s: Ints, limit: Floats, d: int, cycle: int, awake: int, events: Ints, made: int) -> int:
    """SLEEP is released or pulled: asleep no current flows, and the charge pump must start anew afterwards."""
    if awake and not s[AWAKE]:
        s[AWAKE_AT] = cycle
    s[AWAKE] = awake
    return emit(s, d, cycle, events, made)


@inner
def on_mode(s: Ints, sizes: Ints, bit: int, level: int, cycle: int) -> None:
    """A micro-step pin changes: the size of the steps to come."""
    bits = s[MODE_BITS] & ~(1 << bit) | level << bit
    if bits != s[MODE_BITS]:
        s[MODE_BITS] = bits
        s[OLD_SIZE], s[SIZE] = s[SIZE], sizes[bits]
        s[MODE_AT] = cycle


@kernel
def set_power(s: Ints, limit: Floats, d: int, cycle: int, powered: bool, events: Ints, made: int) -> int:
    """Motor supply comes or goes. With it the driver starts at its home position, wherever the motor stands."""
    made = settle(s, limit, d, cycle, events, made)
    if powered and not s[POWERED]:
        s[AWAKE_AT] = cycle
        s[PHASE] += (np.int64(limit[HOME]) - s[PHASE]) % PHASE_TURN
    s[POWERED] = 1 if powered else 0
    s[PENDING] = 0
    return emit(s, d, cycle, events, made)


@inner
def violate(violations: Floats, broken: int, d: int, cycle: int, rule: int, measured: float) -> int:
    """Write a broken rule."""
    violations[broken, 0], violations[broken, 1], violations[broken, 2] = cycle, d, rule
    violations[broken, 3] = measured
    return broken + 1
