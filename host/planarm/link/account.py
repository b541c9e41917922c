"""What a journal tells of its motion: what was sent, what the device said of it, and whether the arm rested then."""

from dataclasses import dataclass
from typing import Any

from planarm.link.journal import Journal, Kind
from planarm.link.knock import FAR_AHEAD
from planarm.link.position import Known, executed_since
from planarm.link.told_joints import joints_told
from planarm_wire.codec import decode
from planarm_wire.errors import WireError
from planarm_wire.framing import Frame, FrameDecoder
from planarm_wire.messages import (
    HOLD_CODE,
    Hello,
    HostMessage,
    Ledger,
    Message,
    Query,
    Segments,
    Start,
    State,
    Status,
    Stop,
    Welcome,
)

AT_REST = (State.IDLE, State.READY, State.FAULT, State.HELD)
"""States in which the arm stands still until it is told to go on; a starved one goes on by itself when it is fed."""
_SEQUENCE = 256


@dataclass(slots=True)
class Account:
    """A motion as its journal tells it.

    Attributes:
        about: what the journal tells of the run.
        boot_nonce: of the device that the motion was sent to; None: it never answered.
        before: the ledger at the motion's start; None: no segment was sent.
        last: the newest status of that boot.
        last_s: when it came, by the transport's clock.
        sent_segments: how many were sent.
        started: START was sent.
        stopped: STOP was sent: what was queued is dropped.
        rested: the arm rested when `last` was told, and nothing that moves it was sent since.
        next_seq: the number of the next frame of the session that sent segments last.
        accepted: segments that the device took, as it told when it was asked after a break; None: it was not asked,
            has no memory of that session, or got more since.
    """

    about: dict[str, Any]
    boot_nonce: int | None = None
    before: Ledger | None = None
    last: Status | None = None
    last_s: float = 0.0
    sent_segments: int = 0
    started: bool = False
    stopped: bool = False
    rested: bool = True
    next_seq: int = 0
    accepted: int | None = None

    def known(self) -> Known | None:
        """The motion in the form that `judge` takes; None when none was begun."""
        if self.boot_nonce is None or self.before is None or self.last is None:
            return None
        return Known(self.boot_nonce, self.before, self.last, self.sent_segments, self.rested)


def account_of(journal: Journal) -> Account:
    """Add up a journal's records."""
    reader = _Reader(Account(journal.about), joints_told(journal.records))
    for record in journal.records:
        if record.kind is Kind.SENT:
            reader.on_sent(record.data)
        elif record.kind is Kind.RECEIVED:
            reader.on_received(record.data, record.t_s)
        else:
            reader.on_note(record.note())
    return reader.account


class _Reader:
    """Follows a journal, frame by frame."""

    def __init__(self, account: Account, joints: int) -> None:
        self.account = account
        self._joints = joints
        self._sent, self._received = FrameDecoder(), FrameDecoder()
        self._boot_nonce: int | None = None
        self._hello_seq: int | None = None  # a session was asked for, and the device may not have heard it
        self._next_seq: int | None = None  # of the next new frame; what has another number is a copy
        self._acked_seq = 0
        self._marks: dict[int, int] = {}  # number expected after a frame -> segments taken by then
        self._knocked = False
        self._is_the_motions = False  # this session sent segments

    def on_note(self, note: dict[str, Any]) -> None:
        """A motion that is gone on with begins again where the device had got to."""
        if "joined_segments" in note:
            self.account.sent_segments = int(note["joined_segments"])

    def on_sent(self, data: bytes) -> None:
        """Count the frames that are new."""
        if HOLD_CODE in data:
            self.account.rested = False  # it rests soon, but not yet
        for frame in self._sent.feed(data):
            message = self._message(frame)
            if message is None or not isinstance(frame, Frame):
                continue
            if isinstance(message, Hello):
                self._hello_seq = frame.seq
            elif frame.seq == self._next_seq:
                self._next_seq = (frame.seq + 1) % _SEQUENCE
                self._on_new(message, self._next_seq)
            elif self._next_seq is not None and (frame.seq - self._next_seq) % _SEQUENCE == FAR_AHEAD:
                self._knocked = True

    def _on_new(self, message: Message, following: int) -> None:
        account = self.account
        if isinstance(message, Segments):
            if account.before is None and account.last is not None:
                account.before = account.last.ledger
            account.sent_segments += len(message.segments)
            account.accepted = None
            self._is_the_motions = True
        account.started |= isinstance(message, Start)
        account.stopped |= isinstance(message, Stop)
        if isinstance(message, HostMessage) and not isinstance(message, Query):
            account.rested = False
        self._marks[following] = account.sent_segments
        if self._is_the_motions:
            account.next_seq = following

    def on_received(self, data: bytes, t_s: float) -> None:
        """Keep the newest status."""
        for frame in self._received.feed(data):
            message = self._message(frame)
            if isinstance(message, Welcome):
                self._on_welcome(message)
                if self.account.before is None:
                    self.account.boot_nonce = message.boot_nonce
            elif isinstance(message, Status) and isinstance(frame, Frame) and self._is_of_the_motion(message):
                self.account.last, self.account.last_s = message, t_s
                self.account.rested = message.state in AT_REST and frame.seq == self._next_seq
                self._on_expected(frame.seq)

    def _on_welcome(self, welcome: Welcome) -> None:
        """The numbers start anew, if they have not yet: HELLO is said more than once."""
        self._boot_nonce = welcome.boot_nonce
        if self._hello_seq is None:
            return
        self._next_seq = self._acked_seq = (self._hello_seq + 1) % _SEQUENCE
        self._marks = {self._next_seq: self.account.sent_segments}
        self._hello_seq, self._knocked, self._is_the_motions = None, False, False

    def _on_expected(self, seq: int) -> None:
        """Note how far the device got; only what was in flight is still open."""
        ahead = (seq - self._acked_seq) % _SEQUENCE
        if self._next_seq is None or ahead > (self._next_seq - self._acked_seq) % _SEQUENCE:
            return
        self._acked_seq = seq
        if self._knocked:
            self.account.accepted = self._marks.get(seq)
            self._knocked = False

    def _is_of_the_motion(self, status: Status) -> bool:
        """Whether a status may be believed: a device that restarted says so by its nonce, but not at once."""
        account = self.account
        if account.before is None:
            return True
        if self._boot_nonce != account.boot_nonce or status.state is State.IDLE:
            return False
        return executed_since(account.before, status.ledger) <= account.sent_segments

    def _message(self, frame: object) -> Message | None:
        """Decode a frame; what is none is noise."""
        if not isinstance(frame, Frame):
            return None
        try:
            return decode(frame.type_code, frame.payload, self._joints)
        except WireError:
            return None
