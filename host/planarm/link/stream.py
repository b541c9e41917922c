"""Streams a plan: asks, clears, enables, fills the queue, starts, keeps the queue full, and checks what was executed.

A machine of explicit phases on top of a `Session`; no I/O. `link.feed` keeps the device's queue full; when no message
is in flight the device is asked for its status, no sooner than the segments now executing can have made room for the
next message. `hold`, `resume`, `override` and `stop` may be called at any time (`link.orders`).
"""

from collections.abc import Callable, Sequence
from math import ceil

from planarm.errors import LinkError
from planarm.link.clock_sync import Span
from planarm.link.course import Course
from planarm.link.feed import Feed
from planarm.link.orders import Orders
from planarm.link.pace import PERCENT, Pace
from planarm.link.position import MissedStartError
from planarm.link.progress import progress_of
from planarm.link.session import Session
from planarm.link.stream_values import (
    AT_EASE,
    Joining,
    Phase,
    StreamOptions,
    StreamProgress,
    clear_drops_words,
    soft_limits_at,
)
from planarm_wire.messages import (
    QUEUE_FRAME_BYTES,
    TICKS_HZ,
    Clear,
    Enable,
    Fault,
    Query,
    Segment,
    Start,
    State,
    Status,
)
from planarm_wire.rates import Allowance
from planarm_wire.steps import duration_ticks
from planarm_wire.wirings import board_of

__all__ = ["AT_EASE", "PERCENT", "Joining", "Phase", "Stream", "StreamOptions", "StreamProgress"]

MIN_POLL_S = 0.002  # a status and its question take 1.5 ms of the line
MAX_POLL_S = 0.050  # keeps progress alive during long segments


class Stream:
    """Carries one plan out through `session`.

    `advance` is to be called after every `session.receive` and when `deadline_s` has passed. It raises LinkError when
    the device does not do what it acknowledged, StepsDifferError when the ledger does not show the plan's steps.
    Whoever steers a running motion says with `wake_s` when to be called again at the latest.
    """

    def __init__(
        self,
        session: Session,
        segments: Sequence[Segment],
        options: StreamOptions | None = None,
        on_progress: Callable[[StreamProgress], None] | None = None,
        joining: Joining | None = None,
        warn: Callable[[str], None] | None = None,
    ) -> None:
        self.course = Course(segments)
        self.phase = Phase.OPENING
        self.cleared_fault = Fault.NONE
        self.started_s = 0.0
        self.wake_s = float("inf")
        self.began_s: Span | None = None
        self.least_queued = len(segments)
        self.stopped = False
        self._start_sent_s, self._lead_ticks_sent = 0.0, 0
        self._awake_s = 0.0
        self._warn = warn
        self._session = session
        self._options = options or StreamOptions()
        self._board = board_of(len(segments[0].moves), self._options.wiring)
        self.pace = Pace(session, self._board, warn)
        self._on_progress = on_progress
        self._seen: Status | None = None
        self._told_resent = 0
        self._feed = Feed(session, self.course, self._options.allowances, self._options.ahead_s)
        self._orders = Orders(session, lambda: self.pace.order)
        self._joining = joining
        self._enabled = False

    @property
    def released_spread_usteps(self) -> tuple[int, ...]:
        """How far each joint can move while the drivers are released; empty: any way."""
        return self._options.released_spread_usteps

    @property
    def sent_segments(self) -> int:
        """Segments sent so far, those of an earlier session included."""
        return self._feed.sent

    @property
    def round_trip_s(self) -> float:
        """From a frame to its acknowledgement, as last measured; 0 before."""
        return self._session.round_trip_s

    @property
    def unasked_holds(self) -> int:
        """How often the device held by itself and was told to go on."""
        return self._orders.unasked_holds

    @property
    def done(self) -> bool:
        """Whether the plan was executed and checked."""
        return self.phase is Phase.DONE

    @property
    def total_segments(self) -> int:
        """Segments of the plan."""
        return len(self.course.segments)

    # -- what the owner may ask of a motion ---------------------------------------------------------------------------

    def hold(self) -> None:
        """Slow down along the path and rest there; in effect within a few milliseconds, whatever is in flight."""
        self._orders.hold()

    def resume(self) -> None:
        """Go on after a hold."""
        self._orders.resume()

    def override(self, percent: int) -> None:
        """Let the path clock run at 1 to 100 % of the planned rate, but no faster than the line carries the plan."""
        self.pace.asked_percent = percent
        self._orders.set_rate()

    def stop(self, *, quick: bool = False) -> None:
        """Slow down along the path and drop the rest of the plan; `stopped` tells when the arm rests."""
        self._orders.stop(quick=quick)

    def keep_back(self, first: int) -> None:
        """Send no segment from number `first` on until `go_on_with` tells others; those before have been, or will be.

        Where nothing comes in time the device slows down along its path and rests before that segment.
        """
        self._feed.keep_back(first)

    def go_on_with(self, segments: Sequence[Segment], allowances: Sequence[Allowance]) -> None:
        """Take another plan from here on: its segments that were sent are the same.

        Where the line does not carry what is left of it, or carries more than what was planned before, the path clock
        is told so.

        Raises:
            CertificateError: it has other first segments, or does not end as a plan does.
        """
        self._feed.go_on_with(segments, allowances)
        executed = self.course.executed
        if self.pace.set_again(self.course.segments[executed:], self._feed.allowances[executed:]):
            self._orders.set_rate()

    @property
    def deadline_s(self) -> float:
        """When `advance` must be called at the latest."""
        if self.phase is not Phase.RUNNING:
            return float("inf")
        return min(self.wake_s, self._poll_due_s(), self._stall_due_s()) if self._session.idle else self.wake_s

    def advance(self, now_s: float) -> None:
        """Do whatever is due."""
        self._follow(now_s)
        steps = {
            Phase.OPENING: self._ask,
            Phase.ASKING: self._prepare,
            Phase.CLEARING: self._configure,
            Phase.CONFIGURING: self._enable,
            Phase.ENABLING: self._begin_filling,
            Phase.FILLING: self._fill,
            Phase.STARTING: self._begin_running,
            Phase.RUNNING: self._run,
            Phase.RELEASING: self._finish,
        }
        while (step := steps.get(self.phase)) is not None:
            phase = self.phase
            step(now_s)
            if self.phase is phase:
                return

    # -- phases, in order ---------------------------------------------------------------------------------------------

    def _ask(self, now_s: float) -> None:
        if self._session.is_open:
            self._session.send(Query(), now_s)
            self.phase = Phase.ASKING

    def _prepare(self, now_s: float) -> None:
        """Drop what an earlier session left behind; drivers that are enabled with an empty queue are not touched."""
        if not self._session.idle:
            return
        self._session.require_board(self._board)
        status = self._status
        if self._joining is not None:
            self._join(self._joining, now_s)
            return
        if status.state in (State.RUNNING, State.HOMING, *AT_EASE):
            raise LinkError(
                "the device is executing the motion of an earlier session; wait until it has ended, then try again"
            )
        if status.state is State.FAULT and status.fault in self._options.kept_faults:
            raise LinkError(clear_drops_words(status.fault, self._options.falling))
        if status.state is State.FAULT or status.free_bytes < self._board.queue_bytes - QUEUE_FRAME_BYTES:
            self.cleared_fault = status.fault
            self._session.send(Clear(), now_s)
        self.phase = Phase.CLEARING

    def _join(self, joining: Joining, now_s: float) -> None:
        """Go on with a motion that the device is in the middle of."""
        if self._status.state not in (State.RUNNING, State.READY, *AT_EASE):
            raise LinkError(f"the device does not hold the motion any more: it is {self._status.state.name.lower()}")
        self._session.guarded = True
        self.course.before = joining.before
        self._feed.join_at(joining.accepted_segments)
        self.started_s = self.course.executed_s = now_s
        self.phase = Phase.RUNNING
        self._follow(now_s)

    def _configure(self, now_s: float) -> None:
        if not self._session.idle:
            return
        if self._status.state is State.IDLE and self._options.config is not None:
            self._session.send(self._options.config, now_s)
        limits = soft_limits_at(self._status.ledger, self._options, self._warn)
        if limits is not None:
            self._session.send(limits, now_s)
        self.phase = Phase.CONFIGURING

    def _enable(self, now_s: float) -> None:
        if not self._session.idle:
            return
        if self._status.state is not State.READY:
            self._session.send(Enable(1), now_s)
            self._enabled = True
        self.phase = Phase.ENABLING

    def _begin_filling(self, now_s: float) -> None:
        if not self._session.idle:
            return
        if self._status.state is not State.READY:
            raise LinkError(f"the device took ENABLE but reports {self._status.state.name.lower()}; reset the board")
        if self._enabled and self._options.config is not None:
            self._awake_s = now_s + self._options.config.wake_ticks / TICKS_HZ
        self._session.guarded = True
        self.course.before = self._status.ledger
        self.pace.begin_filling(now_s)
        self.phase = Phase.FILLING

    def _fill(self, now_s: float) -> None:
        self._feed.send(self._status, now_s)
        if self._session.idle:  # the queue is full, or the whole plan is in it
            self.pace.set(self.course.segments, self.sent_segments, self._feed.allowances, now_s)
            if self._status.override_percent != self.pace.order.percent:
                self._session.send(self.pace.order, now_s)
            self._start_sent_s, self._lead_ticks_sent = now_s, self._lead_ticks(now_s)
            self._session.send(Start(self._lead_ticks_sent), now_s)
            self.phase = Phase.STARTING

    def _lead_ticks(self, now_s: float) -> int:
        """Return the time from START to the first segment, which the drivers are awake for."""
        start_at_s, least = self._options.start_at_s, self._least_lead_ticks(now_s)
        left = least if start_at_s is None else round((start_at_s - now_s) * TICKS_HZ)
        if left < least:
            assert start_at_s is not None, "the least lead is never missed"
            raise MissedStartError(start_at_s, now_s, least / TICKS_HZ)
        return left

    def _least_lead_ticks(self, now_s: float) -> int:
        return max(self._options.lead_ticks, ceil((self._awake_s - now_s) * TICKS_HZ))

    def _begin_running(self, now_s: float) -> None:
        if self._session.idle:
            self.started_s = self.course.executed_s = now_s
            lead_s = self._lead_ticks_sent / TICKS_HZ
            self.began_s = Span(self._start_sent_s + lead_s, self._session.made_s.most + lead_s)
            self.phase = Phase.RUNNING

    def _run(self, now_s: float) -> None:
        if self._status.state is State.READY:
            self.stopped = self._orders.stop_wanted and self.executed_segments < self.total_segments
            if not self.stopped:
                self.course.check_done(self._status.ledger)
            if self._options.release_when_done:
                self._session.guarded = False
                self._session.send(Enable(0), now_s)
            self.phase = Phase.RELEASING
            return
        self._orders.send(self._status.state, now_s)
        if not self._orders.stop_wanted:
            self._feed.send(self._status, now_s)
        if not self._session.idle:
            return
        if now_s >= self._stall_due_s():
            raise LinkError(self._stall_words(now_s))
        if now_s >= self._poll_due_s():
            self._session.send(Query(), now_s)

    def _finish(self, _now_s: float) -> None:
        if self._session.idle:
            self.phase = Phase.DONE

    # -- asking -------------------------------------------------------------------------------------------------------

    def _poll_due_s(self) -> float:
        """When the device can have room for the next message, or can have ended."""
        if self._orders.hold_is_missing(self._status.state):
            return self._session.status_s + MIN_POLL_S
        wait_s = self.course.between_s(self.executed_segments, self._feed.room_from(self._status))
        wait_s *= PERCENT / max(1, min(self._status.rate_percent, self.pace.percent))
        return self._session.status_s + min(max(wait_s, MIN_POLL_S), MAX_POLL_S)

    def _stall_due_s(self) -> float:
        """When the running segment should long have ended; never while the path clock rests or runs slowly."""
        if self._status.state in AT_EASE or self._status.rate_percent < PERCENT:
            return float("inf")
        running = min(self.executed_segments, self.total_segments - 1)
        ticks = duration_ticks(self.course.segments[running]) + max(self._options.lead_ticks, self._lead_ticks_sent)
        return self.course.executed_s + ticks / TICKS_HZ + self._session.limits.silence_s

    def _stall_words(self, now_s: float) -> str:
        waited_s, of = now_s - self.course.executed_s, self.total_segments
        return (
            f"the device answers but executes nothing: segment {self.executed_segments} of {of} has not ended"
            f" {waited_s:.2f} s after the one before it; reset the board"
        )

    # -- following the device -----------------------------------------------------------------------------------------

    @property
    def _status(self) -> Status:
        status = self._session.status
        assert status is not None, "every phase after ASKING has seen a status"
        return status

    @property
    def executed_segments(self) -> int:
        """Whole segments of this plan executed, by the last status."""
        return self.course.executed

    def path_span_s(self, now_s: float, slowness: float) -> Span:
        """Return where on the path the motion is by now, by the last status.

        Args:
            now_s: later than the status.
            slowness: by how much the device's clock may be faster than this one, as a share.
        """
        if self.course.before is None:
            return Span(0.0, 0.0)
        span_s = self.course.span_s(self._status.ledger)
        since_s = max(0.0, now_s - self._session.made_s.least)
        return Span(span_s.least, span_s.most + (1.0 + slowness) * since_s)

    def _follow(self, now_s: float) -> None:
        status = self._session.status
        if status is None or self.course.before is None:
            return
        if status is self._seen:
            self._tell_resent(status, now_s)
            return
        self._seen = status
        self.course.follow(status.ledger, self.sent_segments, now_s)
        if self.phase is Phase.RUNNING and self.sent_segments < self.total_segments:
            self.least_queued = min(self.least_queued, self.sent_segments - self.executed_segments)
        self._tell(status, now_s)

    def _tell_resent(self, status: Status, now_s: float) -> None:
        """Tell at once what is sent again, without waiting for an answer that may never come."""
        if len(self._session.resent) != self._told_resent:
            self._tell(status, now_s)

    def _tell(self, status: Status, now_s: float) -> None:
        self._told_resent = len(self._session.resent)
        if self._on_progress is not None:
            told = progress_of(self.course, self._session, status, self.sent_segments, now_s)
            self._learn_when_it_began(told.path_span_s)
            self._on_progress(told)

    def _learn_when_it_began(self, path_s: Span) -> None:
        """Take what a place on the path proves: it began so long before, or longer where it was slowed."""
        if self.began_s is not None and path_s.least > 0.0:
            by_now_s = self._session.board_clock.host_s(-round(path_s.least * TICKS_HZ)).most
            self.began_s = Span(self.began_s.least, min(self.began_s.most, by_now_s))
