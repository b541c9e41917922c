"""What stepper motors can give: pull-out torque over speed, and what of it reaches the joints.

The model, an estimate with a share to be set (`motion.torque_share`): below the corner speed the driver holds the
current, and with it the torque; above it the current no longer reaches its value within a full step, and the torque
falls as 1 / speed. The corner is V / (2 L I) full steps a second: in half a period of two full steps the current has to
swing from -I to I, at a rate of V / L. Published formulas differ widely, so a share of about half of the torque is used
unless a bench says more.

Motor m turns, behind its gear, by sum over j of coupling[m, j] q_j, so a torque u behind the gears is coupling^T u at
the joints.
"""

from math import pi
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from planarm.scene import JointSpec, Scene
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]


class Drives(NamedTuple):
    """The motors of an arm behind their gears, as kernels read them; m motors, n joints, m = n."""

    flat_nm: Floats
    """Torque below the corner speed, with the share that may be used, shape (m,)."""
    corner_rad_s: Floats
    """Speed above which the torque falls as 1 / speed, shape (m,)."""
    coupling: Floats
    """How far each motor turns, behind its gear, when each joint turns once, shape (m, n)."""
    to_motors: Floats
    """Joint torques to motor torques: the inverse transpose of the coupling, shape (m, n)."""
    rotors_kg_m2: Floats
    """The rotors' inertia seen from the joints, shape (n, n), symmetric."""
    coulomb_nm: Floats
    """Friction of each joint that does not depend on speed, shape (n,)."""
    viscous_nm_s: Floats
    """Friction of each joint that grows with speed, shape (n,)."""

    @classmethod
    def of(cls, scene: Scene, torque_share: float) -> Self:
        """Return the motors of a scene, of whose torque a share may be used."""
        coupling = np.array(scene.coupling, np.float64)
        gears = np.array([joint.gear_ratio for joint in scene.joints])
        rotors = np.array([joint.motor.rotor_inertia_kg_m2 for joint in scene.joints])
        return cls(
            flat_nm=torque_share * gears * np.array([joint.motor.peak_torque_nm for joint in scene.joints]),
            corner_rad_s=np.array([corner_rad_s(joint) for joint in scene.joints]),
            coupling=coupling,
            to_motors=np.ascontiguousarray(np.linalg.inv(coupling).T),
            rotors_kg_m2=coupling.T @ ((rotors * gears**2)[:, None] * coupling),
            coulomb_nm=np.array(scene.mechanics.coulomb_friction_nm),
            viscous_nm_s=np.array(scene.mechanics.viscous_friction_nm_s),
        )


def corner_rad_s(joint: JointSpec) -> float:
    """Return the corner speed of a joint's motor behind its gear: V / (2 L I) full steps a second."""
    motor = joint.motor
    steps_per_s = motor.supply_v / (2.0 * motor.inductance_h * motor.current_a)
    return steps_per_s * 2.0 * pi / (joint.steps_per_rev * joint.gear_ratio)


@kernel
def pull_out_nm(drives: Drives, motor: int, speed_rad_s: float) -> float:
    """Return the torque that a motor can give behind its gear at a speed there, either sense."""
    corner, speed = drives.corner_rad_s[motor], abs(speed_rad_s)
    return float(drives.flat_nm[motor] * (1.0 if speed <= corner else corner / speed))
