"""What is known of the arm's position after a motion ended early: exact, bounded or lost, never a guess."""

from dataclasses import dataclass
from enum import Enum

from planarm.errors import DeviceFault, LinkError
from planarm.link.plan_steps import PlanSteps
from planarm_wire.messages import Fault, Ledger, State, Status

POSITION_LOST = (Fault.EMERGENCY_STOP, Fault.STOP_INPUT)
"""Faults after which the position is lost by the protocol's own words."""


class Certainty(Enum):
    """How well the position is known."""

    EXACT = "exact"
    """The device, not restarted and with its drivers enabled all the time, told its ledger."""
    BOUNDED = "bounded"
    """The arm is within known limits: what was sent bounds it, or it rested and stays where it is by itself."""
    LOST = "lost"
    """The device restarted or released its drivers in motion or under load: the arm may have moved by itself."""


@dataclass(frozen=True, slots=True)
class PositionReport:
    """The position in terms of the plan.

    `executed_segments` are the fewest and the most whole segments that can have been executed, of `total_segments`;
    `moved_usteps` are the signed micro-steps of each joint since the motion's start, by the ledger last received, and
    `bounds_usteps` the least and greatest that they can be. `reason` says why it is known so well and no better.
    """

    certainty: Certainty
    executed_segments: tuple[int, int]
    total_segments: int
    moved_usteps: tuple[int, ...]
    bounds_usteps: tuple[tuple[int, int], ...] = ()
    reason: str = ""

    @property
    def spread_usteps(self) -> tuple[int, ...]:
        """The n of +-n for each joint: how far it can be from `moved_usteps`."""
        return tuple(
            max(moved - least, most - moved)
            for moved, (least, most) in zip(self.moved_usteps, self.bounds_usteps, strict=True)
        )

    def __str__(self) -> str:
        fewest, most = self.executed_segments
        moved = ", ".join(f"{steps:+d}" for steps in self.moved_usteps)
        told = f"{fewest} of {self.total_segments} segments, joints moved by ({moved}) usteps since the start"
        because = f"; {self.reason}" if self.reason else ""
        if self.certainty is Certainty.EXACT:
            return f"position exact: {told}{because}"
        if self.certainty is Certainty.BOUNDED:
            spread = ", ".join(f"+-{n}" for n in self.spread_usteps)
            return f"position bounded: last told {told}; ({spread}) usteps, at most {most} segments{because}"
        return f"position lost: {self.reason}; before that it told {told}; home the arm"


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of a motion from what was sent and heard.

    Attributes:
        boot_nonce: of the device that it was sent to.
        before: the ledger at its start.
        last: the newest status of that boot.
        sent_segments: how many segments may have reached the device.
        rested: the arm rested when `last` was told, and nothing that moves it was sent since.
    """

    boot_nonce: int
    before: Ledger
    last: Status
    sent_segments: int
    rested: bool


@dataclass(frozen=True, slots=True)
class Meeting:
    """What the device says now."""

    boot_nonce: int
    status: Status


def judge(
    known: Known, meeting: Meeting | None, steps: PlanSteps, released_spread_usteps: tuple[int, ...] = ()
) -> PositionReport:
    """Say how well the position is known.

    Args:
        known: the motion as far as the host has it.
        meeting: what the device says now; None when it cannot be asked.
        steps: the motion's.
        released_spread_usteps: how far each joint can move while its drivers are released: two full steps for an arm
            that lies flat; empty for one that falls.
    """
    told = moved_usteps(known.before, known.last.ledger)
    fewest = executed_since(known.before, known.last.ledger)
    sent = known.sent_segments

    def report(certainty: Certainty, reason: str, most: int, bounds: tuple[tuple[int, int], ...]) -> PositionReport:
        return PositionReport(certainty, (fewest, most), steps.segments, told, bounds, reason)

    to_all_sent = steps.range_usteps(told, fewest, sent)
    if meeting is None:
        reason = "the board cannot be asked; it cannot have executed more than it was sent"
        return report(Certainty.BOUNDED, reason, sent, to_all_sent)
    restarted = meeting.boot_nonce != known.boot_nonce
    if restarted or meeting.status.state is State.IDLE:
        what = "the board restarted" if restarted else "the board released the motors"
        if not restarted:
            told = moved_usteps(known.before, meeting.status.ledger)
            fewest = executed_since(known.before, meeting.status.ledger)
        if (known.rested or not restarted) and released_spread_usteps:
            around = tuple((at - n, at + n) for at, n in zip(told, released_spread_usteps, strict=True))
            reason = f"{what} while the arm rested, and it lies flat: bounded if nobody moved it"
            return report(Certainty.BOUNDED, reason, fewest, around)
        return report(Certainty.LOST, f"{what} and let go of the arm", sent, to_all_sent)
    return _judge_same_boot(known, meeting.status, steps)


def _judge_same_boot(known: Known, now: Status, steps: PlanSteps) -> PositionReport:
    """The board kept its power and its drivers: its ledger counts, if the motion is still this one."""
    told, executed = moved_usteps(known.before, now.ledger), executed_since(known.before, now.ledger)
    least = executed_since(known.before, known.last.ledger)
    certainty, reason = Certainty.EXACT, _how_it_rests(now)
    if now.fault in POSITION_LOST:
        certainty, reason = Certainty.LOST, f"the board stopped all pulses at once ({now.fault.name.lower()})"
    elif not least <= executed <= known.sent_segments or steps.locate(executed, told) is None:
        certainty, reason = Certainty.LOST, "another program moved the arm off this path"
    return PositionReport(certainty, (executed, executed), steps.segments, told, tuple((at, at) for at in told), reason)


def _how_it_rests(now: Status) -> str:
    if now.state in (State.RUNNING, State.HOLDING, State.STOPPING):
        return "the board still executes what it holds"
    return f"the board kept its power, state {now.state.name.lower()}"


def executed_since(before: Ledger, after: Ledger) -> int:
    """Whole segments executed between two ledgers of the same boot (the counter wraps at 32 bits)."""
    return (after.executed_segments - before.executed_segments) % 2**32


def moved_usteps(before: Ledger, after: Ledger) -> tuple[int, ...]:
    """Signed micro-steps of each joint between two ledgers of the same boot (the counters wrap at 32 bits)."""
    differences = (a - b for a, b in zip(after.position_usteps, before.position_usteps, strict=True))
    return tuple((difference + 2**31) % 2**32 - 2**31 for difference in differences)


class StreamError(LinkError):
    """The line failed during a motion; `position` tells what is known of the arm."""

    def __init__(self, message: str, position: PositionReport) -> None:
        super().__init__(f"{message}; {position}")
        self.position = position


class MissedStartError(LinkError):
    """The segments of a motion with an agreed start were in the device too late; nothing has moved."""

    def __init__(self, start_at_s: float, now_s: float, lead_s: float) -> None:
        super().__init__(
            f"the motion was due to start at {start_at_s:.6f} s, but its segments are in the device only at"
            f" {now_s:.6f} s, later than {lead_s:g} s before; nothing has moved"
        )
        self.by_s = now_s + lead_s - start_at_s
        """By how much it was missed."""


class StreamFault(DeviceFault):
    """The device latched a fault or refused a frame during a motion; `position` tells what is known of the arm."""

    def __init__(self, message: str, position: PositionReport) -> None:
        super().__init__(f"{message}; {position}")
        self.position = position
