"""Streams a plan: asks, clears, enables, fills the queue, starts, keeps the queue full, and checks what was executed.

A machine of explicit phases on top of a `Session`; no I/O. The device's queue is filled by credit: a reply tells the
free slots at the moment of its acknowledgement, so what may still be sent is that number less the segments in flight.
Segments go out in messages as full as they can be, each at most half of the window long, so that one is on the line
while the other is acknowledged. When no message is in flight the device is asked for its status, no sooner than the
segments now executing can have made room for the next message.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from itertools import accumulate

from planarm.errors import CertificateError, LinkError, StepsDifferError
from planarm.link.position import moved_usteps
from planarm.link.session import Session
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import (
    HOST_WINDOW_BYTES,
    MAX_PAYLOAD_BYTES,
    QUEUE_SLOTS,
    TICKS_HZ,
    Clear,
    Enable,
    Fault,
    Ledger,
    Query,
    Segment,
    Segments,
    Start,
    State,
    Status,
)
from planarm_wire.steps import duration_ticks, is_last, signed_steps

FRAME_BYTES = HOST_WINDOW_BYTES // 2
MIN_POLL_S = 0.002  # a status and its question take 1.5 ms of the line
MAX_POLL_S = 0.050  # keeps progress alive during long segments


@dataclass(frozen=True, slots=True)
class StreamOptions:
    """How a plan is streamed.

    `lead_ticks` lies between START and the first segment; the 10 ms cover a DM542's response to ENABLE, quoted as under
    5 ms. `release_when_done` lets go of the joints at the end: a loaded arm falls, so the drivers stay enabled unless
    asked.
    """

    lead_ticks: int = 160_000
    release_when_done: bool = False


@dataclass(frozen=True, slots=True)
class StreamProgress:
    """How far the motion is, by the device's ledger."""

    path_s: float
    """Path time of the whole segments executed."""
    total_s: float
    executed_segments: int
    total_segments: int
    queued_segments: int
    """Segments in the device's queue."""
    moved_usteps: tuple[int, ...]
    """Signed micro-steps of each joint since the start, those of the running segment included."""


class Phase(Enum):
    """Where the stream is; each lasts until its frames are acknowledged."""

    OPENING = auto()
    ASKING = auto()
    CLEARING = auto()
    ENABLING = auto()
    FILLING = auto()
    STARTING = auto()
    RUNNING = auto()
    RELEASING = auto()
    DONE = auto()


class Stream:
    """Carries one plan out through `session`.

    `advance` is to be called after every `session.receive` and when `deadline_s` has passed. It raises LinkError when
    the device does not do what it acknowledged, StepsDifferError when the ledger does not show the plan's steps.
    """

    def __init__(
        self,
        session: Session,
        segments: Sequence[Segment],
        options: StreamOptions | None = None,
        on_progress: Callable[[StreamProgress], None] | None = None,
    ) -> None:
        _check_ends(segments)
        self.phase = Phase.OPENING
        self.ledger_before: Ledger | None = None
        self.cleared_fault = Fault.NONE
        self.started_s = 0.0
        self.least_queued = QUEUE_SLOTS
        self.sent_segments = 0
        self._session = session
        self._segments = tuple(segments)
        self._options = options or StreamOptions()
        self._on_progress = on_progress
        self._ends_ticks = tuple(accumulate((duration_ticks(segment) for segment in segments), initial=0))
        self._seen: Status | None = None
        self._executed = 0
        self._executed_s = 0.0
        self._message: Segments | None = None

    @property
    def done(self) -> bool:
        """Whether the plan was executed and checked."""
        return self.phase is Phase.DONE

    @property
    def total_segments(self) -> int:
        """Segments of the plan."""
        return len(self._segments)

    @property
    def deadline_s(self) -> float:
        """When `advance` must be called at the latest."""
        if self.phase is Phase.RUNNING and self._session.idle:
            return min(self._poll_due_s(), self._stall_due_s())
        return float("inf")

    def advance(self, now_s: float) -> None:
        """Do whatever is due."""
        self._follow(now_s)
        steps = {
            Phase.OPENING: self._ask,
            Phase.ASKING: self._prepare,
            Phase.CLEARING: self._enable,
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
        status = self._status
        if status.state is State.RUNNING:
            raise LinkError(
                "the device is executing the motion of an earlier session; wait until it has ended, then try again"
            )
        if status.state is State.FAULT or status.free_slots < QUEUE_SLOTS:
            self.cleared_fault = status.fault
            self._session.send(Clear(), now_s)
        self.phase = Phase.CLEARING

    def _enable(self, now_s: float) -> None:
        if not self._session.idle:
            return
        if self._status.state is not State.READY:
            self._session.send(Enable(1), now_s)
        self.phase = Phase.ENABLING

    def _begin_filling(self, _now_s: float) -> None:
        if not self._session.idle:
            return
        if self._status.state is not State.READY:
            raise LinkError(f"the device took ENABLE but reports {self._status.state.name.lower()}; reset the board")
        self._session.guarded = True
        self.ledger_before = self._status.ledger
        self.phase = Phase.FILLING

    def _fill(self, now_s: float) -> None:
        self._send_segments(now_s)
        if self._session.idle:  # the queue is full, or the whole plan is in it
            self._session.send(Start(self._options.lead_ticks), now_s)
            self.phase = Phase.STARTING

    def _begin_running(self, now_s: float) -> None:
        if self._session.idle:
            self.started_s = self._executed_s = now_s
            self.phase = Phase.RUNNING

    def _run(self, now_s: float) -> None:
        if self._status.state is State.READY:
            self._check_ledger()
            if self._options.release_when_done:
                self._session.guarded = False
                self._session.send(Enable(0), now_s)
            self.phase = Phase.RELEASING
            return
        self._send_segments(now_s)
        if not self._session.idle:
            return
        if now_s >= self._stall_due_s():
            raise LinkError(self._stall_words(now_s))
        if now_s >= self._poll_due_s():
            self._session.send(Query(), now_s)

    def _finish(self, _now_s: float) -> None:
        if self._session.idle:
            self.phase = Phase.DONE

    # -- sending ------------------------------------------------------------------------------------------------------

    def _send_segments(self, now_s: float) -> None:
        while (message := self._next_message()) is not None:
            if len(message.segments) > self._credit or not self._session.fits(message):
                return
            self._session.send(message, now_s)
            self.sent_segments += len(message.segments)
            self._message = None

    def _next_message(self) -> Segments | None:
        """Return the next segments, as many as one message may hold; None when all are sent."""
        stale = self._message is None or self._is_long(self._message)  # stuffing changes with the frame's number
        if stale and self.sent_segments < len(self._segments):
            self._message = self._pack()
        return self._message

    def _pack(self) -> Segments:
        chosen: list[Segment] = []
        room_bytes = MAX_PAYLOAD_BYTES
        for segment in self._segments[self.sent_segments : self.sent_segments + QUEUE_SLOTS]:
            room_bytes -= encoded_bytes(segment)
            if room_bytes < 0:
                break
            chosen.append(segment)
        message = Segments(tuple(chosen))
        while self._is_long(message):
            message = Segments(message.segments[:-1])
        return message

    def _is_long(self, message: Segments) -> bool:
        """Whether `message` takes more than its share of the window and can be made shorter."""
        return len(message.segments) > 1 and self._session.encoded_bytes(message) > FRAME_BYTES

    @property
    def _credit(self) -> int:
        return self._status.free_slots - self._session.slots_in_flight

    def _poll_due_s(self) -> float:
        """When the device can have room for the next message, or can have ended."""
        message = self._next_message()
        wanted = len(message.segments) - self._credit if message else len(self._segments)
        until = min(self._executed + wanted, len(self._segments))
        wait_s = (self._ends_ticks[until] - self._ends_ticks[self._executed]) / TICKS_HZ
        return self._session.status_s + min(max(wait_s, MIN_POLL_S), MAX_POLL_S)

    # -- following the device -----------------------------------------------------------------------------------------

    @property
    def _status(self) -> Status:
        status = self._session.status
        assert status is not None, "every phase after ASKING has seen a status"
        return status

    @property
    def executed_segments(self) -> int:
        """Whole segments of this plan executed, by the last status."""
        return self._executed

    def _follow(self, now_s: float) -> None:
        status = self._session.status
        if status is None or status is self._seen or self.ledger_before is None:
            return
        self._seen = status
        executed = status.ledger.executed_segments - self.ledger_before.executed_segments
        if executed > self.sent_segments:
            raise LinkError(
                f"the device tells {executed} executed segments, but only {self.sent_segments} were sent;"
                " another program speaks to it, or host and firmware disagree"
            )
        if executed != self._executed:
            self._executed, self._executed_s = executed, now_s
        queued = QUEUE_SLOTS - status.free_slots
        if self.phase is Phase.RUNNING and self.sent_segments < len(self._segments):
            self.least_queued = min(self.least_queued, queued)
        if self._on_progress is not None:
            self._on_progress(self._progress(status, queued))

    def _progress(self, status: Status, queued: int) -> StreamProgress:
        assert self.ledger_before is not None
        return StreamProgress(
            path_s=self._ends_ticks[self._executed] / TICKS_HZ,
            total_s=self._ends_ticks[-1] / TICKS_HZ,
            executed_segments=self._executed,
            total_segments=len(self._segments),
            queued_segments=queued,
            moved_usteps=moved_usteps(self.ledger_before, status.ledger),
        )

    def _stall_due_s(self) -> float:
        """When the running segment should long have ended."""
        running = min(self._executed, len(self._segments) - 1)
        ticks = duration_ticks(self._segments[running]) + self._options.lead_ticks
        return self._executed_s + ticks / TICKS_HZ + self._session.limits.silence_s

    def _stall_words(self, now_s: float) -> str:
        return (
            f"the device answers but executes nothing: segment {self._executed} of {len(self._segments)} has not ended"
            f" {now_s - self._executed_s:.2f} s after the one before it; reset the board"
        )

    def _check_ledger(self) -> None:
        """Compare what the device executed with the plan, segment count and steps of every joint."""
        assert self.ledger_before is not None
        if self._executed != len(self._segments):
            raise LinkError(
                f"the device ended its motion after {self._executed} of {len(self._segments)} segments without a fault;"
                " host and firmware disagree: flash the released image"
            )
        executed = moved_usteps(self.ledger_before, self._status.ledger)
        planned = planned_usteps(self._segments)
        for joint, (done, meant) in enumerate(zip(executed, planned, strict=True), start=1):
            if done != meant:
                raise StepsDifferError(
                    f"joint {joint} moved by {done:+d} usteps by the device's ledger, the plan has {meant:+d}"
                    f" ({done - meant:+d}); home the arm before the next motion"
                )


def planned_usteps(segments: Sequence[Segment]) -> tuple[int, ...]:
    """Signed micro-steps that `segments` move each joint by."""
    return tuple(sum(signed_steps(move) for move in moves) for moves in zip(*(s.moves for s in segments), strict=True))


def _check_ends(segments: Sequence[Segment]) -> None:
    ends = [index for index, segment in enumerate(segments) if is_last(segment)]
    if ends != [len(segments) - 1]:
        raise CertificateError(
            f"the plan has {len(segments)} segments and marks {ends} as the last of the motion; only the very last one"
            " may be and must be marked: plan the scene again"
        )
