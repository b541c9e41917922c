"""What is streamed: segments, and where the joints stand before them."""

from dataclasses import dataclass

from planarm_wire.messages import Segment
from planarm_wire.rates import Allowance

__all__ = ["Allowance", "SegmentPlan"]


@dataclass(frozen=True, slots=True)
class SegmentPlan:
    """A motion as the firmware executes it.

    Attributes:
        segments: in order; the last one is flagged. Empty when nothing moves.
        duration_ticks: sum of the segments' durations.
        start_usteps: each motor's position before the motion; `model.transmission` says where that puts the joints.
        allowances: of each segment (`planarm.stepping.stopping`); none in a plan that cannot be slowed down.
    """

    segments: tuple[Segment, ...]
    duration_ticks: int
    start_usteps: tuple[int, ...]
    allowances: tuple[Allowance, ...] = ()
