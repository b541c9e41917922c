"""What is known of the arm's position after a motion ended early: exact, bounded or lost, never a guess."""

from dataclasses import dataclass
from enum import Enum

from planarm.errors import DeviceFault, LinkError
from planarm_wire.messages import Ledger


class Certainty(Enum):
    """How well the position is known."""

    EXACT = "exact"
    """The device, not restarted and at rest, told its ledger."""
    BOUNDED = "bounded"
    """The device cannot be asked; it executed at least what it last told and at most what was sent."""
    LOST = "lost"
    """The device restarted or released its drivers: the arm may have moved by itself."""


@dataclass(frozen=True, slots=True)
class PositionReport:
    """The position in terms of the plan.

    `executed_segments` are the fewest and the most whole segments that can have been executed, of `total_segments`;
    `moved_usteps` are the signed micro-steps of each joint since the motion's start, by the ledger last received.
    """

    certainty: Certainty
    executed_segments: tuple[int, int]
    total_segments: int
    moved_usteps: tuple[int, ...]

    def __str__(self) -> str:
        fewest, most = self.executed_segments
        moved = ", ".join(f"{steps:+d}" for steps in self.moved_usteps)
        told = f"{fewest} of {self.total_segments} segments, joints moved by ({moved}) usteps since the start"
        if self.certainty is Certainty.EXACT:
            return f"position exact: {told}"
        if self.certainty is Certainty.BOUNDED:
            return f"position bounded: last told {told}; at most {most} segments if the board kept its power"
        return f"position lost: the board restarted or let go of the arm; before that it told {told}; home the arm"


def moved_usteps(before: Ledger, after: Ledger) -> tuple[int, ...]:
    """Signed micro-steps of each joint between two ledgers of the same boot (the counters wrap at 32 bits)."""
    differences = (a - b for a, b in zip(after.position_usteps, before.position_usteps, strict=True))
    return tuple((difference + 2**31) % 2**32 - 2**31 for difference in differences)


class StreamError(LinkError):
    """The line failed during a motion; `position` tells what is known of the arm."""

    def __init__(self, message: str, position: PositionReport) -> None:
        super().__init__(f"{message}; {position}")
        self.position = position


class StreamFault(DeviceFault):
    """The device latched a fault or refused a frame during a motion; `position` tells what is known of the arm."""

    def __init__(self, message: str, position: PositionReport) -> None:
        super().__init__(f"{message}; {position}")
        self.position = position
