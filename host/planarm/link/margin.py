"""Whether the line carries a plan, by what it was seen to carry, before the motion starts.

The device's queue is filled first. The bytes that it took, over the time until they were acknowledged, are what line,
window, computer and disk carry together. From then on each segment has to arrive before it starts: its bytes, and those
of all before it that are not in the queue yet, within the path time until there. Where the line was not seen to carry
that, with something to spare, the path clock is told to run slower by as much, so that the queue never runs low.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import TICKS_HZ, Segment
from planarm_wire.steps import duration_ticks

FRAME_BYTES = 13
"""Header, two CRCs, delimiter, the head of SEGMENTS, and a byte in fifty stuffed."""
SEGMENTS_A_FRAME = 2
USABLE_SHARE = 0.9
"""Of what was seen: questions and answers take their part, and a line has bad moments."""
LEAST_SEEN_BYTES = 300


@dataclass(frozen=True, slots=True)
class Margin:
    """What a plan asks of the line, and what the line was seen to carry, both in bytes a second.

    Attributes:
        asked: by the plan, on average up to the segment that is hardest to bring in time.
        seen: that the device took while its queue was filled; None when that was too little to tell.
        motion_s: the plan's duration.
    """

    asked: float
    seen: float | None
    motion_s: float

    @property
    def percent(self) -> int:
        """The rate of the path clock at which the line carries the plan."""
        if self.seen is None or self.asked <= 0.0:
            return 100
        return max(1, min(100, int(100.0 * USABLE_SHARE * self.seen / self.asked)))

    def __str__(self) -> str:
        return (
            f"the line was seen to carry {self.seen or 0.0:.0f} bytes/s, the plan asks for {self.asked:.0f} and some"
            f" to spare: the motion runs at {self.percent} % of its speed and takes"
            f" {self.motion_s * 100 / self.percent:.1f} s instead of {self.motion_s:.1f} s"
        )


def line_margin(segments: Sequence[Segment], sent_segments: int, seen_bytes: int, seen_s: float) -> Margin:
    """Hold a plan against the line.

    Args:
        segments: the plan's.
        sent_segments: how many are in the queue already.
        seen_bytes: that the device took.
        seen_s: how long it took for that.
    """
    start_ticks = sum(duration_ticks(segment) for segment in segments[:sent_segments])
    missing_bytes, asked = 0.0, 0.0
    for segment in segments[sent_segments:]:
        missing_bytes += encoded_bytes(segment) + FRAME_BYTES / SEGMENTS_A_FRAME
        asked = max(asked, missing_bytes * TICKS_HZ / max(start_ticks, 1))
        start_ticks += duration_ticks(segment)
    seen = seen_bytes / seen_s if seen_bytes >= LEAST_SEEN_BYTES and seen_s > 0.0 else None
    return Margin(asked, seen, start_ticks / TICKS_HZ)
