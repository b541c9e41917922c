"""What the plant's kernels share: constants, state, and the form of the marks that they leave."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Marks: what happened when; columns cycle, kind, number, number, value.
MARK_COLUMNS = 5
SLIPPED, TOUCHED, LEFT, STOPPED, SWITCHED = range(5)


class Body(NamedTuple):
    """Links and joints; constants."""

    a: Floats
    b: Floats
    lengths: Floats
    half_widths: Floats
    base: Floats
    gravity: float
    viscous: Floats
    stops: Floats


class Drive(NamedTuple):
    """Motors and gears; constants. `gear` is what a rotor's turn is behind its gear, signed."""

    coupling: Floats
    zero: Floats
    gear: Floats
    half_play: Floats
    stiffness: Floats
    gear_damping: Floats
    teeth: Floats
    torque_constant: Floats
    detent: Floats
    inertia: Floats
    damping: Floats
    resistance: Floats
    inductance: Floats
    current: Floats


class Switches(NamedTuple):
    """Limit switches; constants, and whether each is pressed."""

    joint: Ints
    at: Floats
    above: Ints
    pressed: Ints


class State(NamedTuple):
    """What changes.

    `y` holds the links' directions, their speeds, the rotors' angles, their speeds. `phase` is what each driver asks
    for, in electrical radians, `on` whether current flows, `supply` the volts it can put on a phase, `lost` the
    electrical turns that each rotor is behind (negative: ahead). `coulomb` and `rotor_coulomb` are dry friction now,
    `outside` torques on the joints from outside; faults change them. `touching` is each contact's largest force so far.
    """

    y: Floats
    currents: Floats
    phase: Floats
    on: Ints
    supply: Floats
    lost: Ints
    friction: Floats
    rotor_friction: Floats
    coulomb: Floats
    rotor_coulomb: Floats
    outside: Floats
    touching: Floats
    stopped: Ints


class Work(NamedTuple):
    """Room for a step's intermediate values."""

    stages: Floats
    y: Floats
    mass: Floats
    pushed: Floats
    joint: Floats
    inverse: Floats
    impulse: Floats


@inner
def mark(marks: Floats, marked: int, cycle: int, kind: int, first: int, second: int, value: float) -> int:
    """Write a mark while there is room."""
    if marked < len(marks):
        marks[marked, 0], marks[marked, 1], marks[marked, 2] = cycle, kind, first
        marks[marked, 3], marks[marked, 4] = second, value
        return marked + 1
    return marked
