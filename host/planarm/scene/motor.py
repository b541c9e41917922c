"""`[joints.motor]`: the stepper motor of a joint, what its driver is set to, and what feeds it.

The defaults are those of a common NEMA 17 motor, 17HS4401: 1.8 degrees, 1.7 A, 1.5 ohm, 2.8 mH, 0.40 N m holding
torque, 0.022 N m detent torque, 54 g cm^2 (MotionKing's catalogue of the 17HS series), at 1.2 A and 24 V.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from planarm.scene.strict_toml import Table

KEYS = (
    "holding_torque_nm",
    "rated_current_a",
    "current_a",
    "resistance_ohm",
    "inductance_mh",
    "supply_v",
    "rotor_inertia_g_cm2",
    "detent_torque_nm",
    "damping_nm_s",
)
KG_M2_PER_G_CM2 = 1e-7
USUAL_DAMPING_NM_S = 3e-4
"""Of the default motor."""


@dataclass(frozen=True, slots=True)
class MotorSpec:
    """A two-phase hybrid stepper and its supply, in SI units.

    Attributes:
        holding_torque_nm: with both phases at the rated current.
        rated_current_a: of a phase, both energised.
        current_a: what the driver is set to: the peak of a phase's current over the micro-steps.
        resistance_ohm: of a phase.
        inductance_h: of a phase.
        supply_v: of the driver's motor supply.
        rotor_inertia_kg_m2: of the rotor alone.
        detent_torque_nm: without current.
        damping_nm_s: torque that the rotor loses for 1 rad/s; None where it is not known: see `rotor_damping_nm_s`.
    """

    holding_torque_nm: float = 0.40
    rated_current_a: float = 1.7
    current_a: float = 1.2
    resistance_ohm: float = 1.5
    inductance_h: float = 2.8e-3
    supply_v: float = 24.0
    rotor_inertia_kg_m2: float = 5.4e-6
    detent_torque_nm: float = 0.022
    damping_nm_s: float | None = None

    @property
    def rotor_damping_nm_s(self) -> float:
        """Damping of the rotor: as given, else the same share of critical, 1.4 % at holding torque, for every motor.

        Data sheets do not give it. A rotor alone rings for some ten periods after a step, which is 1 to 3 %.
        """
        if self.damping_nm_s is not None:
            return self.damping_nm_s
        usual = MotorSpec()
        size = self.holding_torque_nm * self.rotor_inertia_kg_m2
        return USUAL_DAMPING_NM_S * sqrt(size / (usual.holding_torque_nm * usual.rotor_inertia_kg_m2))

    @property
    def peak_torque_nm(self) -> float:
        """Largest torque at standstill with the current that the driver is set to.

        Holding torque is specified with both phases at the rated current, a vector of sqrt(2) times that; over the
        micro-steps the vector's length is the driver's peak current.
        """
        return self.holding_torque_nm * self.current_a / (sqrt(2.0) * self.rated_current_a)


def parse_motor(table: Table) -> MotorSpec:
    """Read the table; every key is optional.

    Raises:
        SceneError: a value is not what its key takes.
    """
    default = MotorSpec()
    motor = MotorSpec(
        holding_torque_nm=table.number("holding_torque_nm", default.holding_torque_nm, above=0.0, at_most=1000.0),
        rated_current_a=table.number("rated_current_a", default.rated_current_a, above=0.0, at_most=100.0),
        current_a=table.number("current_a", default.current_a, above=0.0, at_most=100.0),
        resistance_ohm=table.number("resistance_ohm", default.resistance_ohm, above=0.0, at_most=1000.0),
        inductance_h=1e-3 * table.number("inductance_mh", 1e3 * default.inductance_h, above=0.0, at_most=1000.0),
        supply_v=table.number("supply_v", default.supply_v, above=0.0, at_most=400.0),
        rotor_inertia_kg_m2=KG_M2_PER_G_CM2
        * table.number("rotor_inertia_g_cm2", default.rotor_inertia_kg_m2 / KG_M2_PER_G_CM2, at_least=0.1, at_most=1e6),
        detent_torque_nm=table.number("detent_torque_nm", default.detent_torque_nm, at_least=0.0, at_most=1000.0),
        damping_nm_s=table.number("damping_nm_s", 0.0, at_least=0.0, at_most=10.0)
        if "damping_nm_s" in table.data
        else None,
    )
    if motor.supply_v <= motor.resistance_ohm * motor.current_a:
        table.fail(
            "supply_v",
            f"{motor.supply_v:g} V cannot drive {motor.current_a:g} A through {motor.resistance_ohm:g} ohm; raise it "
            f"above {motor.resistance_ohm * motor.current_a:g} V, or lower current_a",
        )
    return motor
