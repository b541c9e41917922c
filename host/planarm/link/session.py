"""A session: opens the conversation with HELLO, keeps frames in order, and notices when the device is not the same.

HELLO carries a nonce of the host, so that a WELCOME left over in some buffer is not taken for an answer; WELCOME
carries the device's boot nonce, protocol version and specification hash. HELLO is repeated because opening an Uno's
port resets it: its bootloader (optiboot 4.4) swallows everything for about 1.4 s. A byte that the bootloader happens to
read as cleanly framed re-arms its 1 s watchdog, so after two quick tries the pauses are longer than that.

No I/O: the session is fed with bytes and times; `take_output` returns what is to be written.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from planarm.errors import DeviceFault, LinkError
from planarm.link.arq import Ack, ArqCounters, GoBackN, Resent
from planarm.link.clock_sync import ClockSync, Span
from planarm_wire.boards import Board
from planarm_wire.codec import decode, encode, encoded_bytes
from planarm_wire.errors import WireError
from planarm_wire.framing import Frame, FrameDecoder, encode_frame
from planarm_wire.messages import (
    DELIMITER,
    FAULT_WORDS,
    JOINTS,
    PROTOCOL_VERSION,
    QUEUE_FRAME_BYTES,
    RESULT_WORDS,
    SPEC_HASH,
    Fault,
    Hello,
    HostMessage,
    Message,
    MessageType,
    Result,
    Segments,
    State,
    Status,
    Welcome,
)

HELLO_PAUSES_S = (0.25, 0.5)
HELLO_LATER_PAUSE_S = 1.25

_HELLO_SEQ = 0
_MODULO_256 = 0xFF
FAULTS_OF_A_JOINT = (Fault.LIMIT_SWITCH, Fault.SOFT_LIMIT, Fault.HOMING_FAILED)
DETAIL_WORDS = "; detail tells the joint"
_FLASH_IT = "flash the released image: planarm flash --port DEVICE"


@dataclass(frozen=True, slots=True)
class SessionLimits:
    """How long a session waits.

    `hello_s` covers the bootloader's 1.4 s three times over; `silence_s` is many times the round trip of about 12 ms
    and four times the longest retransmission time-out.
    """

    hello_s: float = 5.0
    silence_s: float = 1.0


@dataclass(slots=True)
class LineCounters:
    """What went wrong on the line since WELCOME; the first three are counted by the device."""

    crc_errors: int = 0  # frames from the host that failed a check
    overruns: int = 0  # bytes lost in the USART
    ring_full: int = 0  # bytes lost because the receive ring was full
    damaged_replies: int = 0  # frames from the device that failed a check
    bytes_received: int = 0


class Session:
    """One session with one boot of the device.

    `status` is the device's last, read at `status_s` and made within `made_s`, by the device's clock `board_clock`.
    `guarded` is set by the owner once the drivers are enabled: from then on an idle device can only be a restarted one,
    and a latched fault is raised as DeviceFault.
    """

    def __init__(self, host_nonce: int, now_s: float, limits: SessionLimits | None = None) -> None:
        self.limits = limits or SessionLimits()
        self.host_nonce = host_nonce
        self.welcome: Welcome | None = None
        self.status: Status | None = None
        self.status_s = now_s
        self.made_s = Span(now_s, now_s)
        self.board_clock = ClockSync()
        self.line = LineCounters()
        self.bytes_sent = 0
        self.guarded = False
        self._board: Board | None = None
        self._asking_wiring = False
        self._arq = GoBackN(next_seq=_HELLO_SEQ + 1)
        self._decoder = FrameDecoder()
        self._output = bytearray()
        self._names: dict[int, str] = {}
        self._encoded: tuple[HostMessage, int, bytes] | None = None
        self._hello_limit_s = now_s + self.limits.hello_s
        self._hellos = 0
        self._hello_due_s = now_s
        self._waiting_since_s = now_s
        self._heard_s = now_s

    # -- what the owner asks ------------------------------------------------------------------------------------------

    @property
    def is_open(self) -> bool:
        """Whether the device answered HELLO and fits."""
        return self.welcome is not None

    @property
    def next_seq(self) -> int:
        """Number of the next frame."""
        return self._arq.next_seq

    @property
    def idle(self) -> bool:
        """Whether every frame sent has been acknowledged."""
        return self._arq.idle

    @property
    def arq_counters(self) -> ArqCounters:
        """The sender's counters."""
        return self._arq.counters

    @property
    def round_trip_s(self) -> float:
        """From a frame to its acknowledgement, as last measured; 0 before."""
        return self._arq.round_trip_s

    @property
    def resent(self) -> Sequence[Resent]:
        """What was sent again since the session's start, in order of time."""
        return self._arq.resent

    @property
    def quickest_s(self) -> float:
        """Least time from a frame's first sending to its acknowledgement; infinity before the first."""
        return self._arq.quickest_s

    @property
    def room_in_flight(self) -> int:
        """Bytes of the device's queue that frames sent and not acknowledged take."""
        return self._arq.room_in_flight

    @property
    def deadline_s(self) -> float:
        """When `on_time` must be called at the latest; infinity when nothing is waited for."""
        if not self.is_open:
            return min(self._hello_due_s, self._hello_limit_s)
        if self._arq.idle:
            return float("inf")
        return min(self._arq.deadline_s, self._silence_limit_s)

    def encoded_bytes(self, message: HostMessage) -> int:
        """Length of `message` on the line if it were the next one sent."""
        return len(self._encode(message))

    def fits(self, message: HostMessage) -> bool:
        """Whether `message` may be sent now without exceeding the window."""
        return self._arq.fits(self._encode(message))

    @property
    def _silence_limit_s(self) -> float:
        return self._waiting_since_s + self.limits.silence_s

    # -- what the owner does ------------------------------------------------------------------------------------------

    def send(self, message: HostMessage, now_s: float) -> None:
        """Send `message`; it must fit."""
        if self._arq.idle:
            self._waiting_since_s = now_s
        self._names[self._arq.next_seq] = type(message).__name__.upper()
        self._output += self._arq.send(self._encode(message), room_of(message), now_s)

    def send_out_of_band(self, code: int) -> None:
        """Send a byte that acts in the device's receive interrupt, before everything else."""
        self._output.insert(0, code)

    def take_output(self) -> bytes:
        """Return the bytes to write, once."""
        output = bytes(self._output)
        self._output.clear()
        self.bytes_sent += len(output)
        return output

    def receive(self, data: bytes, now_s: float) -> None:
        """Take in bytes from the device.

        Raises LinkError when it is not the one that answered HELLO, DeviceFault when it reports a fault or a refusal.
        """
        self.line.bytes_received += len(data)
        for frame in self._decoder.feed(data):
            if not isinstance(frame, Frame):
                self.line.damaged_replies += 1
                continue
            self._heard_s = now_s
            if self.is_open:
                self._on_reply(frame, now_s)
            else:
                self._on_answer_to_hello(frame, now_s)

    def on_time(self, now_s: float) -> None:
        """Send again what is due; LinkError when the device has been waited for too long."""
        if not self.is_open:
            self._say_hello(now_s)
            return
        self._output += self._arq.on_time(now_s)
        if not self._arq.idle and now_s >= self._silence_limit_s:
            raise LinkError(self._stall_words(now_s))

    # -- opening ------------------------------------------------------------------------------------------------------

    def _say_hello(self, now_s: float) -> None:
        if now_s >= self._hello_limit_s:
            raise LinkError(
                f"no answer to HELLO within {self.limits.hello_s:g} s ({self._hellos} tries); check that the port is"
                f" the right one, that the board has power, and that the firmware is on it: {_FLASH_IT}"
            )
        if now_s < self._hello_due_s:
            return
        pause_s = HELLO_PAUSES_S[self._hellos] if self._hellos < len(HELLO_PAUSES_S) else HELLO_LATER_PAUSE_S
        self._hellos += 1
        self._hello_due_s = now_s + pause_s
        hello_type, payload = encode(Hello(PROTOCOL_VERSION, self.host_nonce))
        self._output += bytes([DELIMITER]) + encode_frame(_HELLO_SEQ, hello_type, payload)

    def _on_answer_to_hello(self, frame: Frame, now_s: float) -> None:
        if frame.type_code == MessageType.WELCOME and frame.payload:
            if frame.payload[0] != PROTOCOL_VERSION:
                raise LinkError(_version_words(f"speaks protocol version {frame.payload[0]}"))
            welcome = _decode(frame)
            if isinstance(welcome, Welcome) and welcome.host_nonce == self.host_nonce:
                _check_specification(welcome)
                self.welcome = welcome
                self._waiting_since_s = now_s
        elif frame.type_code == MessageType.STATUS and frame.seq == _HELLO_SEQ + 1:
            status = _decode(frame)
            if isinstance(status, Status) and status.refusal == Result.VERSION and status.refusal_seq == _HELLO_SEQ:
                raise LinkError(_version_words("refused the host's protocol version"))

    @property
    def joints(self) -> int:
        """The device's joints; those of the usual board until it has told."""
        return JOINTS if self.welcome is None else self.welcome.joints

    def ask_wiring(self) -> None:
        """Take the answer "wrong state" to CONFIG for what it says: the wiring is right, which is looked at first."""
        self._asking_wiring = True

    def require_board(self, board: Board) -> None:
        """Check that the device is such a board, as far as it tells; its answer to CONFIG tells the rest.

        Raises LinkError when it steps another number of joints.
        """
        self._board = board
        if self.joints != board.joints:
            raise LinkError(
                f"the device's image steps {self.joints} joints, the plan is for the board {board.name} with"
                f" {board.joints}: {_flash_for(board)}"
            )

    # -- an open session ----------------------------------------------------------------------------------------------

    def _on_reply(self, frame: Frame, now_s: float) -> None:
        message = _decode(frame, self.joints)
        if isinstance(message, Welcome):
            self._check_same_boot(message)
        elif isinstance(message, Status):
            self._check_same_device(message)
            self._on_status(frame.seq, message, now_s)

    def _check_same_boot(self, welcome: Welcome) -> None:
        assert self.welcome is not None
        if welcome.boot_nonce != self.welcome.boot_nonce:
            raise LinkError(
                f"the device restarted: its boot nonce went from {self.welcome.boot_nonce:#010x}"
                f" to {welcome.boot_nonce:#010x}"
            )

    def _check_same_device(self, status: Status) -> None:
        """Raise when `status` shows that the device forgot what it was told; every restart leads to idle."""
        assert self.welcome is not None
        if status.state is State.FAULT:
            return  # a device that has just restarted has nothing to fault on
        before = (self.status or self.welcome).ledger.executed_segments
        if status.ledger.executed_segments < before:
            raise LinkError(
                f"the device restarted: its count of executed segments fell from {before}"
                f" to {status.ledger.executed_segments}"
            )
        if self.guarded and status.state is State.IDLE:
            raise LinkError("the device restarted, or another program released its drivers: it reports idle")

    def _on_status(self, ack: int, status: Status, now_s: float) -> None:
        verdict, again = self._arq.on_ack(ack, status.free_bytes, now_s)
        if verdict is Ack.STRAY:
            raise LinkError(
                f"the device restarted, or another program speaks to it: it expects frame {ack},"
                f" the host is at {self._arq.next_seq}"
            )
        if verdict is Ack.ADVANCED:
            self._waiting_since_s = now_s
        self._output += again
        self._count_line_errors(status)
        self.status, self.status_s = status, now_s
        if self._arq.answered_s is not None:
            self.made_s = self.board_clock.take(self._arq.answered_s, status.mcu_ticks, now_s)
        self._raise_fault(status)

    def _count_line_errors(self, status: Status) -> None:
        """The device counts modulo 256 since its boot; the first reply sets the starting point."""
        if self.status is None:
            return
        self.line.crc_errors += (status.crc_errors - self.status.crc_errors) & _MODULO_256
        self.line.overruns += (status.overruns - self.status.overruns) & _MODULO_256
        self.line.ring_full += (status.ring_full - self.status.ring_full) & _MODULO_256

    def _raise_fault(self, status: Status) -> None:
        if self.guarded and status.fault != Fault.NONE:
            raise DeviceFault(fault_words(status.fault, status.detail))
        if status.refusal != Result.OK:
            name = self._names.get(status.refusal_seq, "a frame")
            words = RESULT_WORDS[status.refusal]
            if name == "CONFIG" and status.refusal is Result.WRONG_STATE and self._asking_wiring:
                return
            if name == "CONFIG" and status.refusal is Result.OUT_OF_RANGE and self._board is not None:
                raise LinkError(
                    f"the device's image is not for the wiring {self._board.pin_map!r} of the plan:"
                    f" {_flash_for(self._board)}, or change board.wiring"
                )
            if status.refusal is Result.WRONG_STATE and status.fault is not Fault.NONE:
                raise DeviceFault(fault_words(status.fault, status.detail))  # that is why
            raise DeviceFault(
                f"the device refused {name} (frame {status.refusal_seq}, state {status.state.name.lower()}):"
                f" {words.text}; {words.fix}"
            )

    def _stall_words(self, now_s: float) -> str:
        waited_s = now_s - self._waiting_since_s
        if self._heard_s <= self._waiting_since_s:
            return (
                f"no reply for {waited_s:.2f} s; check the cable, the board's power and that the port is the right one"
            )
        return (
            f"the device answers but took no frame for {waited_s:.2f} s ({self.line.crc_errors} frames damaged,"
            f" {self.line.ring_full + self.line.overruns} bytes lost); check the cable and the baud rate"
        )

    def _encode(self, message: HostMessage) -> bytes:
        """Return the frame as the next one to send; the last is remembered, as it is asked about before it is sent."""
        seq = self._arq.next_seq
        if self._encoded is None or self._encoded[0] is not message or self._encoded[1] != seq:
            self._encoded = (message, seq, encode_frame(seq, *encode(message)))
        return self._encoded[2]


def room_of(message: HostMessage) -> int:
    """Return the bytes that a message takes in the device's queue."""
    return encoded_bytes(message) + QUEUE_FRAME_BYTES if isinstance(message, Segments) else 0


def _flash_for(board: Board) -> str:
    return f"flash its image, planarm flash --board {board.name} --port DEVICE"


def fault_words(fault: Fault, detail: int) -> str:
    """Return what to tell the user about a latched fault with its detail, which tells some faults' joint from 0."""
    words = FAULT_WORDS[fault]
    joint = f"joint {detail + 1}: " if fault in FAULTS_OF_A_JOINT else ""
    return f"the device stopped: {joint}{words.text.removesuffix(DETAIL_WORDS)}; {words.fix}"


def _decode(frame: Frame, joints: int = JOINTS) -> Message:
    try:
        return decode(frame.type_code, frame.payload, joints)
    except WireError as error:
        raise LinkError(f"a reply of the device cannot be read ({error}); {_FLASH_IT}") from error


def _check_specification(welcome: Welcome) -> None:
    if welcome.spec_hash != SPEC_HASH:
        version = ".".join(map(str, welcome.firmware_version))
        raise LinkError(
            f"the device runs firmware {version} made from another protocol description (hash"
            f" {welcome.spec_hash:#010x}, this host has {SPEC_HASH:#010x}); {_FLASH_IT}"
        )


def _version_words(what: str) -> str:
    return f"the device {what}, this host speaks version {PROTOCOL_VERSION}; {_FLASH_IT}"
