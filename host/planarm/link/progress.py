"""How far a stream is, as it is told to whoever watches."""

from planarm.link.course import Course
from planarm.link.session import Session
from planarm.link.stream_values import StreamProgress
from planarm_wire.messages import Status


def progress_of(course: Course, session: Session, status: Status, sent: int, now_s: float) -> StreamProgress:
    """Return how far a motion is by a status, of which so many segments were sent."""
    return StreamProgress(
        path_s=course.between_s(0, course.executed),
        total_s=course.total_s,
        executed_segments=course.executed,
        total_segments=len(course.segments),
        queued_segments=sent - course.executed,
        queued_s=course.between_s(course.executed, sent),
        moved_usteps=course.moved_usteps(status.ledger),
        state=status.state,
        at_s=now_s,
        free_bytes=status.free_bytes,
        retransmissions=session.arq_counters.retransmissions,
        rate_percent=status.rate_percent,
        made_s=session.made_s,
        path_span_s=course.span_s(status.ledger),
        resent=tuple(session.resent),
    )
