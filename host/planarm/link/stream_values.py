"""What a stream is given and what it tells, as values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto

from planarm.link.arq import Resent
from planarm.link.clock_sync import Span
from planarm_wire.boards import Board
from planarm_wire.messages import (
    DEFAULT_START_STOP_TICKS,
    DEFAULT_WAKE_TICKS,
    Config,
    Fault,
    Ledger,
    PinMap,
    SetPosition,
    SoftLimits,
    State,
)
from planarm_wire.rates import Allowance
from planarm_wire.wirings import OWN

AT_EASE = (State.HOLDING, State.HELD, State.STARVED, State.STOPPING)
"""States of a motion in which the path clock does not keep the plan's time."""


@dataclass(frozen=True, slots=True)
class StreamOptions:
    """How a plan is streamed.

    `lead_ticks` lies between START and the first segment; the 10 ms cover a DM542's response to ENABLE, quoted as under
    5 ms. `release_when_done` lets go of the joints at the end: a loaded arm falls, so the drivers stay enabled unless
    asked. `allowances`, one a segment, let the device slow down along the path; without them it cannot. `config` is
    told to a device whose drivers are released; one whose drivers are enabled keeps what it was told before.
    `soft_limits` are told in either case, where the device counts `start_usteps`, as the plan begins there: else its
    count is not the arm's place, and it is told that there are none. `released_spread_usteps` is how far each joint can
    move by itself while the drivers are released; empty: any way. `kept_faults` are those in which the drivers hold an
    arm that CLEAR would drop, and `falling` tells how. `start_at_s` is a time of the clock at which the
    first segment is due: START is given the lead that is left until then, at least `lead_ticks`. `ahead_s` limits how
    much path the device is given beyond what a stop takes, for motions whose rest may be changed on the way; without it
    the device's queue is filled. `wiring` names the pin map of the board that the plan is for.
    """

    lead_ticks: int = 160_000
    release_when_done: bool = False
    allowances: tuple[Allowance, ...] = ()
    config: Config | None = None
    soft_limits: SoftLimits | None = None
    start_usteps: tuple[int, ...] = ()
    released_spread_usteps: tuple[int, ...] = ()
    kept_faults: tuple[Fault, ...] = ()
    falling: str = ""
    start_at_s: float | None = None
    ahead_s: float | None = None
    wiring: str = OWN


@dataclass(frozen=True, slots=True)
class StreamProgress:
    """How far the motion is, by the device's ledger."""

    path_s: float
    """Path time of the whole segments executed."""
    total_s: float
    executed_segments: int
    total_segments: int
    queued_segments: int
    """Segments sent and not yet executed."""
    queued_s: float
    """Their path time."""
    moved_usteps: tuple[int, ...]
    """Signed micro-steps of each joint since the start, those of the running segment included."""
    state: State
    at_s: float
    """Of the transport's clock."""
    free_bytes: int
    """Of the device's queue."""
    retransmissions: int
    """Frames sent again so far."""
    rate_percent: int
    """Of the path clock, as the device has it now; 0 while it stands still."""
    made_s: Span
    """When the status was made, on the transport's clock: surely within these."""
    path_span_s: Span
    """Where on the path the motion was then: after the last step made, before the next."""
    resent: tuple[Resent, ...] = ()
    """What was sent again so far, in order of time."""


@dataclass(frozen=True, slots=True)
class Joining:
    """A motion of which the device holds a part, sent by a session that ended.

    Attributes:
        before: the ledger at its start.
        accepted_segments: what the device took.
    """

    before: Ledger
    accepted_segments: int


class Phase(Enum):
    """Where the stream is; each lasts until its frames are acknowledged."""

    OPENING = auto()
    ASKING = auto()
    CLEARING = auto()
    CONFIGURING = auto()
    ENABLING = auto()
    FILLING = auto()
    STARTING = auto()
    RUNNING = auto()
    RELEASING = auto()
    DONE = auto()


def plain_config(board: Board) -> Config:
    """Return what a board is told of its wiring where nothing else is known: the wire's defaults, no input used."""
    start_stop_ticks = (DEFAULT_START_STOP_TICKS,) * board.joints
    pulses_ticks = board.min_step_high_ticks
    pin_map = PinMap[board.pin_map.upper()]
    return Config(pin_map, board.joints, 0, 0, 0, DEFAULT_WAKE_TICKS, pulses_ticks, start_stop_ticks)


def no_soft_limits(board: Board) -> SoftLimits:
    """Return what tells a board that its joints may be anywhere."""
    return SoftLimits((0,) * board.joints, (-1,) * board.joints)


def soft_limits_at(ledger: Ledger, options: StreamOptions, warn: Callable[[str], None] | None) -> SoftLimits | None:
    """Return the soft limits that a device at such a count is told; None: it keeps what it was told before."""
    limits, begins = options.soft_limits, options.start_usteps
    if limits is None or ledger.position_usteps[: len(begins)] == begins:
        return limits
    if warn is not None:
        counted = ledger.position_usteps[: len(begins)]
        warn(
            f"soft limits are not watched: the board counts {counted} usteps where the plan begins at {begins}, so its"
            " count is not the arm's place; tell it with 'planarm home SCENE' or 'planarm zero SCENE'"
        )
    return SoftLimits((0,) * len(limits.least_usteps), (-1,) * len(limits.most_usteps))


def clear_drops_words(fault: Fault, falling: str) -> str:
    """Say why a fault is not cleared, and the way out."""
    return (
        f"the drivers hold the arm in the fault {fault.name.lower()}, which lost its place; clearing it releases them,"
        f" and {falling}. Support the arm, press the board's reset button (its drivers let go), and tell where it"
        " stands: 'planarm home SCENE' or 'planarm zero SCENE'"
    )


def position_of(usteps: Sequence[int], joints: int) -> SetPosition:
    """Return what tells a device with so many joints where the motors stand; those that the arm lacks are at 0."""
    return SetPosition((*usteps, *(0,) * (joints - len(usteps))))
