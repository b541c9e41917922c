"""The wire's numbers, words and messages.

Generated from protocol/messages.toml by `python -m planarm_wire.generate`; do not edit.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, Final, NamedTuple, TypeAlias

from planarm_wire.layout import END, Field

PROTOCOL_VERSION: Final = 1
"""Both ends must have the same."""
SPEC_HASH: Final = 0xD92A41EC
"""Hash of the specification without its wording."""
DELIMITER: Final = 0x7E
"""Ends every frame."""
ESCAPE: Final = 0x7D
"""Announces an escaped byte."""
ESCAPE_XOR: Final = 0x20
"""An escaped byte is its code xor this."""
RESERVED: Final = (0x7B, 0x7C)
"""Never inside a frame; receivers drop them."""
CRC_INITIAL: Final = 0xFFFF
"""CRC-16/MCRF4XX (reflected 0x1021, initial 0xFFFF, no final xor); sent low byte first."""
HEADER_BYTES: Final = 3
"""Length, seq and type."""
CRC_BYTES: Final = 2
"""Of each of the two checks."""
MAX_PAYLOAD_BYTES: Final = 48
"""Before stuffing."""
TICKS_HZ: Final = 16_000_000
"""Timer1 and path clock, prescaler 1."""
JOINTS: Final = 2
"""Joints stepped by the compare outputs."""
BAUD: Final = 250_000
"""Exact on a 16 MHz Uno (UBRR 7, U2X)."""
RX_RING_BYTES: Final = 128
"""Receive ring of the firmware."""
HOST_WINDOW_BYTES: Final = 112
"""Most unacknowledged bytes, as encoded, the host may have in flight."""
QUEUE_SLOTS: Final = 32
"""Segments the firmware holds."""
MIN_INTERVAL_TICKS: Final = 320
"""Least time between two steps of one joint; min_dir_setup_ticks more where it turns round."""
MAX_INTERVAL_TICKS: Final = 60_000
"""Largest interval inside a run of more than one step; longer gaps need a segment of their own."""
MAX_SEGMENT_TICKS: Final = 1_073_741_823
"""Longest segment, about 67 s."""
MAX_SEGMENT_STEPS: Final = 32_767
"""Most steps of one joint in one segment."""
MIN_LEAD_TICKS: Final = 16_000
"""Least lead of START, 1 ms."""
MIN_STEP_HIGH_TICKS: Final = 32
"""Least high time of a step pulse, 2 us."""
MIN_STEP_LOW_TICKS: Final = 32
"""Least low time of a step pulse, 2 us."""
MIN_DIR_SETUP_TICKS: Final = 320
"""Least time from a DIR edge to the next rising STEP edge, 20 us."""
STEP_PINS: Final = ("D9", "D10")
"""One a joint; the step is the rising edge."""
DIR_PINS: Final = ("D4", "D5")
"""One a joint; high is the positive direction."""
ENABLE_PIN: Final = "D8"
"""Active low."""


class MessageType(IntEnum):
    """Type codes of the messages."""

    HELLO = 1
    """From the host. Opens a session and starts the sequence. Motion in progress goes on. Answered by WELCOME."""
    QUERY = 2
    """From the host. Asks for STATUS."""
    ENABLE = 3
    """From the host.

    Energises (1) or releases (0) the drivers: idle to ready, ready to idle. Releasing drops queued segments.
    """
    SEGMENTS = 4
    """From the host. Appends segments, all or none. A broken limit latches bad_segment."""
    START = 5
    """From the host. Begins the queued motion: the first segment starts lead_ticks from now."""
    CLEAR = 6
    """From the host.

    Clears a latched fault and the refusal, drops the queue and releases the drivers: fault, ready or idle to idle.
    Position counters stay.
    """
    WELCOME = 0x81
    """From the device. Answers HELLO."""
    STATUS = 0x82
    """From the device.

    Answers every frame but HELLO, and every frame that failed its checks. Sent unasked when a motion ends or a
    fault latches.
    """


class State(IntEnum):
    """What the device is doing."""

    IDLE = 0
    """Drivers released, nothing queued; segments are refused."""
    READY = 1
    """Drivers enabled, at rest; segments may be queued."""
    RUNNING = 2
    """Executing segments; more may be queued."""
    FAULT = 3
    """Pulses stopped, first fault latched, drivers keep holding; CLEAR leads to idle."""


class Fault(IntEnum):
    """Why the device stopped its pulses."""

    NONE = 0
    """No fault."""
    MISSED_DEADLINE = 1
    """A step could not be placed on its tick."""
    UNDERRUN = 2
    """The segment queue ran empty before the last segment."""
    BAD_SEGMENT = 3
    """A segment broke a limit of the protocol."""
    QUEUE_MISUSE = 4
    """Segments arrived after the last segment of a motion."""


class Result(IntEnum):
    """How a command went: 0 done, above 0 send it again, below 0 refused."""

    OK = 0
    """Done."""
    BUSY = 1
    """No free slot."""
    WRONG_STATE = -1
    """The command does not fit the state."""
    MALFORMED = -2
    """The payload does not have the message's form."""
    UNKNOWN_TYPE = -3
    """No such message."""
    OUT_OF_RANGE = -4
    """A value is outside its limits."""
    VERSION = -5
    """The protocol version differs."""


class Words(NamedTuple):
    """What to tell the user about a code."""

    text: str
    """What happened."""
    fix: str
    """What to do about it; empty when there is nothing to do."""


FAULT_WORDS: Final[dict[Fault, Words]] = {
    Fault.NONE: Words("no fault", ""),
    Fault.MISSED_DEADLINE: Words(
        "a step could not be placed on its tick",
        "lower max_speed of the joint, or raise the least interval",
    ),
    Fault.UNDERRUN: Words(
        "the segment queue ran empty before the last segment",
        "check the cable and the host's load; raise the baud rate",
    ),
    Fault.BAD_SEGMENT: Words(
        "a segment broke a limit of the protocol",
        "host and firmware disagree: flash the released image",
    ),
    Fault.QUEUE_MISUSE: Words("segments arrived after the last segment of a motion", "wait until the motion is done"),
}
"""The words of each fault."""

RESULT_WORDS: Final[dict[Result, Words]] = {
    Result.OK: Words("done", ""),
    Result.BUSY: Words("no free slot", "send the frame again"),
    Result.WRONG_STATE: Words(
        "the command does not fit the state",
        "ask for the state with QUERY; after a fault send CLEAR, then ENABLE",
    ),
    Result.MALFORMED: Words(
        "the payload does not have the message's form",
        "host and firmware disagree: flash the released image",
    ),
    Result.UNKNOWN_TYPE: Words("no such message", "host and firmware disagree: flash the released image"),
    Result.OUT_OF_RANGE: Words("a value is outside its limits", "keep to the limits of this protocol"),
    Result.VERSION: Words("the protocol version differs", "flash the image that was released with this host"),
}
"""The words of each result."""


@dataclass(frozen=True, slots=True)
class Move:
    """One joint's steps in a segment, in closed form.

    Step n (0 .. steps - 1) rises first_ticks + floor((n I + n (n - 1) / 2 A) / 2^16) ticks after the segment's
    start, where I = interval_q16 and A = add_q16.

    On the wire 1 to 20 bytes.
    """

    steps_dir: int
    """2 x number of steps, plus 1 when the joint turns in the positive direction; 0 or 1 means the joint rests.

    (usteps, varuint)
    """
    first_ticks: int = 0
    """First rising edge after the segment's start. (ticks, varuint, only when steps_dir >= 2, else 0)"""
    interval_q16: int = 0
    """Interval from step 0 to step 1. (ticks/2^16, varuint, only when steps_dir >= 4, else 0)"""
    add_q16: int = 0
    """What each interval has more than the one before. (ticks/2^16, varint, only when steps_dir >= 4, else 0)"""


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of the path clock with one run of steps for each joint.

    On the wire 3 to 45 bytes.
    """

    duration_flags: int
    """2 x duration in ticks, plus 1 on the last segment of a motion. (ticks, varuint)"""
    moves: tuple[Move, ...]
    """One entry a joint. (2 x move)"""


@dataclass(frozen=True, slots=True)
class Ledger:
    """What was executed, counted where the pulses are made.

    On the wire 12 bytes.
    """

    executed_segments: int
    """Whole segments executed since boot. (u32)"""
    position_usteps: tuple[int, ...]
    """Signed steps of each joint since boot, the running segment's included. (usteps, 2 x i32)"""


@dataclass(frozen=True, slots=True)
class Hello:
    """Opens a session and starts the sequence.

    Motion in progress goes on. Answered by WELCOME.

    From the host, payload 5 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.HELLO

    protocol_version: int
    """Must equal the device's. (u8)"""
    host_nonce: int
    """Echoed in WELCOME, so that an old reply is not taken for a new one. (u32)"""


@dataclass(frozen=True, slots=True)
class Query:
    """Asks for STATUS.

    From the host, payload 0 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.QUERY


@dataclass(frozen=True, slots=True)
class Enable:
    """Energises (1) or releases (0) the drivers: idle to ready, ready to idle.

    Releasing drops queued segments.

    From the host, payload 1 byte.
    """

    TYPE: ClassVar[MessageType] = MessageType.ENABLE

    on: int
    """1 or 0. (u8)"""


@dataclass(frozen=True, slots=True)
class Segments:
    """Appends segments, all or none.

    A broken limit latches bad_segment.

    From the host, payload 3 to 48 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.SEGMENTS

    segments: tuple[Segment, ...]
    """In the order of their execution. (segment)"""


@dataclass(frozen=True, slots=True)
class Start:
    """Begins the queued motion: the first segment starts lead_ticks from now.

    From the host, payload 4 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.START

    lead_ticks: int
    """At least min_lead_ticks. (ticks, u32)"""


@dataclass(frozen=True, slots=True)
class Clear:
    """Clears a latched fault and the refusal, drops the queue and releases the drivers: fault, ready or idle to idle.

    Position counters stay.

    From the host, payload 0 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.CLEAR


@dataclass(frozen=True, slots=True)
class Welcome:
    """Answers HELLO.

    From the device, payload 28 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.WELCOME

    protocol_version: int
    """The device's. (u8)"""
    host_nonce: int
    """From HELLO. (u32)"""
    boot_nonce: int
    """Differs after every reset. (u32)"""
    spec_hash: int
    """First four bytes of the SHA-256 of the specification without its wording (see Specification hash). (u32)"""
    firmware_version: tuple[int, int, int]
    """Major, minor, patch. (3 x u8)"""
    ledger: Ledger
    """Executed so far. (ledger)"""


@dataclass(frozen=True, slots=True)
class Status:
    """Answers every frame but HELLO, and every frame that failed its checks.

    Sent unasked when a motion ends or a fault latches.

    From the device, payload 24 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.STATUS

    state: State
    """What the device is doing. (u8)"""
    fault: Fault
    """The latched fault, or none. (u8)"""
    refusal: Result
    """First refusal (a negative result) since HELLO or CLEAR; ok (0) when none. (i8)"""
    refusal_seq: int
    """Sequence number of the refused frame. (u8)"""
    free_slots: int
    """Segments that can be queued now. (segments, u8)"""
    crc_errors: int
    """Frames that failed a check, modulo 256. (u8)"""
    overruns: int
    """Bytes lost in the USART (DOR), modulo 256. (u8)"""
    ring_full: int
    """Bytes lost because the receive ring was full, modulo 256. (u8)"""
    mcu_ticks: int
    """Clock at the moment of the reply, modulo 2^32. (ticks, u32)"""
    ledger: Ledger
    """Executed so far. (ledger)"""


HostMessage: TypeAlias = Hello | Query | Enable | Segments | Start | Clear
DeviceMessage: TypeAlias = Welcome | Status
Struct: TypeAlias = Move | Segment | Ledger
Message: TypeAlias = HostMessage | DeviceMessage

MESSAGES: Final[dict[int, type[Message]]] = {
    Hello.TYPE: Hello,
    Query.TYPE: Query,
    Enable.TYPE: Enable,
    Segments.TYPE: Segments,
    Start.TYPE: Start,
    Clear.TYPE: Clear,
    Welcome.TYPE: Welcome,
    Status.TYPE: Status,
}
"""The class for each type code."""

LAYOUTS: Final[dict[type[Message | Struct], tuple[Field, ...]]] = {
    Move: (
        Field("steps_dir", "varuint"),
        Field("first_ticks", "varuint", when=("steps_dir", 2)),
        Field("interval_q16", "varuint", when=("steps_dir", 4)),
        Field("add_q16", "varint", when=("steps_dir", 4)),
    ),
    Segment: (
        Field("duration_flags", "varuint"),
        Field("moves", Move, repeat=2),
    ),
    Ledger: (
        Field("executed_segments", "u32"),
        Field("position_usteps", "i32", repeat=2),
    ),
    Hello: (
        Field("protocol_version", "u8"),
        Field("host_nonce", "u32"),
    ),
    Query: (),
    Enable: (Field("on", "u8"),),
    Segments: (Field("segments", Segment, repeat=END),),
    Start: (Field("lead_ticks", "u32"),),
    Clear: (),
    Welcome: (
        Field("protocol_version", "u8"),
        Field("host_nonce", "u32"),
        Field("boot_nonce", "u32"),
        Field("spec_hash", "u32"),
        Field("firmware_version", "u8", repeat=3),
        Field("ledger", Ledger),
    ),
    Status: (
        Field("state", "u8", enum=State),
        Field("fault", "u8", enum=Fault),
        Field("refusal", "i8", enum=Result),
        Field("refusal_seq", "u8"),
        Field("free_slots", "u8"),
        Field("crc_errors", "u8"),
        Field("overruns", "u8"),
        Field("ring_full", "u8"),
        Field("mcu_ticks", "u32"),
        Field("ledger", Ledger),
    ),
}
"""The fields of each message and struct, in the order of the wire."""
