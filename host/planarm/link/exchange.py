"""Joins a transport with the machines above it: the only loop of the link.

    transport --bytes--> Session (frames in order, same device?) --status--> Stream (what to send next)

`stream_plan` carries out a whole plan; `open_session` and `request` serve commands that only ask or switch something.
"""

import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from planarm.errors import DeviceFault, LinkError
from planarm.link.position import Certainty, PositionReport, StreamError, StreamFault, moved_usteps
from planarm.link.session import Session, SessionLimits, fault_words
from planarm.link.stream import Phase, Stream, StreamOptions, StreamProgress
from planarm.link.transport import Transport
from planarm_wire.messages import Fault, HostMessage, Ledger, Query, Segment, State, Status

_READ_BYTES = 4096
_REST_LIMIT_S = 5.0
_REST_POLL_S = 0.02
_FOREVER_S = float("inf")


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
    least_queued: int
    """Fewest segments seen in the device's queue while more were to come."""
    cleared_fault: Fault
    """Fault of an earlier motion that was cleared first."""


def stream_plan(
    transport: Transport,
    segments: Sequence[Segment],
    on_progress: Callable[[StreamProgress], None] | None = None,
    options: StreamOptions | None = None,
    limits: SessionLimits | None = None,
) -> StreamResult:
    """Open a session, execute `segments` and check the device's ledger against them.

    Raises LinkError (StreamError once the motion has begun) when the line fails, DeviceFault (StreamFault) when the
    device latches a fault or refuses, StepsDifferError when the ledger does not show the plan's steps, and
    CertificateError when `segments` are no whole motion. Stream errors carry a `position`. Without segments the arm is
    where it should be: the device is asked for its ledger, and nothing is enabled. Ctrl-C during a motion is a hold:
    the arm slows down and rests on the path. A second Ctrl-C is a stop: the rest of the plan is dropped, and a
    StreamError tells the position. A third does not wait for that.
    """
    began_s = transport.clock.now_s()
    if not segments:
        session = open_session(transport, limits)
        request(transport, session, Query())
        return _result(session, transport.clock.now_s(), began_s)
    session = _new_session(transport, limits)
    stream = Stream(session, segments, options, on_progress)
    try:
        _drive_with_keyboard(transport, session, stream)
    except KeyboardInterrupt as stop:
        if stream.ledger_before is None:
            raise
        position, _ = _find_position(transport, session, stream)
        raise StreamError("left by the keyboard before the arm had come to rest", position) from stop
    except (LinkError, DeviceFault) as error:
        if stream.ledger_before is None:  # nothing was queued yet, so nothing moved
            raise
        position, fault = _find_position(transport, session, stream)
        if not isinstance(error, DeviceFault):
            raise StreamError(str(error), position) from error
        cause = fault_words(fault) if fault is not Fault.NONE else str(error)  # a refusal may foretell a fault
        raise StreamFault(cause, position) from error
    if stream.stopped:
        assert session.status is not None, "a stop is seen in a status"
        raise StreamError("stopped by the keyboard", _report(Certainty.EXACT, session.status, stream))
    return _result(session, transport.clock.now_s(), began_s, stream)


def _drive_with_keyboard(transport: Transport, session: Session, stream: Stream) -> None:
    """Carry the plan out; the first Ctrl-C in motion holds, the second stops, the third is raised."""
    answers = [stream.hold, stream.stop]
    while True:
        try:
            return _drive(transport, session, lambda: stream.done, stream)
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


def _new_session(transport: Transport, limits: SessionLimits | None) -> Session:
    return Session(secrets.randbits(32), transport.clock.now_s(), limits)


def _drive(transport: Transport, session: Session, is_done: Callable[[], bool], stream: Stream | None = None) -> None:
    """Pass bytes and time until `is_done`.

    What has arrived is read before the time is looked at, so that a host that was held up blames nobody for it.
    """
    clock = transport.clock
    while True:
        now_s = clock.now_s()
        session.on_time(now_s)
        if stream is not None:
            stream.advance(now_s)
        output = session.take_output()
        if output:
            transport.write(output)
        if is_done():
            return
        deadline_s = min(session.deadline_s, stream.deadline_s if stream else _FOREVER_S)
        session.receive(transport.read(_READ_BYTES, deadline_s), clock.now_s())


def _find_position(transport: Transport, session: Session, stream: Stream) -> tuple[PositionReport, Fault]:
    """Find out where the arm is after a motion broke off, and the fault that latched, if any.

    The device is asked again, unless it has just told.
    """
    last = session.status
    assert last is not None and session.welcome is not None, "a motion begins with a status"
    if last.state is State.FAULT:
        return _report(Certainty.EXACT, last, stream), last.fault
    try:
        fresh = open_session(transport, session.limits)
        assert fresh.welcome is not None, "an open session has a welcome"
        if fresh.welcome.boot_nonce != session.welcome.boot_nonce:
            return _report(Certainty.LOST, last, stream), Fault.NONE
        last = _wait_for_rest(transport, fresh)
    except (LinkError, DeviceFault):
        return _report(Certainty.BOUNDED, last, stream), Fault.NONE
    certainty = {State.RUNNING: Certainty.BOUNDED, State.IDLE: Certainty.LOST}.get(last.state, Certainty.EXACT)
    return _report(certainty, last, stream), last.fault


def _wait_for_rest(transport: Transport, session: Session) -> Status:
    """Return the first status that is not running, or the last after the limit; what is queued goes on by itself."""
    clock = transport.clock
    limit_s = clock.now_s() + _REST_LIMIT_S
    while (status := request(transport, session, Query())).state is State.RUNNING and clock.now_s() < limit_s:
        clock.wait_until(clock.now_s() + _REST_POLL_S)
    return status


def _report(certainty: Certainty, last: Status, stream: Stream) -> PositionReport:
    before = stream.ledger_before
    assert before is not None, "a motion begins with a ledger"
    executed = last.ledger.executed_segments - before.executed_segments
    return PositionReport(
        certainty=certainty,
        executed_segments=(executed, executed if certainty is Certainty.EXACT else stream.sent_segments),
        total_segments=stream.total_segments,
        moved_usteps=moved_usteps(before, last.ledger),
    )


def _result(session: Session, now_s: float, began_s: float, stream: Stream | None = None) -> StreamResult:
    assert session.welcome is not None and session.status is not None
    before = stream.ledger_before if stream else session.status.ledger
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
        least_queued=stream.least_queued if stream else 0,
        cleared_fault=stream.cleared_fault if stream else Fault.NONE,
    )
