"""What a plan may ask of the joints: speed, acceleration, and the torque that the motors have at each speed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from planarm.dynamics.motor_terms import Load
from planarm.errors import TimingError
from planarm.scene import JointSpec, Scene
from planarm.smoothing.smooth_path import Floats

STOPPING_SHARE = 0.8
"""Share of each joint's acceleration that a plan uses; what is left keeps a stop along the path possible."""

HEADROOM = 1.0 - 1e-4
"""Planned share of each limit. The dense check knows what happens between its points to second order; this covers the
rest many times."""


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of a plan.

    Attributes:
        speeds_rad_s: of each joint, shape (n,).
        accelerations_rad_s2: of each joint, with the share taken off, shape (n,).
        share: what the plan uses of each acceleration, and of the torque that gravity and friction leave.
        load: masses and motors; None when torque is not limited.
    """

    speeds_rad_s: Floats
    accelerations_rad_s2: Floats
    share: float
    load: Load | None = None

    @classmethod
    def of_joints(cls, joints: Sequence[JointSpec], share: float = STOPPING_SHARE, load: Load | None = None) -> Self:
        """Return what a plan may use of the joints' limits.

        Raises:
            TimingError: a limit is no finite number above 0, or the share is not in (0, 1].
        """
        if not 0.0 < share <= 1.0:
            raise TimingError(f"the share of the acceleration is {share}; it must be above 0 and at most 1")
        for number, joint in enumerate(joints, start=1):
            for key, value in (
                ("max_speed_deg_s", np.degrees(joint.max_speed_rad_s)),
                ("max_acceleration_deg_s2", np.degrees(joint.max_acceleration_rad_s2)),
            ):
                if not (np.isfinite(value) and value > 0.0):
                    raise TimingError(
                        f"joint {number} cannot be timed: joints[{number}].{key} is {value}; set it above 0"
                    )
        return cls(
            HEADROOM * np.array([joint.max_speed_rad_s for joint in joints]),
            HEADROOM * share * np.array([joint.max_acceleration_rad_s2 for joint in joints]),
            HEADROOM * share,
            load,
        )

    @classmethod
    def of(cls, scene: Scene, share: float | None = None) -> Self:
        """Return what a plan of this scene may use; `share` in the place of the scene's own.

        Raises:
            TimingError: a limit is no finite number above 0.
        """
        motion = scene.motion
        load = Load.of(scene, motion.torque_share)
        return cls.of_joints(scene.joints, motion.acceleration_share if share is None else share, load)

    @property
    def acceleration_share(self) -> float:
        """The share of the acceleration as it was asked for, without the headroom."""
        return self.share / HEADROOM

    @property
    def joints(self) -> int:
        """The number of joints."""
        return len(self.speeds_rad_s)
