"""The board's clock against the computer's: what is sure of their offset and drift, and no more.

Every STATUS tells the board's clock at the moment it was made. That moment lies after the frame that it acknowledges
was sent, and before the reply was read, both on the computer's clock. With a constant rate of the board's clock,

    sent <= offset + (1 + slowness) ticks / TICKS_HZ <= received

is two half-planes of (offset, slowness). What all replies leave over is a convex polygon, and the extremes of a tick's
moment over it are what can be said of that moment: no delay of either direction is assumed, and none is taken for half
of the round trip. Replies that had to wait cut nothing off; the quickest in each direction decide.

A resonator's rate wanders with its temperature, so a polygon is given up after `SPAN_S` for one that began half of that
later. Replies that no constant rate explains begin it anew and are counted.
"""

from collections.abc import Callable
from dataclasses import dataclass

from planarm_wire.messages import TICKS_HZ

MOST_SLOWNESS = 0.01
"""An Uno's ceramic resonator is within 0.5 % (Murata CSTCE), a computer's crystal within 0.01 %; twice that."""
SPAN_S = 20.0
TICKS_MODULO = 1 << 32

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Span:
    """A value that is known to lie between two others."""

    least: float
    most: float

    @property
    def middle(self) -> float:
        """The best single value."""
        return 0.5 * (self.least + self.most)

    @property
    def plus_minus(self) -> float:
        """By how much that may be wrong."""
        return 0.5 * (self.most - self.least)


@dataclass(frozen=True, slots=True)
class ClockReading:
    """What a session learnt of the board's clock.

    Attributes:
        drift_ppm: by how much the board's clock runs faster than the computer's, in millionths.
        moment_s: how sure the moment of the newest reply is: plus or minus so much.
        replies: that were taken in.
        restarts: how often no constant rate explained the replies, as when one of the clocks was set or stood still.
    """

    drift_ppm: Span
    moment_s: float
    replies: int
    restarts: int


class _Polygon:
    """The (offset, slowness) that agree with all replies since one of them, counted from it."""

    def __init__(self, sent_s: float, ticks: int, received_s: float) -> None:
        self.began_s, self._zero_ticks = received_s, ticks
        offsets = (sent_s - received_s, 0.0)
        self.corners: list[Point] = [
            (offsets[0], -MOST_SLOWNESS),
            (offsets[1], -MOST_SLOWNESS),
            (offsets[1], MOST_SLOWNESS),
            (offsets[0], MOST_SLOWNESS),
        ]

    def take(self, sent_s: float, ticks: int, received_s: float) -> bool:
        """Cut off what disagrees with a reply; False when nothing is left."""
        passed_s = self._passed_s(ticks)
        low, high = sent_s - self.began_s - passed_s, received_s - self.began_s - passed_s
        self.corners = _cut(self.corners, lambda corner: corner[0] + corner[1] * passed_s - low)
        self.corners = _cut(self.corners, lambda corner: high - corner[0] - corner[1] * passed_s)
        return bool(self.corners)

    def host_s(self, ticks: int) -> Span:
        """Return when the board's clock showed, or will show, `ticks`."""
        passed_s = self._passed_s(ticks)
        moments = [self.began_s + passed_s + offset + slowness * passed_s for offset, slowness in self.corners]
        return Span(min(moments), max(moments))

    def drift_ppm(self) -> Span:
        rates = [1e6 * (1.0 / (1.0 + slowness) - 1.0) for _, slowness in self.corners]
        return Span(min(rates), max(rates))

    def _passed_s(self, ticks: int) -> float:
        return (ticks - self._zero_ticks) / TICKS_HZ


class ClockSync:
    """Takes in the replies of one boot of a board."""

    def __init__(self) -> None:
        self.replies = 0
        self.restarts = 0
        self._newest: tuple[int, float] | None = None
        self._polygon: _Polygon | None = None
        self._next: _Polygon | None = None

    def take(self, sent_s: float, mcu_ticks: int, received_s: float) -> Span:
        """Take in a reply and return the span of its moment on the computer's clock.

        Args:
            sent_s: when the frame that it answers was first sent, or any earlier moment.
            mcu_ticks: the board's clock in it, modulo 2^32.
            received_s: when it had been read.
        """
        ticks = self._whole(mcu_ticks, received_s)
        self._newest = (ticks, received_s)
        self.replies += 1
        if self._polygon is None or not self._polygon.take(sent_s, ticks, received_s):
            self.restarts += self._polygon is not None
            self._polygon, self._next = _Polygon(sent_s, ticks, received_s), None
        if self._next is not None and not self._next.take(sent_s, ticks, received_s):
            self._next = None
        self._renew(sent_s, ticks, received_s)
        return self._polygon.host_s(ticks)

    def host_s(self, since_ticks: int) -> Span:
        """Return the moment so many ticks after the newest reply was made, or before it."""
        assert self._polygon is not None and self._newest is not None, "asked after a reply"
        return self._polygon.host_s(self._newest[0] + since_ticks)

    def reading(self) -> ClockReading | None:
        """Return what is known by now; None before the first reply."""
        if self._polygon is None or self._newest is None:
            return None
        return ClockReading(self._polygon.drift_ppm(), self.host_s(0).plus_minus, self.replies, self.restarts)

    def _renew(self, sent_s: float, ticks: int, received_s: float) -> None:
        """Let the next polygon begin half of the span after this one, and take its place at the end."""
        assert self._polygon is not None, "a reply was taken in"
        age_s = received_s - self._polygon.began_s
        if age_s >= SPAN_S and self._next is not None:
            self._polygon, self._next = self._next, None
        elif age_s >= 0.5 * SPAN_S and self._next is None:
            self._next = _Polygon(sent_s, ticks, received_s)

    def _whole(self, mcu_ticks: int, received_s: float) -> int:
        """Return the count beyond 32 bits, by the time that has passed since the last reply."""
        if self._newest is None:
            return mcu_ticks
        ticks, at_s = self._newest
        expected = ticks + round((received_s - at_s) * TICKS_HZ)
        return expected + (mcu_ticks - expected + TICKS_MODULO // 2) % TICKS_MODULO - TICKS_MODULO // 2


def _cut(corners: list[Point], inside: Callable[[Point], float]) -> list[Point]:
    """Return the part of a convex polygon where a linear function is not negative (Sutherland and Hodgman)."""
    kept: list[Point] = []
    for k, corner in enumerate(corners):
        before = corners[k - 1]
        here, there = inside(corner), inside(before)
        if (here < 0.0) != (there < 0.0):
            share = there / (there - here)
            kept.append((before[0] + share * (corner[0] - before[0]), before[1] + share * (corner[1] - before[1])))
        if here >= 0.0:
            kept.append(corner)
    return kept
