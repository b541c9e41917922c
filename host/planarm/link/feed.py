"""Keeps the device's queue full: what may be sent, and when the device can take more.

The queue is filled by credit: a reply tells the free bytes at the moment of its acknowledgement, so what may still be
sent is that number less what is in flight.
"""

from bisect import bisect_left
from collections.abc import Sequence

from planarm.errors import CertificateError
from planarm.link.course import Course
from planarm.link.packing import Packer
from planarm.link.plan_steps import LOOK_AHEAD
from planarm.link.session import Session
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import TICKS_HZ, Segment, State, Status
from planarm_wire.rates import Allowance


class Feed:
    """Sends a course's segments as the device's queue takes them.

    Args:
        session: where they go.
        course: the motion.
        allowances: one a segment, or none.
        ahead_s: how much path the device is given beyond what a stop takes; None: what its queue holds.

    Attributes:
        allowances: those of the course's segments.
    """

    def __init__(
        self, session: Session, course: Course, allowances: Sequence[Allowance], ahead_s: float | None
    ) -> None:
        self.allowances = tuple(allowances)
        self._session, self._course, self._ahead_s = session, course, ahead_s
        self._packer = Packer(session, course.segments, allowances)

    @property
    def sent(self) -> int:
        """Segments sent so far."""
        return self._packer.sent

    def join_at(self, sent: int) -> None:
        """Go on behind so many segments, which an earlier session sent."""
        self._packer.sent = sent

    def keep_back(self, first: int) -> None:
        """Send no segment from number `first` on until `go_on_with` tells others."""
        self._packer.keep_back(first)

    def go_on_with(self, segments: Sequence[Segment], allowances: Sequence[Allowance]) -> None:
        """Take other segments from here on, for the course, too; those that were sent are the same.

        Raises:
            CertificateError: they are not, or do not end as a plan does.
        """
        if tuple(segments[: self.sent]) != self._course.segments[: self.sent] or len(allowances) != len(segments):
            raise CertificateError(f"a plan to go on with has other segments than the {self.sent} that were sent")
        self._course.take(segments)
        self.allowances = tuple(allowances)
        self._packer.go_on_with(segments, allowances)

    def send(self, status: Status, now_s: float) -> None:
        """Send what the device has room for and is to have by now."""
        while (message := self._packer.next_message()) is not None:
            if self._packer.payload_bytes > self._credit_bytes(status) or not self._session.fits(message):
                return
            if self._wanted_from(status.state) > self._course.executed:
                return
            self._session.send(message, now_s)
            self._packer.take()

    def room_from(self, status: Status) -> int:
        """Return how many segments have to be executed until the device takes the next message, or has ended."""
        until = self._course.executed
        if self._packer.next_message() is None:
            return len(self._course.segments)
        # A segment gives its bytes back when it is begun.
        wanted_bytes = self._packer.payload_bytes - self._credit_bytes(status)
        while wanted_bytes > 0 and until < len(self._course.segments):
            wanted_bytes -= encoded_bytes(self._course.segments[until])
            until += 1
        return max(until, self._wanted_from(status.state))

    def _credit_bytes(self, status: Status) -> int:
        """Payload bytes that the device's queue still takes."""
        return status.free_bytes - self._session.room_in_flight

    def _wanted_from(self, state: State) -> int:
        """Return how many segments have to be executed before the device is to have the next."""
        if self._ahead_s is None or not self.allowances or state is State.STARVED:
            return 0
        executed, ends_ticks = self._course.executed, self._course.ends_ticks
        running = self.allowances[executed : executed + LOOK_AHEAD]
        need_ticks = max((allowance.need_ticks for allowance in running), default=0.0)
        ahead_ticks = need_ticks + self._ahead_s * TICKS_HZ
        return bisect_left(ends_ticks, ends_ticks[self.sent] - ahead_ticks)
