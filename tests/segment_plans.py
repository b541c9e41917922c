"""Plans written down segment by segment, and how the certificate's checks of them are looked up."""

from planarm.stepping.plan import SegmentPlan
from planarm_wire.messages import Move, Segment

REST = Move(0)


def plan_of(*segments):
    """A plan of (duration, move of joint 1, move of joint 2); the last one is flagged."""
    last = len(segments) - 1
    made = tuple(Segment(2 * duration + (k == last), tuple(moves)) for k, (duration, *moves) in enumerate(segments))
    return SegmentPlan(made, sum(s.duration_flags >> 1 for s in made), (0, 0))


def verdict_of(checks, name):
    (found,) = (check.verdict for check in checks if name in check.name)
    return found
