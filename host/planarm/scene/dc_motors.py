"""`[dc_motors]`: DC motors on the joints, as paper A has them; what its Table 7 lacks stands here.

The defaults are those of a brushed 24 V motor of the 60 W class behind a gear of 1 : 100. One constant serves as torque
constant (N m/A) and as that of the back-EMF (V s/rad): in SI units they are equal in an ideal motor.
"""

from __future__ import annotations

from dataclasses import dataclass

from planarm.scene.motor import KG_M2_PER_G_CM2
from planarm.scene.strict_toml import Table

DC_MOTOR_KEYS = (
    "resistance_ohm",
    "inductance_mh",
    "torque_constant_nm_a",
    "rotor_inertia_g_cm2",
    "rotor_viscous_nm_s",
    "gear_ratio",
    "p_gain_v_rad",
    "d_gain_v_s_rad",
)


@dataclass(frozen=True, slots=True)
class DcMotorSpec:
    """The motors in SI units, one value a joint, from the base.

    Attributes:
        resistance_ohm: of the winding.
        inductance_h: of the winding.
        torque_constant_nm_a: torque for 1 A, and volts of back-EMF for 1 rad/s.
        rotor_inertia_kg_m2: of the rotor alone.
        rotor_viscous_nm_s: of the rotor alone, for 1 rad/s of it.
        gear_ratio: turns of the motor for one of the joint.
        p_gain_v_rad: volts for a radian of error of the joint.
        d_gain_v_s_rad: volts for 1 rad/s of error of the joint.
    """

    resistance_ohm: tuple[float, ...]
    inductance_h: tuple[float, ...]
    torque_constant_nm_a: tuple[float, ...]
    rotor_inertia_kg_m2: tuple[float, ...]
    rotor_viscous_nm_s: tuple[float, ...]
    gear_ratio: tuple[float, ...]
    p_gain_v_rad: tuple[float, ...]
    d_gain_v_s_rad: tuple[float, ...]

    @classmethod
    def usual(cls, joints: int) -> DcMotorSpec:
        """Return what a scene without `[dc_motors]` means."""
        return parse_dc_motors(Table("", "dc_motors", {}), joints)


def parse_dc_motors(table: Table, joints: int) -> DcMotorSpec:
    """Read the table; every key is optional, each a list with one number a joint.

    Raises:
        SceneError: a value is not what its key takes.
    """

    def each(key: str, default: float, *, above: float | None = None, at_most: float) -> tuple[float, ...]:
        at_least = None if above is not None else 0.0
        return table.each(key, [default] * joints, above=above, at_least=at_least, at_most=at_most)

    return DcMotorSpec(
        resistance_ohm=each("resistance_ohm", 0.6, above=0.0, at_most=1000.0),
        inductance_h=tuple(1e-3 * x for x in each("inductance_mh", 0.12, above=0.0, at_most=1000.0)),
        torque_constant_nm_a=each("torque_constant_nm_a", 0.026, above=0.0, at_most=100.0),
        rotor_inertia_kg_m2=tuple(KG_M2_PER_G_CM2 * x for x in each("rotor_inertia_g_cm2", 33.0, at_most=1e6)),
        rotor_viscous_nm_s=each("rotor_viscous_nm_s", 3e-6, at_most=10.0),
        gear_ratio=each("gear_ratio", 100.0, above=0.0, at_most=10_000.0),
        p_gain_v_rad=each("p_gain_v_rad", 200.0, at_most=1e6),
        d_gain_v_s_rad=each("d_gain_v_s_rad", 5.0, at_most=1e6),
    )
