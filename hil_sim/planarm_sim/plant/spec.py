"""What stands on the bench, in SI units: links, joints, motors, obstacles, switches. Values only."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planarm_sim.errors import UsageError

__all__ = ["CircleObstacle", "Joint", "LimitSwitch", "Link", "Motor", "PolygonObstacle", "Rig", "desk_arm"]

Point = tuple[float, float]

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid link.

    Attributes:
        length_m: from its inner to its outer joint.
        mass_kg: of the link alone.
        com_m: centre of mass, from the inner joint along the link.
        inertia_kg_m2: about the centre of mass.
        end_mass_kg: point mass at the outer end.
        width_m: of the body that hits obstacles: a bar with round ends.
    """

    length_m: float
    mass_kg: float
    com_m: float
    inertia_kg_m2: float
    end_mass_kg: float = 0.0
    width_m: float = 0.0

    @classmethod
    def rod(cls, length_m: float, mass_kg: float, end_mass_kg: float = 0.0, width_m: float = 0.0) -> Link:
        """Return a thin homogeneous rod."""
        return cls(length_m, mass_kg, 0.5 * length_m, mass_kg * length_m**2 / 12.0, end_mass_kg, width_m)


@dataclass(frozen=True, slots=True)
class Joint:
    """A revolute joint.

    Attributes:
        coulomb_nm: dry friction.
        viscous_nm_s: friction for 1 rad/s.
        stops_rad: hard stops; infinite where there is none.
    """

    coulomb_nm: float = 0.0
    viscous_nm_s: float = 0.0
    stops_rad: tuple[float, float] = (-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Motor:
    """A two-phase hybrid stepper, its supply, and the gear behind it.

    Attributes:
        steps_per_rev: full steps of a turn.
        holding_torque_nm: both phases at the rated current.
        rated_current_a: of a phase.
        current_a: the driver's setting: peak of a phase's current over the micro-steps.
        resistance_ohm: of a phase.
        inductance_h: of a phase.
        supply_v: motor supply.
        rotor_inertia_kg_m2: of the rotor.
        detent_torque_nm: without current.
        damping_nm_s: eddy currents and bearings, for 1 rad/s of the rotor; makers do not state it.
        coulomb_nm: dry friction of the rotor.
        gear_ratio: turns of the motor for one behind the gear.
        reversed: the motor's positive sense turns the gear's output the negative way.
        backlash_rad: whole play of the gear, at its output.
        stiffness_nm_rad: of the gear or belt, at its output.
        stiffness_damping_nm_s: of the gear or belt, at its output, for 1 rad/s; None: 5 % of critical for the rotor.
    """

    steps_per_rev: int = 200
    holding_torque_nm: float = 0.40
    rated_current_a: float = 1.7
    current_a: float = 1.2
    resistance_ohm: float = 1.5
    inductance_h: float = 2.8e-3
    supply_v: float = 24.0
    rotor_inertia_kg_m2: float = 5.4e-6
    detent_torque_nm: float = 0.022
    damping_nm_s: float = 3e-4
    coulomb_nm: float = 0.0
    gear_ratio: float = 1.0
    reversed: bool = False
    backlash_rad: float = 0.0
    stiffness_nm_rad: float = 1000.0
    stiffness_damping_nm_s: float | None = None

    @property
    def torque_constant_nm_a(self) -> float:
        """Torque of one ampere in the phase that pulls best: holding torque comes from both, sqrt(2) times that."""
        return self.holding_torque_nm / (math.sqrt(2.0) * self.rated_current_a)

    @property
    def peak_torque_nm(self) -> float:
        """Largest torque at standstill with the driver's current."""
        return self.torque_constant_nm_a * self.current_a

    @property
    def corner_steps_s(self) -> float:
        """V / (2 L I): full steps a second at which the current just manages to reverse within a step."""
        return self.supply_v / (2.0 * self.inductance_h * self.current_a)

    @property
    def output_damping_nm_s(self) -> float:
        """Damping of the gear or belt, at its output."""
        if self.stiffness_damping_nm_s is not None:
            return self.stiffness_damping_nm_s
        reflected = self.rotor_inertia_kg_m2 * self.gear_ratio**2
        return 2.0 * 0.05 * math.sqrt(self.stiffness_nm_rad * reflected)


@dataclass(frozen=True, slots=True)
class CircleObstacle:
    """A round post."""

    center_m: Point
    radius_m: float


@dataclass(frozen=True, slots=True)
class PolygonObstacle:
    """A convex or concave simple polygon."""

    vertices_m: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class LimitSwitch:
    """A switch that a joint presses.

    Attributes:
        joint: number from 0.
        pin: on the board; low while the contact is closed, else a resistor holds it high.
        at_rad: joint angle from which on it is pressed.
        above: pressed at and beyond `at_rad` when True, at and below it when False.
        bounce_s: how long the contact chatters after each change.
        normally_closed: the contact opens when it is pressed; else it closes.
    """

    joint: int
    pin: str
    at_rad: float
    above: bool = False
    bounce_s: float = 0.001
    normally_closed: bool = False


@dataclass(frozen=True, slots=True)
class Rig:
    """An arm with its motors in its room.

    Attributes:
        links: from the base.
        joints: one a link.
        motors: one a joint, or none at all.
        start_rad: joint angles at the start; all is at rest, and the drivers' phases are where the rotors are.
        zero_rad: joint angles at which the motors stand at micro-step 0.
        coupling: row m says how far motor m turns, behind its gear, when each joint turns once; None: its own joint.
        gravity_m_s2: along -y; 0 for an arm that lies flat.
        base_m: where joint 1 stands.
        obstacles: what the links can hit.
        switches: limit switches.
    """

    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    motors: tuple[Motor, ...]
    start_rad: tuple[float, ...]
    zero_rad: tuple[float, ...] = ()
    coupling: tuple[tuple[float, ...], ...] | None = None
    gravity_m_s2: float = 0.0
    base_m: Point = (0.0, 0.0)
    obstacles: tuple[CircleObstacle | PolygonObstacle, ...] = ()
    switches: tuple[LimitSwitch, ...] = field(default=())

    def __post_init__(self) -> None:
        count = len(self.links)
        if not count or not len(self.joints) == len(self.start_rad) == count or len(self.motors) not in (0, count):
            raise UsageError(
                f"a rig has as many joints, motors and start angles as links: {count} links, {len(self.joints)} "
                f"joints, {len(self.motors)} motors, {len(self.start_rad)} start angles"
            )
        last = self.links[-1]
        if not (last.inertia_kg_m2 or last.mass_kg * last.com_m or last.end_mass_kg):
            raise UsageError(
                "the last link has no inertia about its joint: give it mechanics.link_inertias_kg_m2 or "
                "mechanics.end_masses_kg, or mechanics.link_com_share above 0"
            )
        if np.linalg.matrix_rank(self.coupling_matrix) < count:
            raise UsageError("the coupling matrix has no inverse: the motors would not determine the joints")

    @property
    def coupling_matrix(self) -> NDArray[np.float64]:
        """The coupling as an array, shape (motors, joints)."""
        return np.eye(len(self.links)) if self.coupling is None else np.array(self.coupling, dtype=float)

    @property
    def zeros(self) -> NDArray[np.float64]:
        """`zero_rad` as an array, zeros when not given."""
        return np.array(self.zero_rad or (0.0,) * len(self.links))


def desk_arm(motors: int) -> Rig:
    """Return a light arm that lies on a desk, one link a motor, each motor straight on its joint."""
    link = Link.rod(0.1, 0.03)
    joint = Joint(coulomb_nm=0.005, viscous_nm_s=0.002)
    return Rig((link,) * motors, (joint,) * motors, (Motor(),) * motors, (0.0,) * motors)
