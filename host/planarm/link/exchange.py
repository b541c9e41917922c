"""Joins a transport with the machines above it: the only loop of the link.

    transport --bytes--> Session (frames in order, same device?) --status--> Stream (what to send next)

`stream_plan` carries out a whole plan; `open_session` and `request` serve commands that only ask or switch something.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from planarm.errors import DeviceFault, LinkError
from planarm.link.clock_sync import ClockReading, Span
from planarm.link.knock import ask_expected
from planarm.link.margin import Margin
from planarm.link.pace import PERCENT
from planarm.link.position import Known, Meeting, PositionReport, StreamError, StreamFault, judge
from planarm.link.session import Session, SessionLimits, fault_words
from planarm.link.stream import Joining, Phase, Stream, StreamOptions, StreamProgress
from planarm.link.stream_values import plain_config
from planarm.link.transport import Transport
from planarm_wire.boards import Board
from planarm_wire.messages import Fault, HostMessage, Ledger, Query, Segment, State, Status

_READ_BYTES = 4096
_REST_LIMIT_S = 5.0
_REST_POLL_S = 0.02
_FOREVER_S = float("inf")
_MOVING = (State.RUNNING, State.HOLDING, State.STOPPING)
"""What is queued goes on by itself, and then the device rests."""


@dataclass(frozen=True, slots=True)
class StreamResult:
    """A plan that was executed and checked, and what it took; times are those of the transport's clock."""

    boot_nonce: int
    firmware_version: tuple[int, int, int]
    ledger_before: Ledger
    ledger_after: Ledger
    segments: int
    duration_s: float
    """From HELLO to the end of the motion as seen here."""
    motion_s: float
    """From the acknowledgement of START to the end of the motion as seen here."""
    frames_sent: int
    retransmissions: int
    bytes_sent: int
    bytes_received: int
    crc_errors: int
    """Frames from the host that the device found damaged."""
    bytes_lost: int
    """Bytes the device lost in its USART or for want of room in its ring."""
    damaged_replies: int
    path_clock_percent: int
    """Rate of the path clock for the line's sake: 100 unless the line is too slow for the plan."""
    margin: Margin | None
    """What the plan asked of the line, and what it was seen to carry; None when all of it was queued before START."""
    least_queued: int
    """Fewest segments seen in the device's queue while more were to come."""
    cleared_fault: Fault
    """Fault of an earlier motion that was cleared first."""
    began_s: Span | None
    """When the first segment started; None when it was not this session that started it."""
    board_clock: ClockReading | None
    """What the session learnt of the device's clock."""


def stream_plan(
    transport: Transport,
    segments: Sequence[Segment],
    on_progress: Callable[[StreamProgress], None] | None = None,
    options: StreamOptions | None = None,
    limits: SessionLimits | None = None,
    joining: Joining | None = None,
    steer: Callable[[Stream], None] | None = None,
    warn: Callable[[str], None] | None = None,
) -> StreamResult:
    """Open a session, execute `segments` and check the device's ledger against them.

    Raises LinkError (StreamError once the motion has begun) when the line fails, DeviceFault (StreamFault) when the
    device latches a fault or refuses, StepsDifferError when the ledger does not show the plan's steps, and
    CertificateError when `segments` are no whole motion. Stream errors carry a `position`. Without segments the arm is
    where it should be: the device is asked for its ledger, and nothing is enabled. Ctrl-C during a motion is a hold:
    the arm slows down and rests on the path. A second Ctrl-C is a stop: the rest of the plan is dropped, and a
    StreamError tells the position. A third does not wait for that. With `joining` the device has begun the motion and
    holds a part of it; the rest is sent. `steer` is handed the stream at every pass while it runs: it may call its
    `hold`, `resume`, `override` and `stop`. `warn` is told, before the motion starts, when the line is too slow for the
    plan and the path clock will run slowly for that.
    """
    began_s = transport.clock.now_s()
    if not segments:
        session = open_session(transport, limits)
        request(transport, session, Query())
        return _result(session, transport.clock.now_s(), began_s)
    session = _new_session(transport, limits)
    stream = Stream(session, segments, options, on_progress, joining, warn)
    try:
        _drive_with_keyboard(transport, session, stream, steer)
    except KeyboardInterrupt as stop:
        if stream.course.before is None:
            raise
        position, _ = _find_position(transport, session, stream)
        raise StreamError("left by the keyboard before the arm had come to rest", position) from stop
    except (LinkError, DeviceFault) as error:
        if stream.course.before is None:  # nothing was queued yet, so nothing moved
            raise
        position, latched = _find_position(transport, session, stream)
        if not isinstance(error, DeviceFault):
            raise StreamError(str(error), position) from error
        raise StreamFault(latched or str(error), position) from error  # a refusal may foretell a fault
    if stream.stopped:
        raise StreamError("stopped as asked", _report(stream, session, _meeting(session)))
    return _result(session, transport.clock.now_s(), began_s, stream)


def _drive_with_keyboard(
    transport: Transport, session: Session, stream: Stream, steer: Callable[[Stream], None] | None
) -> None:
    """Carry the plan out; the first Ctrl-C in motion holds, the second stops, the third is raised."""
    answers = [stream.hold, stream.stop]
    while True:
        try:
            return _drive(transport, session, lambda: stream.done, stream, steer)
        except KeyboardInterrupt:
            if stream.phase is not Phase.RUNNING or not answers:
                raise
            answers.pop(0)()


def open_session(transport: Transport, limits: SessionLimits | None = None) -> Session:
    """Say HELLO and return the open session."""
    session = _new_session(transport, limits)
    _drive(transport, session, lambda: session.is_open)
    return session


def request(transport: Transport, session: Session, message: HostMessage) -> Status:
    """Send one message on an open session and return the status that acknowledges it."""
    session.send(message, transport.clock.now_s())
    _drive(transport, session, lambda: session.idle)
    assert session.status is not None, "an acknowledgement is a status"
    return session.status


def open_on_board(transport: Transport, board: Board) -> tuple[Session, Status]:
    """Open a session with a device that is known to be such a board, and ask for its status.

    Its joints are told by WELCOME, its wiring by its answer to CONFIG: whatever its state, an image of another wiring
    refuses that as out of range. A device at ease takes it; it is told by the next motion and not asked before.

    Raises LinkError when it is another board, or does not answer.
    """
    session = open_session(transport)
    session.require_board(board)
    status = request(transport, session, Query())
    if status.state is State.IDLE:
        return session, status
    session.ask_wiring()
    request(transport, session, plain_config(board))
    session = open_session(transport)  # a refusal is told until the next HELLO
    session.require_board(board)
    return session, request(transport, session, Query())


def _new_session(transport: Transport, limits: SessionLimits | None) -> Session:
    return Session(transport.nonce(), transport.clock.now_s(), limits)


def _drive(
    transport: Transport,
    session: Session,
    is_done: Callable[[], bool],
    stream: Stream | None = None,
    steer: Callable[[Stream], None] | None = None,
) -> None:
    """Pass bytes and time until `is_done`.

    What has arrived is read before the time is looked at, so that a host that was held up blames nobody for it.
    """
    clock = transport.clock
    while True:
        now_s = clock.now_s()
        session.on_time(now_s)
        if stream is not None:
            if steer is not None and stream.phase is Phase.RUNNING:
                steer(stream)
            stream.advance(now_s)
        output = session.take_output()
        if output:
            transport.write(output)
        if is_done():
            return
        deadline_s = min(session.deadline_s, stream.deadline_s if stream else _FOREVER_S)
        session.receive(transport.read(_READ_BYTES, deadline_s), clock.now_s())


def meet(transport: Transport, next_seq: int, limits: SessionLimits | None = None) -> Meeting:
    """Meet a device again after a break: first how far it got, for the journal, then who it is and where it rests.

    Args:
        transport: the line.
        next_seq: the number that the next frame of the session that broke off would have had.
        limits: how long to wait.

    Raises:
        LinkError: it does not answer.
        DeviceFault: it refuses.
    """
    ask_expected(transport, next_seq, limits)
    session = open_session(transport, limits)
    clock = transport.clock
    limit_s = clock.now_s() + _REST_LIMIT_S
    while request(transport, session, Query()).state in _MOVING and clock.now_s() < limit_s:
        clock.wait_until(clock.now_s() + _REST_POLL_S)
    return _meeting(session)


def _find_position(transport: Transport, session: Session, stream: Stream) -> tuple[PositionReport, str]:
    """Find out where the arm is after a motion broke off, and the fault that latched, in words; "" where none did.

    The device is asked again, unless it has just told.
    """
    assert session.status is not None, "a motion begins with a status"
    if session.status.state is State.FAULT:
        return _report(stream, session, _meeting(session)), _latched(session.status)
    try:
        met = meet(transport, session.next_seq, session.limits)
    except (LinkError, DeviceFault):
        return _report(stream, session, None), ""
    return _report(stream, session, met), _latched(met.status)


def _latched(status: Status) -> str:
    return "" if status.fault is Fault.NONE else fault_words(status.fault, status.detail)


def _meeting(session: Session) -> Meeting:
    assert session.welcome is not None and session.status is not None, "the device was met"
    return Meeting(session.welcome.boot_nonce, session.status)


def _report(stream: Stream, session: Session, met: Meeting | None) -> PositionReport:
    before, told = stream.course.before, _meeting(session)
    assert before is not None, "a motion begins with a ledger"
    # What was sent since the last reply may have set an arm at rest in motion, so nothing is said of rest here.
    known = Known(told.boot_nonce, before, told.status, stream.sent_segments, rested=False)
    return judge(known, met, stream.course.steps, stream.released_spread_usteps)


def _result(session: Session, now_s: float, began_s: float, stream: Stream | None = None) -> StreamResult:
    assert session.welcome is not None and session.status is not None
    before = stream.course.before if stream else session.status.ledger
    assert before is not None, "a motion begins with a ledger"
    return StreamResult(
        boot_nonce=session.welcome.boot_nonce,
        firmware_version=session.welcome.firmware_version,
        ledger_before=before,
        ledger_after=session.status.ledger,
        segments=stream.total_segments if stream else 0,
        duration_s=now_s - began_s,
        motion_s=now_s - stream.started_s if stream else 0.0,
        frames_sent=session.arq_counters.frames_sent,
        retransmissions=session.arq_counters.retransmissions,
        bytes_sent=session.bytes_sent,
        bytes_received=session.line.bytes_received,
        crc_errors=session.line.crc_errors,
        bytes_lost=session.line.overruns + session.line.ring_full,
        damaged_replies=session.line.damaged_replies,
        path_clock_percent=stream.pace.percent if stream else PERCENT,
        margin=stream.pace.margin if stream else None,
        least_queued=stream.least_queued if stream else 0,
        cleared_fault=stream.cleared_fault if stream else Fault.NONE,
        began_s=stream.began_s if stream else None,
        board_clock=session.board_clock.reading(),
    )
