"""What is streamed: segments, and where the joints stand before them."""

from dataclasses import dataclass

from planarm_wire.boards import Board
from planarm_wire.messages import Segment
from planarm_wire.rates import Allowance
from planarm_wire.wirings import OWN, board_of

__all__ = ["Allowance", "SegmentPlan"]


@dataclass(frozen=True, slots=True)
class SegmentPlan:
    """A motion as the firmware executes it.

    Attributes:
        segments: in order; the last one is flagged. Empty when nothing moves.
        duration_ticks: sum of the segments' durations.
        start_usteps: each motor's position before the motion; `model.transmission` says where that puts the joints.
        allowances: of each segment (`planarm.stepping.stopping`); none in a plan that cannot be slowed down.
        wiring: of the board that the segments are made for, a name of the wire's pin maps.
    """

    segments: tuple[Segment, ...]
    duration_ticks: int
    start_usteps: tuple[int, ...]
    allowances: tuple[Allowance, ...] = ()
    wiring: str = OWN

    @property
    def board(self) -> Board:
        """The board that the segments are made for; joints that it has beyond the arm's rest."""
        return board_of(len(self.start_usteps), self.wiring)
