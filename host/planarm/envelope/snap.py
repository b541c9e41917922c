"""The micro-step pose whose tip is nearest to a point."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from planarm.errors import SceneError
from planarm.model.arm import Arm
from planarm.model.kinematics import ElbowSide, forward, inverse_2r
from planarm.model.transmission import Transmission
from planarm.scene import Point, Scene

NEIGHBOURS = 2
"""Micro-steps to each side of the exact pose that are looked at: where the lattice is skewed the nearest pose in the
plane need not be one of the four around the exact one."""


@dataclass(frozen=True, slots=True)
class Snapped:
    """A point and what the motors can make of it.

    Attributes:
        wanted_cm: the point.
        tip_cm: the tip at the best micro-step pose.
        usteps: where the motors stand then.
        error_mm: distance of the two.
        rounded_error_mm: distance where each motor just takes its nearest micro-step.
    """

    wanted_cm: Point
    tip_cm: Point
    usteps: tuple[int, ...]
    error_mm: float
    rounded_error_mm: float


def snap(scene: Scene, point_cm: Point, elbow: ElbowSide) -> Snapped:
    """Return the best micro-step pose near the exact one, within the joints' limits.

    Raises:
        SceneError: the arm does not reach the point.
    """
    arm, transmission = Arm.from_spec(scene.arm), Transmission.of(scene)
    exact = transmission.usteps(inverse_2r(arm, point_cm, elbow))
    if not np.isfinite(exact).all():
        raise SceneError(scene.source, "task", f"{list(point_cm)} is out of reach; move it nearer to the base")
    nearest = np.floor(exact + 0.5)
    offsets = np.array(list(product(range(-NEIGHBOURS, NEIGHBOURS + 1), repeat=len(nearest))))
    candidates = nearest + offsets
    q_rad = transmission.q_rad(candidates)
    limits = np.array(arm.joint_limits_rad)
    allowed = ((q_rad >= limits[:, 0]) & (q_rad <= limits[:, 1])).all(axis=1)
    allowed |= (offsets == 0).all(axis=1)  # a pose on a limit may be rounded beyond it, as plans do
    tips = forward(arm, q_rad)[:, -1]
    errors = np.where(allowed, np.hypot(*(tips - point_cm).T), np.inf)
    best, rounded = int(errors.argmin()), int((offsets == 0).all(axis=1).argmax())
    return Snapped(
        point_cm,
        (float(tips[best, 0]), float(tips[best, 1])),
        tuple(int(n) for n in candidates[best]),
        10.0 * float(errors[best]),
        10.0 * float(errors[rounded]),
    )
