"""A motion that can be held anywhere, and a model of the path clock, written from docs/protocol.md alone.

Both joints follow one speed profile, in different directions and at different speeds. Times in ticks, speeds in steps a
tick. The model works in rational numbers and floats, the firmware in integers of 16 to 48 bits.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from firmware_board import end_motion
from planarm_wire.messages import MAX_COARSE_STEPS, SLICE_TICKS, TICKS_HZ, Move, Segment
from planarm_wire.rates import need_code, rate_code, rate_value
from planarm_wire.steps import add_q16, duration_ticks, move_of, step_ticks

SEGMENT_TICKS = 56_000
ONE = 1 << 16
MAX_STRETCH = 4096 << 16


@dataclass(frozen=True)
class HoldableMotion:
    """Segments, the head of each (slow, fast, need), and the joints' limits."""

    segments: list[Segment]
    heads: list[tuple[int, int, int]]
    acceleration: tuple[float, ...]
    start_stop_ticks: tuple[int, ...]


@dataclass(frozen=True)
class Profile:
    """Speed up, keep the speed, slow down; `share` of the acceleration is used."""

    top_hz: tuple[float, float]
    acceleration_hz2: tuple[float, float]
    share: float
    cruise_segments: int

    def motion(self) -> HoldableMotion:
        ramp_s = max(v / (self.share * a) for v, a in zip(self.top_hz, self.acceleration_hz2, strict=True))
        ramp = math.ceil(ramp_s * TICKS_HZ / SEGMENT_TICKS)
        count = 2 * ramp + self.cruise_segments
        speeds = [min(1.0, k / ramp, (count - k) / ramp) for k in range(count + 1)]
        start_stop = tuple(round(TICKS_HZ / math.sqrt(2 * a)) for a in self.acceleration_hz2)
        segments, heads = [], []
        at = [0.5, 0.5]
        for before, after in pairwise(speeds):
            moves = []
            for joint, top in enumerate(self.top_hz):
                move, at[joint] = _move(at[joint], before * top, after * top, joint == 0)
                moves.append(move)
            segments.append(Segment(2 * SEGMENT_TICKS, tuple(moves)))
            heads.append(self._head(before, after))
        needs = _needs(heads, speeds, self.top_hz, start_stop)
        heads = [(slow, fast, need_code(need)) for (slow, fast, _), need in zip(heads, needs, strict=True)]
        acceleration = tuple(a / TICKS_HZ**2 for a in self.acceleration_hz2)
        return HoldableMotion(end_motion(segments), heads, acceleration, start_stop)

    def _head(self, before: float, after: float) -> tuple[int, int, int]:
        """Slow and fast by facts of the path: (a - what the plan takes itself) / speed, the least of both joints."""
        slow = fast = math.inf
        for top, limit in zip(self.top_hz, self.acceleration_hz2, strict=True):
            plan = (after - before) * top * TICKS_HZ / SEGMENT_TICKS
            speed = max(before, after) * top
            slow = min(slow, (limit - max(0.0, -plan)) / speed)
            fast = min(fast, (limit - max(0.0, plan)) / speed)
        return rate_code(slow), rate_code(fast), 0


def _move(phase: float, begin_hz: float, end_hz: float, positive: bool) -> tuple[Move, float]:
    """A joint's steps while its speed goes evenly from one to another; phase is the part of a step already made."""
    v0, v1 = begin_hz / TICKS_HZ, end_hz / TICKS_HZ
    bend = (v1 - v0) / (2 * SEGMENT_TICKS)

    def time_of(way: float) -> float:
        if abs(bend) < 1e-18:
            return way / v0
        return 2 * way / (v0 + math.sqrt(max(0.0, v0 * v0 + 4 * bend * way)))

    total = phase + v0 * SEGMENT_TICKS + bend * SEGMENT_TICKS**2
    count = math.floor(total)
    if count == 0:
        return Move(int(positive)), total
    ticks = [min(SEGMENT_TICKS - 1, int(time_of(n + 1 - phase))) for n in range(count)]
    if count == 1:
        return Move(2 + positive, ticks[0]), total - count
    span = (ticks[-1] - ticks[0]) << 16
    if count == 2:
        return Move(4 + positive, ticks[0], span >> 8, 0), total - count
    middle = ticks[count // 2] - ticks[0]
    n, m = count - 1, count // 2
    # The quadratic through the first, the middle and the last step.
    add = round(((span / n) - (middle << 16) / m) / (n / 2 - m / 2))
    if count <= MAX_COARSE_STEPS:
        add = round(add / 256) * 256
    interval_q8 = round((span / n - add * (n - 1) / 2) / 256)
    return move_of(count, positive, ticks[0], interval_q8, add), total - count


def _needs(
    heads: Sequence[tuple[int, int, int]], speeds: Sequence[float], top_hz: Sequence[float], start_stop: Sequence[int]
) -> list[float]:
    """Path time to rest from each segment's start, by walking the model from there with all of `slow`."""
    calm = min(top * ticks / TICKS_HZ for top, ticks in zip(top_hz, start_stop, strict=True))
    limit = max(top * ticks / TICKS_HZ for top, ticks in zip(top_hz, start_stop, strict=True))
    assert calm > 0
    needs = []
    for k in range(len(heads)):
        stretch, i = ONE, k
        while i < len(heads) and max(speeds[i], speeds[i + 1]) * limit * ONE > stretch:
            stretch = slowed(stretch, rate_value(heads[i][0]))
            i += 1
        needs.append(float((i - k) * SEGMENT_TICKS))
    return needs


def slowed(stretch: int, rate: int, path_ticks: int = SEGMENT_TICKS, target: int = MAX_STRETCH) -> int:
    """The largest lawful stretch at the end of a slice: s1 = s0 + rate D s0^3, at most 2 s0, in 2^-16."""
    end = stretch + (stretch * relative_change(stretch, rate, path_ticks) >> 16)
    return min(end, MAX_STRETCH, target)


def relative_change(stretch: int, rate: int, path_ticks: int) -> int:
    """Rate D s^2, less than 1, in 2^-16."""
    return min(min(rate * path_ticks, 2**32 - 1) * stretch * stretch >> 48, ONE - 1)


def sped_up(stretch: int, rate: int, path_ticks: int = SEGMENT_TICKS, target: int = ONE) -> int:
    """A stretch above the root of s1 + rate D s1^3 = s0: one turn of Newton's method, in 2^-16."""
    relative = relative_change(stretch, rate, path_ticks)
    growth, slope = stretch * relative >> 16, ((ONE + 3 * relative) >> 8) + 1
    return max(stretch - ((growth << 8) // slope if growth < ONE << 8 else growth // slope << 8), target)


def mapped(path: float, path_ticks: int, s0: int, s1: int) -> float:
    """Ticks from a slice's start to a path time in it."""
    return path * (s0 + (s1 - s0) * path / (2 * path_ticks)) / ONE


class StretchedSlice(NamedTuple):
    """A slice of a segment: path times, and the stretch at both ends."""

    segment: int
    path_start: int
    path_ticks: int
    s0: int
    s1: int


def slice_ticks(left: int, stretch: int) -> int:
    """The length of the next slice of a segment of which so much is left.

    With each doubling of the stretch slices are half as long. The last two of a segment are alike; stretched, the last
    may be twice as long.
    """
    most = SLICE_TICKS >> (stretch // ONE).bit_length() - 1
    if most < SLICE_TICKS:
        return left if left < 2 * most else most
    return left if left <= most else min(most, (left + 1) // 2)


def stretched_slices(
    motion: HoldableMotion, hold: int | None = None, rest: int | None = None, target: int = ONE
) -> list[StretchedSlice]:
    """All slices, when a hold slows down from segment `hold` on and the clock rests in slice `rest`.

    Gentle changes use half of the allowance. Without a hold the stretch goes to `target` from the start.
    """
    slices: list[StretchedSlice] = []
    stretch, path = ONE if hold is not None else target, 0
    for k, (segment, (slow, fast, _)) in enumerate(zip(motion.segments, motion.heads, strict=True)):
        left = duration_ticks(segment)
        while left:
            length = slice_ticks(left, stretch)
            end = stretch
            if hold is not None and k >= hold and (rest is None or len(slices) <= rest):
                end = slowed(stretch, rate_value(slow) >> 1, length)
            elif stretch > target:
                end = sped_up(stretch, rate_value(fast) >> 1, length, target)
            slices.append(StretchedSlice(k, path, length, stretch, end))
            stretch, path, left = end, path + length, left - length
    return slices


def stretched_steps(segments: Sequence[Segment], slices: Sequence[StretchedSlice], joint: int) -> list[float]:
    """The ticks of a joint's steps from the motion's start."""
    paths = []
    begin = 0
    for segment in segments:
        paths += [begin + tick for tick in step_ticks(segment.moves[joint])]
        begin += duration_ticks(segment)
    found: list[float] = []
    start = 0
    for one in slices:
        while len(found) < len(paths) and paths[len(found)] < one.path_start + one.path_ticks:
            found.append(start + mapped(paths[len(found)] - one.path_start, one.path_ticks, one.s0, one.s1))
        start += one.path_ticks * ((one.s0 + one.s1) // 2) >> 16
    return found


def largest_accelerations(motion: HoldableMotion, slices: Sequence[StretchedSlice]) -> list[float]:
    """Each joint's largest acceleration on the stretched path, as a share of its limit.

    With speed q' and acceleration q'' along the path, rate u = 1 / s: q'' u^2 + q' u', u' = -(s1 - s0) / (D s^3).
    """
    found = []
    for joint, limit in enumerate(motion.acceleration):
        worst = 0.0
        for one in slices:
            move = motion.segments[one.segment].moves[joint]
            if move.steps_dir < 6:
                continue
            count = move.steps_dir >> 1
            intervals = [(256 * move.interval_q8 + i * add_q16(move)) / ONE for i in (0, count - 2)]
            speeds = [1 / interval for interval in intervals]
            bend = (speeds[1] - speeds[0]) / (step_ticks(move)[-1] - step_ticks(move)[0])
            s0, s1 = one.s0 / ONE, one.s1 / ONE
            for speed, s in itertools.product(speeds, (s0, s1)):
                if speed / s > 1 / motion.start_stop_ticks[joint]:
                    change = -(s1 - s0) / (one.path_ticks * s**3)
                    worst = max(worst, abs(bend / s**2 + speed * change))
        found.append(worst / limit)
    return found
