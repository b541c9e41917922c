"""What a path asks of each motor, as a function of the path's speed and acceleration.

Behind its gear, motor m has to give a_m s'' + b_m s'^2 + v_m s' + h_m: inertia of arm and rotors, centrifugal terms,
viscous friction, and what holds the arm against gravity and Coulomb friction; it turns at w_m s'. The path is run
forwards, s' >= 0.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from planarm.dynamics.pull_out import Drives
from planarm.dynamics.rigid_body import RigidBody, path_torques
from planarm.scene import Scene

Floats = NDArray[np.float64]


class Load(NamedTuple):
    """An arm's masses and the motors that move them."""

    body: RigidBody
    drives: Drives

    @classmethod
    def of(cls, scene: Scene, torque_share: float) -> Self:
        """Return the load of a scene, of whose pull-out torque a share may be used."""
        return cls(RigidBody.of(scene), Drives.of(scene, torque_share))


class MotorTerms(NamedTuple):
    """The terms of the module's text along a path, each of shape (points, motors), in N m by the path's unit."""

    a: Floats
    b: Floats
    v: Floats
    h: Floats
    w: Floats


def motor_terms(load: Load, q_rad: Floats, dq_rad: Floats, ddq_rad: Floats, senses: Floats) -> MotorTerms:
    """Return the terms for angles and their derivatives by the path parameter, each of shape (points, joints).

    `senses` holds -1, 0 or 1 for each joint's sense of turning, which Coulomb friction opposes: where a joint turns
    back, its rate is zero and only the caller knows from which side it looks.
    """
    body, drives = load
    a, b, g = path_torques(body, q_rad, dq_rad, ddq_rad)
    rotors = drives.rotors_kg_m2
    at_joints = (
        a + dq_rad @ rotors,
        b + ddq_rad @ rotors,
        dq_rad * drives.viscous_nm_s,
        g + senses * drives.coulomb_nm,
    )
    a, b, v, h = (np.ascontiguousarray(term @ drives.to_motors.T) for term in at_joints)
    return MotorTerms(a, b, v, h, dq_rad @ drives.coupling.T)
