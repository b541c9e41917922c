"""Maps of the workspace: tip error, step rate and manipulability of each cell."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planarm.model.arm import Arm
from planarm.model.kinematics import ElbowSide, inverse_2r, tip_jacobian
from planarm.model.transmission import Transmission
from planarm.scene import Scene
from planarm.stepping.train import largest_rate_hz

Floats = NDArray[np.float64]

SINGULAR_SHARE = 1e-6
"""A pose with less of the largest manipulability, l1 l2, is straight or folded: the tip cannot go in all directions."""


@dataclass(frozen=True, slots=True, eq=False)
class EnvelopeMaps:
    """Figures of the arm with its tip on each node of the workspace's grid; NaN where it cannot be.

    Rates and speeds are NaN in singular poses, too.

    Every array has shape (rows, columns), rows along y.

    Attributes:
        x_cm: the columns.
        y_cm: the rows.
        tip_error_mm: how far half a micro-step of every motor and half the play of every gear can put the tip, at most.
        hz_per_cm_s: step rate of the busiest motor for 1 cm/s of the tip, in the direction that asks most.
        largest_cm_s: speed of the tip in that direction at which a joint reaches its limit or a motor the board's rate.
        manipulability_cm2: |det J|, 0 where the arm is straight or folded (Yoshikawa 1985).
    """

    x_cm: Floats
    y_cm: Floats
    tip_error_mm: Floats
    hz_per_cm_s: Floats
    largest_cm_s: Floats
    manipulability_cm2: Floats


def envelope_maps(scene: Scene, elbow: ElbowSide) -> EnvelopeMaps:
    """Return the maps of a two-link arm on one elbow side; joint limits count, obstacles do not."""
    arm = Arm.from_spec(scene.arm)
    cell = scene.workspace.cell_cm
    x_cm = cell * np.array(scene.workspace.columns, np.float64)
    y_cm = cell * np.array(scene.workspace.rows, np.float64)
    q_rad = inverse_2r(arm, np.stack(np.meshgrid(x_cm, y_cm), axis=-1), elbow)
    limits = np.array(arm.joint_limits_rad)
    within = np.asarray(((q_rad >= limits[:, 0]) & (q_rad <= limits[:, 1])).all(axis=-1))
    q_rad = np.where(within[..., None], q_rad, np.nan)
    jacobian = tip_jacobian(arm, q_rad)
    determinant = np.abs(np.linalg.det(np.where(within[..., None, None], jacobian, np.eye(2))))
    singular: NDArray[np.bool_] = determinant < SINGULAR_SHARE * np.prod(arm.link_lengths_cm)
    with np.errstate(divide="ignore", invalid="ignore"):
        joints_per_cm = np.where(singular[..., None, None], np.nan, _inverse_2x2(jacobian))
        joint_rates = np.linalg.norm(joints_per_cm, axis=-1)
        motor_rates = np.linalg.norm(Transmission.of(scene).usteps_per_rad @ joints_per_cm, axis=-1)
        speeds = np.array([joint.max_speed_rad_s for joint in scene.joints])
        largest = np.minimum(
            (speeds / joint_rates).min(axis=-1), (largest_rate_hz(scene.board) / motor_rates).min(axis=-1)
        )
    return EnvelopeMaps(
        x_cm,
        y_cm,
        10.0 * tip_error_cm(scene, jacobian),
        motor_rates.max(axis=-1),
        largest,
        np.where(within, determinant, np.nan),
    )


def tip_error_cm(scene: Scene, jacobian_cm: Floats) -> Floats:
    """Return the bound of the tip's error at poses with Jacobians of shape (..., 2, joints), in cm."""
    per_ustep = jacobian_cm @ Transmission.of(scene).rad_per_ustep
    steps = 0.5 * np.linalg.norm(per_ustep, axis=-2).sum(axis=-1)
    play = 0.5 * np.linalg.norm(jacobian_cm, axis=-2) @ np.array(scene.mechanics.backlash_rad)
    return np.asarray(steps + play)


def _inverse_2x2(matrix: Floats) -> Floats:
    """Return the inverses; infinite or NaN where there is none."""
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    rows = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2)
    return np.asarray(rows / (a * d - b * c)[..., None, None])
