"""What is streamed: segments, and where the joints stand before them."""

from dataclasses import dataclass

from planarm_wire.messages import Segment


@dataclass(frozen=True, slots=True)
class Allowance:
    """How the path clock may change in one segment, and the path time to rest from its start."""

    slow_per_s: float
    fast_per_s: float
    need_ticks: float


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
