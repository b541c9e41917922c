"""`[mechanics]` and `[transmission]`: masses, friction and play of the arm, and which motor moves which joint."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, radians

import numpy as np

from planarm.scene.strict_toml import Table

MECHANICS_KEYS = (
    "gravity",
    "link_masses_kg",
    "link_com_share",
    "link_inertias_kg_m2",
    "end_masses_kg",
    "coulomb_friction_nm",
    "viscous_friction_nm_s",
    "backlash_deg",
    "stiffness_nm_rad",
    "hard_stops_deg",
)
TRANSMISSION_KEYS = ("coupling",)

LINK_KG_PER_CM = 0.004
"""A square aluminium tube of 20 x 20 x 2 mm weighs 0.39 kg a metre (144 mm^2, 2700 kg/m^3)."""
COULOMB_NM = 0.02
VISCOUS_NM_S = 0.05
STIFFNESS_NM_RAD = 1000.0
LARGEST_CONDITION = 1e6

Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class MechanicsSpec:
    """What moves, in SI units; one value a link or joint, from the base.

    Attributes:
        gravity: True when the arm stands upright and -y points down; False when it lies flat.
        link_masses_kg: of the links alone.
        link_com_share: where each link's centre of mass lies, as a share of its length from its inner joint.
        link_inertias_kg_m2: about each link's own centre of mass.
        end_masses_kg: point mass at each link's outer end: the next joint's motor; the last is the payload.
        coulomb_friction_nm: of each joint.
        viscous_friction_nm_s: of each joint, for 1 rad/s.
        backlash_rad: whole play of each motor's gear, seen at the joint.
        stiffness_nm_rad: of each motor's gear or belt, seen at the joint.
        hard_stops_rad: least and greatest angle that each joint can mechanically take; infinite where it turns freely.
    """

    gravity: bool
    link_masses_kg: tuple[float, ...]
    link_com_share: tuple[float, ...]
    link_inertias_kg_m2: tuple[float, ...]
    end_masses_kg: tuple[float, ...]
    coulomb_friction_nm: tuple[float, ...]
    viscous_friction_nm_s: tuple[float, ...]
    backlash_rad: tuple[float, ...]
    stiffness_nm_rad: tuple[float, ...]
    hard_stops_rad: tuple[tuple[float, float], ...]

    @classmethod
    def usual(cls, link_lengths_cm: tuple[float, ...]) -> MechanicsSpec:
        """Return what a scene without `[mechanics]` means: aluminium tubes on a table, no payload, no play."""
        table = Table("", "mechanics", {})
        return parse_mechanics(table, link_lengths_cm)


def parse_mechanics(table: Table, link_lengths_cm: tuple[float, ...]) -> MechanicsSpec:
    """Read the table; every key is optional.

    Raises:
        SceneError: a value is not what its key takes, or a list has not one entry a link.
    """
    links = len(link_lengths_cm)
    masses = _each(table, "link_masses_kg", [LINK_KG_PER_CM * length for length in link_lengths_cm], above=0.0)
    rods = [mass * (0.01 * length) ** 2 / 12.0 for mass, length in zip(masses, link_lengths_cm, strict=True)]
    return MechanicsSpec(
        gravity=table.flag("gravity", False),
        link_masses_kg=masses,
        link_com_share=_each(table, "link_com_share", [0.5] * links, at_most=1.0),
        link_inertias_kg_m2=_each(table, "link_inertias_kg_m2", rods),
        end_masses_kg=_each(table, "end_masses_kg", [0.0] * links),
        coulomb_friction_nm=_each(table, "coulomb_friction_nm", [COULOMB_NM] * links),
        viscous_friction_nm_s=_each(table, "viscous_friction_nm_s", [VISCOUS_NM_S] * links),
        backlash_rad=tuple(np.radians(_each(table, "backlash_deg", [0.0] * links, at_most=45.0)).tolist()),
        stiffness_nm_rad=_each(table, "stiffness_nm_rad", [STIFFNESS_NM_RAD] * links, above=0.0, at_most=1e7),
        hard_stops_rad=_hard_stops_rad(table, links),
    )


def _hard_stops_rad(table: Table, links: int) -> tuple[tuple[float, float], ...]:
    key = "hard_stops_deg"
    if key not in table.data:
        return ((-inf, inf),) * links
    stops = table.ranges(key, (), within=720.0)
    if len(stops) != links:
        table.reject(key, [list(stop) for stop in stops], f"one [least, greatest] for each of the {links} joints")
    return tuple((radians(least), radians(greatest)) for least, greatest in stops)


def parse_coupling(table: Table, joints: int) -> Matrix:
    """Read the coupling matrix: row m says how far motor m turns, behind its gear, when each joint turns once.

    Raises:
        SceneError: it is no matrix of one row and one column a joint, or it has no inverse.
    """
    key = "coupling"
    unit = tuple(tuple(float(i == j) for j in range(joints)) for i in range(joints))
    if key not in table.data:
        return unit
    rows = table.data[key]
    wanted = f"{joints} rows of {joints} numbers from -10 to 10, one row a motor, one number a joint,"
    if not isinstance(rows, list) or len(rows) != joints:
        table.reject(key, rows, wanted)
    matrix = tuple(_row(table, key, row, joints, wanted) for row in rows)
    if np.linalg.cond(np.array(matrix)) > LARGEST_CONDITION:
        table.fail(key, "has no inverse: the motors would not determine the joints; give independent rows")
    return matrix


def _row(table: Table, key: str, row: object, joints: int, wanted: str) -> tuple[float, ...]:
    if not isinstance(row, list) or len(row) != joints:
        table.reject(key, row, wanted)
    for number in row:
        if isinstance(number, bool) or not isinstance(number, int | float) or not -10.0 <= number <= 10.0:
            table.reject(key, number, wanted)
    return tuple(map(float, row))


def _each(
    table: Table, key: str, default: list[float], *, above: float | None = None, at_most: float = 1e4
) -> tuple[float, ...]:
    """Return a list with one number a link, at least 0 unless another limit is given."""
    return table.each(key, default, above=above, at_least=None if above is not None else 0.0, at_most=at_most)
