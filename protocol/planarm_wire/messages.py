"""The wire's numbers, words and messages.

Generated from protocol/messages.toml by `python -m planarm_wire.generate`; do not edit.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, Final, NamedTuple, TypeAlias

from planarm_wire.boards import Board
from planarm_wire.layout import EACH_JOINT, END, Field

PROTOCOL_VERSION: Final = 2
"""Both ends must have the same."""
SPEC_HASH: Final = 0xBDC44704
"""Hash of the specification without its wording."""
DELIMITER: Final = 0x7E
"""Ends every frame."""
ESCAPE: Final = 0x7D
"""Announces an escaped byte."""
ESCAPE_XOR: Final = 0x20
"""An escaped byte is its code xor this."""
RESERVED: Final = (0x7B, 0x7C)
"""Never inside a frame; receivers drop them."""
HOLD_CODE: Final = 0x7B
"""Out of band, 1 in a row: slows down along the path and rests there; RESUME goes on. Ends a homing."""
HOLD_REPEATS: Final = 1
"""How often in a row the code must come."""
EMERGENCY_CODE: Final = 0x7C
"""Out of band, 3 in a row: ends all pulses at once.

The position is lost. A real emergency stop cuts the motors' supply.
"""
EMERGENCY_REPEATS: Final = 3
"""How often in a row the code must come."""
CRC_INITIAL: Final = 0xFFFF
"""CRC-16/MCRF4XX (reflected 0x1021, initial 0xFFFF, no final xor); sent low byte first."""
HEADER_BYTES: Final = 3
"""Length, seq and type."""
CRC_BYTES: Final = 2
"""Of each of the two checks."""
MAX_PAYLOAD_BYTES: Final = 64
"""Before stuffing."""
TICKS_HZ: Final = 16_000_000
"""Timer1 and path clock, prescaler 1."""
JOINTS: Final = 2
"""Joints of the board uno; a field that is there for each joint has as many entries as the device has joints (2 or 4).
"""
BAUD: Final = 250_000
"""Exact on a 16 MHz Uno (UBRR 7, U2X)."""
RX_RING_BYTES: Final = 128
"""Receive ring of the firmware."""
HOST_WINDOW_BYTES: Final = 112
"""Most unacknowledged bytes, as encoded, the host may have in flight."""
QUEUE_BYTES: Final = 848
"""Of the board uno: bytes of queued segments it holds; a SEGMENTS frame takes its payload and queue_frame_bytes."""
QUEUE_FRAME_BYTES: Final = 1
"""Bytes that each queued SEGMENTS frame takes besides its payload."""
MIN_INTERVAL_TICKS: Final = 225
"""Of the board uno: least time between two steps of one joint, 71,111 steps/s; min_dir_setup_ticks more for a turn."""
NEED_UNIT_TICKS: Final = 32_768
"""Unit of a segment's need, 2.048 ms."""
MAX_STRETCH: Final = 4_096
"""Most by which the device stretches the path clock."""
GENTLE_PERCENT: Final = 50
"""Share of slow and fast that hold, stop, resume and override use; quick stop and a starving queue use all of slow."""
DEFAULT_START_STOP_TICKS: Final = 160_000
"""Interval of the start-stop speed until CONFIG tells it, 100 steps/s."""
DEFAULT_WAKE_TICKS: Final = 160_000
"""Least time from ENABLE to the first step until CONFIG tells it, 10 ms."""
WATCHDOG_MS: Final = 250
"""The watchdog resets the chip when the main program stands still for so long."""
DEBOUNCE_TICKS: Final = 80_000
"""A limit switch counts when it stays so for this long, 5 ms."""
MIN_HOMING_TICKS: Final = 4_000
"""Least interval of a homing, 4,000 steps/s: its steps are handed over one by one."""
MAX_INTERVAL_TICKS: Final = 65_535
"""Largest interval inside a move that begins with a shorter one than slow_interval_ticks."""
SLOW_INTERVAL_TICKS: Final = 65_536
"""4.1 ms; a move of two steps or more that begins with so long an interval is slow, and has limits of its own."""
MIN_SLOW_INTERVAL_TICKS: Final = 32_768
"""Least interval inside a slow move."""
MAX_SLOW_INTERVAL_TICKS: Final = 16_777_215
"""Largest interval inside a slow move, 1.05 s; longer gaps need a segment of their own."""
MAX_COARSE_STEPS: Final = 128
"""A move of so many steps or fewer tells its add in 2^-8 ticks; a slow move has no more."""
SLICE_TICKS: Final = 57_000
"""The device cuts segments into slices of 3.6 ms, the last two alike.

With each doubling of the stretch they are half as long, the last up to twice. One run of a joint fills a slice at
its least interval. The path clock's rate changes from slice to slice.
"""
MAX_SEGMENT_TICKS: Final = 1_073_741_823
"""Longest segment, about 67 s."""
MAX_SEGMENT_STEPS: Final = 32_767
"""Most steps of one joint in one segment."""
MIN_LEAD_TICKS: Final = 56_000
"""Least lead of START, 3.5 ms, in which the first slice of all joints is prepared."""
STARVING_TICKS: Final = 65_536
"""Path that the queue must hold beyond what a rest needs, 4.1 ms; with less the device slows down."""
MIN_STEP_HIGH_TICKS: Final = 56
"""Of the board uno: least high time of a step pulse, 3.5 us."""
MIN_STEP_LOW_TICKS: Final = 40
"""Of the board uno: least low time of a step pulse, 2.5 us."""
MIN_DIR_SETUP_TICKS: Final = 320
"""Least time from a DIR edge to the next rising STEP edge, 20 us."""
STEP_PINS: Final = ("D9", "D10")
"""Of uno, one a joint; the step is the rising edge."""
DIR_PINS: Final = ("D4", "D5")
"""Of uno, one a joint; high is positive."""
ENABLE_PIN: Final = "D8"
"""Active low."""
BOARDS: Final[dict[str, Board]] = {
    "uno": Board(
        name="uno",
        doc="Own wiring, two joints: every step rises by Timer1's compare outputs, on its tick",
        pin_map="own",
        joints=2,
        queue_bytes=848,
        min_interval_ticks=225,
        min_step_high_ticks=56,
        min_step_low_ticks=40,
        step_pins=("D9", "D10"),
        dir_pins=("D4", "D5"),
        enable_pin="D8",
        stop_pin="A0",
        limit_pins=("A1", "A2"),
    ),
    "uno_four": Board(
        name="uno_four",
        doc="Own wiring, four joints: joints 1 and 2 as with two, joints 3 and 4 stepped by interrupts",
        pin_map="own",
        joints=4,
        queue_bytes=582,
        min_interval_ticks=1_000,
        min_step_high_ticks=56,
        min_step_low_ticks=40,
        step_pins=("D9", "D10", "D6", "D7"),
        dir_pins=("D4", "D5", "D2", "D3"),
        enable_pin="D8",
        stop_pin="A0",
        limit_pins=("A1", "A2", "A3", "A4"),
    ),
    "uno_slow": Board(
        name="uno_slow",
        doc="Own wiring, two joints, long pulses: Timer1's compare outputs make both edges of every step",
        pin_map="own_slow",
        joints=2,
        queue_bytes=848,
        min_interval_ticks=450,
        min_step_high_ticks=240,
        min_step_low_ticks=200,
        step_pins=("D9", "D10"),
        dir_pins=("D4", "D5"),
        enable_pin="D8",
        stop_pin="A0",
        limit_pins=("A1", "A2"),
    ),
    "cnc_shield": Board(
        name="cnc_shield",
        doc="The Arduino CNC shield as it is, slots X and Y: every step rises in an interrupt",
        pin_map="cnc_shield",
        joints=2,
        queue_bytes=848,
        min_interval_ticks=320,
        min_step_high_ticks=56,
        min_step_low_ticks=40,
        step_pins=("D2", "D3"),
        dir_pins=("D5", "D6"),
        enable_pin="D8",
        stop_pin="A0",
        limit_pins=("D9", "D10"),
    ),
    "cnc_shield_four": Board(
        name="cnc_shield_four",
        doc="The Arduino CNC shield as it is, slots X, Y, Z and A (D12 and D13): every step rises in an interrupt",
        pin_map="cnc_shield",
        joints=4,
        queue_bytes=582,
        min_interval_ticks=1_280,
        min_step_high_ticks=56,
        min_step_low_ticks=40,
        step_pins=("D2", "D3", "D4", "D12"),
        dir_pins=("D5", "D6", "D7", "D13"),
        enable_pin="D8",
        stop_pin="A0",
        limit_pins=("D9", "D10", "D11", "A4"),
    ),
}
"""By name; each has a flash image."""


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
    """From the host.

    Appends segments, all or none. A broken limit latches bad_segment. The head holds for all segments of the
    message. A rate is a code c of the value v = c below 16, else (16 + c mod 16) 2^(c div 16 - 1), and means v
    2^-32 a tick: the path clock's rate, 1 when not stretched, may change by that much in each tick.
    """
    START = 5
    """From the host. Begins the queued motion: the first segment starts lead_ticks from now."""
    CLEAR = 6
    """From the host.

    Clears a latched fault and the refusal and drops the queue. The drivers stay on where the position is known:
    ready, held, starved and most faults to ready; after emergency_stop, stop_input and homing_failed they are
    released, to idle; idle stays. Position counters stay.
    """
    RESUME = 7
    """From the host.

    Goes on after a hold, also one that is still slowing down. In any other state it changes nothing.
    """
    OVERRIDE = 8
    """From the host.

    Sets the rate of the path clock, for this motion and those after it. The rate changes within the segments'
    allowances.
    """
    STOP = 9
    """From the host.

    Slows down along the path, then drops the rest of the motion; the position is kept. Answered at once; the stop
    is over when STATUS tells ready.
    """
    CONFIG = 0xA
    """From the host.

    Tells the arm's wiring and drivers; only in state idle. Until it comes, and after every reset, the defaults of
    the limits hold, nothing is inverted, and no input is used.
    """
    SOFT_LIMITS = 0xB
    """From the host.

    Tells where each joint may be, in terms of the ledger's position; segments that leave it latch soft_limit.
    Refused while segments are queued, which were checked against the limits of before. Least above most: no limit,
    as after a reset.
    """
    HOME = 0xC
    """From the host.

    Moves one joint to its limit switch and off it again, slowly the second time. Only in state ready, with limit
    switches watched. The order of the joints is the host's. Ends in ready with the joint on the step at which the
    switch closed, or in homing_failed. The ledger counts on: the host compares its count at the switch with the
    switch's place, which tells the steps lost, and sends SET_POSITION.
    """
    SET_POSITION = 0xD
    """From the host. Tells the position of an arm at rest: the ledger counts on from there. Only in idle and ready."""
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
    """Executing segments, slowed down while the queue starves; more may be queued."""
    FAULT = 3
    """Pulses stopped, first fault latched, drivers keep holding.

    An emergency stop takes the place of a fault that keeps the position, and may release the drivers. CLEAR leads
    to ready, or to idle where the position is lost.
    """
    HOLDING = 4
    """Slowing down along the path towards a hold."""
    HELD = 5
    """At rest on the path after a hold; RESUME goes on, STOP drops the rest."""
    STARVED = 6
    """At rest on the path because the queue ran low; goes on by itself when it is filled."""
    STOPPING = 7
    """Slowing down along the path; then the rest is dropped and the state is ready."""
    HOMING = 8
    """Moving one joint to its limit switch."""


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
    EMERGENCY_STOP = 5
    """An emergency stop came over the line; the position is lost."""
    STOP_INPUT = 6
    """The stop input opened; the position is lost."""
    LIMIT_SWITCH = 7
    """A limit switch closed during a motion; detail tells the joint."""
    SOFT_LIMIT = 8
    """A segment would leave a joint's soft limits; detail tells the joint."""
    HOMING_FAILED = 9
    """The limit switch was not found, or did not open again; detail tells the joint."""


class Reset(IntEnum):
    """Why the device last started."""

    UNKNOWN = 0
    """The chip does not tell, and its memory was in use before: reset line, short loss of power.

    Or the watchdog, where the main program stood still with interrupts off.
    """
    POWER_ON = 1
    """Power came on."""
    EXTERNAL = 2
    """The reset line, as when a port is opened."""
    BROWN_OUT = 3
    """The supply fell below the brown-out level."""
    WATCHDOG = 4
    """The main program stood still and the watchdog reset the chip."""


class PinMap(IntEnum):
    """Where the drivers are wired."""

    OWN = 0
    """Own wiring: STEP on the compare outputs D9 and D10."""
    OWN_SLOW = 2
    """Own wiring as well, for drivers that need longer pulses."""
    CNC_SHIELD = 1
    """The Arduino CNC shield as it is: STEP on D2 and D3, by interrupt."""


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
    Fault.EMERGENCY_STOP: Words(
        "an emergency stop came over the line; the position is lost",
        "home the arm before the next motion",
    ),
    Fault.STOP_INPUT: Words("the stop input opened; the position is lost", "close the stop circuit, then home the arm"),
    Fault.LIMIT_SWITCH: Words(
        "a limit switch closed during a motion; detail tells the joint",
        "jog the arm off the switch, and check the limits of the plan",
    ),
    Fault.SOFT_LIMIT: Words(
        "a segment would leave a joint's soft limits; detail tells the joint",
        "check the start position, or the limits in the scene",
    ),
    Fault.HOMING_FAILED: Words(
        "the limit switch was not found, or did not open again; detail tells the joint",
        "check the switch, its polarity and the homing distance",
    ),
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

    Step n (0 .. steps - 1) rises first_ticks + floor((256 n I + n (n - 1) / 2 A) / 2^16) ticks after the segment's
    start, where I = interval_q8 and A = 256 add; in a move of more than max_coarse_steps, A = add.

    On the wire 1 to 20 bytes.
    """

    steps_dir: int
    """2 x number of steps, plus 1 when the joint turns in the positive direction; 0 or 1 means the joint rests.

    (usteps, varuint)
    """
    first_ticks: int = 0
    """First rising edge after the segment's start. (ticks, varuint, only when steps_dir >= 2, else 0)"""
    interval_q8: int = 0
    """Interval from step 0 to step 1. (ticks/2^8, varuint, only when steps_dir >= 4, else 0)"""
    add: int = 0
    """What each interval has more than the one before; in a move of more than max_coarse_steps, in ticks/2^16.

    (ticks/2^8, varint, only when steps_dir >= 4, else 0)
    """


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of the path clock with one run of steps for each joint.

    On the wire 3 to 45 bytes.
    """

    duration_flags: int
    """2 x duration in ticks, plus 1 on the last segment of a motion. (ticks, varuint)"""
    moves: tuple[Move, ...]
    """One entry a joint. (joints x move)"""


@dataclass(frozen=True, slots=True)
class Ledger:
    """What was executed, counted where the pulses are made.

    On the wire 12 bytes.
    """

    executed_segments: int
    """Whole segments executed since boot. (u32)"""
    position_usteps: tuple[int, ...]
    """Signed steps of each joint since boot, the running segment's included. (usteps, joints x i32)"""


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

    A broken limit latches bad_segment. The head holds for all segments of the message. A rate is a code c of the
    value v = c below 16, else (16 + c mod 16) 2^(c div 16 - 1), and means v 2^-32 a tick: the path clock's rate, 1
    when not stretched, may change by that much in each tick.

    From the host, payload 6 to 64 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.SEGMENTS

    slow: int
    """Rate code: largest slowing of the path clock; 0: it must not be slowed. (u8)"""
    fast: int
    """Rate code: largest speeding up of the path clock. (u8)"""
    need: int
    """Path time needed to come to rest, the most from any slice's start in the message, rounded up; 255: that or more.

    (need_unit_ticks, u8)
    """
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
    """Clears a latched fault and the refusal and drops the queue.

    The drivers stay on where the position is known: ready, held, starved and most faults to ready; after
    emergency_stop, stop_input and homing_failed they are released, to idle; idle stays. Position counters stay.

    From the host, payload 0 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.CLEAR


@dataclass(frozen=True, slots=True)
class Resume:
    """Goes on after a hold, also one that is still slowing down.

    In any other state it changes nothing.

    From the host, payload 0 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.RESUME


@dataclass(frozen=True, slots=True)
class Override:
    """Sets the rate of the path clock, for this motion and those after it.

    The rate changes within the segments' allowances.

    From the host, payload 1 byte.
    """

    TYPE: ClassVar[MessageType] = MessageType.OVERRIDE

    percent: int
    """1 to 100. (%, u8)"""


@dataclass(frozen=True, slots=True)
class Stop:
    """Slows down along the path, then drops the rest of the motion; the position is kept.

    Answered at once; the stop is over when STATUS tells ready.

    From the host, payload 1 byte.
    """

    TYPE: ClassVar[MessageType] = MessageType.STOP

    quick: int
    """1 slows down as fast as the segments allow, 0 by gentle_percent of that. (u8)"""


@dataclass(frozen=True, slots=True)
class Config:
    """Tells the arm's wiring and drivers; only in state idle.

    Until it comes, and after every reset, the defaults of the limits hold, nothing is inverted, and no input is
    used.

    From the host, payload 22 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.CONFIG

    pin_map: PinMap
    """Where the drivers are wired; must be the image's own. (u8)"""
    joints: int
    """Joints that segments tell of. (u8)"""
    dir_inverted: int
    """Bit j: DIR of joint j is low for the positive direction. (u8)"""
    options: int
    """A set of bits.

    0: ENABLE is active high; 1: an emergency stop releases the drivers; 2: the stop input is watched; 3: limit
    switches are watched, and in motion only those that were open since it began, so that an arm can leave them; 4:
    limit switches open when hit. (u8)
    """
    idle_ms: int
    """Drivers are released after so long in state ready; 0: never. (ms, u32)"""
    wake_ticks: int
    """Least time from ENABLE to the first step. (ticks, u32)"""
    high_ticks: int
    """Least high time of a step pulse that the drivers need.

    This firmware takes up to min_step_high_ticks. (ticks, u16)
    """
    start_stop_ticks: tuple[int, ...]
    """Interval of each joint's start-stop speed, from which it may stop dead. (ticks, joints x u32)"""


@dataclass(frozen=True, slots=True)
class SoftLimits:
    """Tells where each joint may be, in terms of the ledger's position; segments that leave it latch soft_limit.

    Refused while segments are queued, which were checked against the limits of before. Least above most: no limit,
    as after a reset.

    From the host, payload 16 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.SOFT_LIMITS

    least_usteps: tuple[int, ...]
    """Of each joint. (usteps, joints x i32)"""
    most_usteps: tuple[int, ...]
    """Of each joint. (usteps, joints x i32)"""


@dataclass(frozen=True, slots=True)
class Home:
    """Moves one joint to its limit switch and off it again, slowly the second time.

    Only in state ready, with limit switches watched. The order of the joints is the host's. Ends in ready with the
    joint on the step at which the switch closed, or in homing_failed. The ledger counts on: the host compares its
    count at the switch with the switch's place, which tells the steps lost, and sends SET_POSITION.

    From the host, payload 18 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.HOME

    joint: int
    """From 0. (u8)"""
    positive: int
    """1 when the switch lies in the positive direction. (u8)"""
    fast_ticks: int
    """Interval of the steps towards the switch; at least min_homing_ticks. (ticks, u32)"""
    slow_ticks: int
    """Interval of the steps off it and onto it again; at least fast_ticks, and 2 debounce_ticks. (ticks, u32)"""
    most_usteps: int
    """Farthest way to the switch. (usteps, u32)"""
    back_usteps: int
    """Farthest way off the switch. (usteps, u32)"""


@dataclass(frozen=True, slots=True)
class SetPosition:
    """Tells the position of an arm at rest: the ledger counts on from there.

    Only in idle and ready.

    From the host, payload 8 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.SET_POSITION

    position_usteps: tuple[int, ...]
    """Of each joint. (usteps, joints x i32)"""


@dataclass(frozen=True, slots=True)
class Welcome:
    """Answers HELLO.

    From the device, payload 31 bytes.
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
    reset_cause: Reset
    """Why the device last started, as far as it can be told. (u8)"""
    interrupted: int
    """1 when the drivers were enabled at the last reset: the arm may have moved by itself. (u8)"""
    joints: int
    """Joints that segments and ledger tell of. (u8)"""
    ledger: Ledger
    """Executed so far. (ledger)"""


@dataclass(frozen=True, slots=True)
class Status:
    """Answers every frame but HELLO, and every frame that failed its checks.

    Sent unasked when a motion ends or a fault latches.

    From the device, payload 30 bytes.
    """

    TYPE: ClassVar[MessageType] = MessageType.STATUS

    state: State
    """What the device is doing. (u8)"""
    fault: Fault
    """The latched fault, or none. (u8)"""
    detail: int
    """Of the fault: the joint, from 0, where a joint is meant. (u8)"""
    refusal: Result
    """First refusal (a negative result) since HELLO or CLEAR; ok (0) when none. (i8)"""
    refusal_seq: int
    """Sequence number of the refused frame. (u8)"""
    free_bytes: int
    """Room in the queue now, less the bytes of one frame's head. (bytes, u16)"""
    crc_errors: int
    """Frames that failed a check, modulo 256. (u8)"""
    overruns: int
    """Bytes lost in the USART (DOR), modulo 256. (u8)"""
    ring_full: int
    """Bytes lost because the receive ring was full, modulo 256. (u8)"""
    holds: int
    """Hold bytes received, modulo 256. (u8)"""
    inputs: int
    """Bit j: the limit switch of joint j is hit; bit 7: the stop input is open. (u8)"""
    override_percent: int
    """As set. (%, u8)"""
    rate_percent: int
    """Of the path clock in the segment prepared last, rounded down. (%, u8)"""
    mcu_ticks: int
    """Clock at the moment of the reply, modulo 2^32. (ticks, u32)"""
    ledger: Ledger
    """Executed so far. (ledger)"""


HostMessage: TypeAlias = (
    Hello
    | Query
    | Enable
    | Segments
    | Start
    | Clear
    | Resume
    | Override
    | Stop
    | Config
    | SoftLimits
    | Home
    | SetPosition
)
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
    Resume.TYPE: Resume,
    Override.TYPE: Override,
    Stop.TYPE: Stop,
    Config.TYPE: Config,
    SoftLimits.TYPE: SoftLimits,
    Home.TYPE: Home,
    SetPosition.TYPE: SetPosition,
    Welcome.TYPE: Welcome,
    Status.TYPE: Status,
}
"""The class for each type code."""

LAYOUTS: Final[dict[type[Message | Struct], tuple[Field, ...]]] = {
    Move: (
        Field("steps_dir", "varuint"),
        Field("first_ticks", "varuint", when=("steps_dir", 2)),
        Field("interval_q8", "varuint", when=("steps_dir", 4)),
        Field("add", "varint", when=("steps_dir", 4)),
    ),
    Segment: (
        Field("duration_flags", "varuint"),
        Field("moves", Move, repeat=EACH_JOINT),
    ),
    Ledger: (
        Field("executed_segments", "u32"),
        Field("position_usteps", "i32", repeat=EACH_JOINT),
    ),
    Hello: (
        Field("protocol_version", "u8"),
        Field("host_nonce", "u32"),
    ),
    Query: (),
    Enable: (Field("on", "u8"),),
    Segments: (
        Field("slow", "u8"),
        Field("fast", "u8"),
        Field("need", "u8"),
        Field("segments", Segment, repeat=END),
    ),
    Start: (Field("lead_ticks", "u32"),),
    Clear: (),
    Resume: (),
    Override: (Field("percent", "u8"),),
    Stop: (Field("quick", "u8"),),
    Config: (
        Field("pin_map", "u8", enum=PinMap),
        Field("joints", "u8"),
        Field("dir_inverted", "u8"),
        Field("options", "u8"),
        Field("idle_ms", "u32"),
        Field("wake_ticks", "u32"),
        Field("high_ticks", "u16"),
        Field("start_stop_ticks", "u32", repeat=EACH_JOINT),
    ),
    SoftLimits: (
        Field("least_usteps", "i32", repeat=EACH_JOINT),
        Field("most_usteps", "i32", repeat=EACH_JOINT),
    ),
    Home: (
        Field("joint", "u8"),
        Field("positive", "u8"),
        Field("fast_ticks", "u32"),
        Field("slow_ticks", "u32"),
        Field("most_usteps", "u32"),
        Field("back_usteps", "u32"),
    ),
    SetPosition: (Field("position_usteps", "i32", repeat=EACH_JOINT),),
    Welcome: (
        Field("protocol_version", "u8"),
        Field("host_nonce", "u32"),
        Field("boot_nonce", "u32"),
        Field("spec_hash", "u32"),
        Field("firmware_version", "u8", repeat=3),
        Field("reset_cause", "u8", enum=Reset),
        Field("interrupted", "u8"),
        Field("joints", "u8"),
        Field("ledger", Ledger),
    ),
    Status: (
        Field("state", "u8", enum=State),
        Field("fault", "u8", enum=Fault),
        Field("detail", "u8"),
        Field("refusal", "i8", enum=Result),
        Field("refusal_seq", "u8"),
        Field("free_bytes", "u16"),
        Field("crc_errors", "u8"),
        Field("overruns", "u8"),
        Field("ring_full", "u8"),
        Field("holds", "u8"),
        Field("inputs", "u8"),
        Field("override_percent", "u8"),
        Field("rate_percent", "u8"),
        Field("mcu_ticks", "u32"),
        Field("ledger", Ledger),
    ),
}
"""The fields of each message and struct, in the order of the wire."""
