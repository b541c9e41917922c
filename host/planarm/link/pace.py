"""How fast the path clock may run for the line's sake: as planned, or slower where the line does not carry the plan."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from planarm.link.margin import Margin, SeenLine, fill_queue, line_margin
from planarm.link.session import Session
from planarm_wire.boards import Board
from planarm_wire.messages import Override, Segment
from planarm_wire.rates import Allowance

PERCENT = 100


class Pace:
    """The path clock's rate, from what the line was seen to carry while the device's queue was filled.

    Attributes:
        percent: of the planned rate that the line carries.
        asked_percent: what the owner asked for.
        margin: what the plan asks of the line, and what it was seen to carry; None when all was queued before START.

    Args:
        session: whose line it is.
        board: the device.
        warn: told when the clock will run slowly.
    """

    def __init__(self, session: Session, board: Board, warn: Callable[[str], None] | None) -> None:
        self.percent = self.asked_percent = PERCENT
        self.margin: Margin | None = None
        self._session, self._board = session, board
        self._warn = warn or (lambda _words: None)
        self._line: SeenLine | None = None
        self._since_s, self._from_bytes = 0.0, 0

    def begin_filling(self, now_s: float) -> None:
        """Look at the line from now on."""
        self._since_s, self._from_bytes = now_s, self._session.arq_counters.bytes_taken

    def set(self, segments: Sequence[Segment], sent: int, allowances: Sequence[Allowance], now_s: float) -> None:
        """Decide on the rate; the queue is full with the first `sent` segments."""
        seen = self._session.arq_counters.bytes_taken - self._from_bytes
        self._line = SeenLine.of(seen, now_s - self._since_s, self._session.quickest_s)
        if sent < len(segments):
            self.margin = line_margin(segments, sent, self._line, self._board, allowances)
            self.percent = self.margin.percent
            if self.percent < PERCENT:
                self._warn(str(self.margin))

    @property
    def order(self) -> Override:
        """What the device is to be told: as asked for, but no faster than the line carries."""
        return Override(min(self.percent, self.asked_percent))

    def set_again(self, left: Sequence[Segment], allowances: Sequence[Allowance]) -> bool:
        """Decide on the rate for what is left of another plan; return whether it is another.

        It is seen from a full queue; while that fills the device slows down by itself.
        """
        if self._line is None:
            return False
        margin = line_margin(left, fill_queue(left, self._board), self._line, self._board, allowances)
        if margin.percent == self.percent:
            return False
        self.margin, self.percent = margin, margin.percent
        if margin.percent < PERCENT:
            self._warn(f"from here on {margin}")
        return True
