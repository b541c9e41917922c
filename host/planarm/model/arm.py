"""A planar arm with any number of links."""

from dataclasses import dataclass
from typing import Self

from planarm.scene import ArmSpec


@dataclass(frozen=True, slots=True)
class Arm:
    """Links from the base outwards, where the base stands, and each joint's range.

    Joint angles are relative: theta1 from the x axis, each further one from the link before it, all positive
    counter-clockwise.
    """

    link_lengths_cm: tuple[float, ...]
    base_cm: tuple[float, float]
    joint_limits_rad: tuple[tuple[float, float], ...]

    @classmethod
    def from_spec(cls, spec: ArmSpec) -> Self:
        """Return the arm that a scene describes."""
        return cls(spec.link_lengths_cm, spec.base_cm, spec.joint_limits_rad)

    @property
    def links(self) -> int:
        """The number of links, which is the number of joints."""
        return len(self.link_lengths_cm)

    @property
    def reach_cm(self) -> float:
        """The end effector's greatest distance from the base."""
        return sum(self.link_lengths_cm)
