"""Motions for the firmware's tests and benchmark: constant rates in all phases, and what chance makes of two joints."""

from __future__ import annotations

import math
import random
from fractions import Fraction

from firmware_board import end_motion, segment_of
from planarm_wire.messages import (
    BOARDS,
    MAX_COARSE_STEPS,
    MAX_INTERVAL_TICKS,
    MIN_DIR_SETUP_TICKS,
    MIN_INTERVAL_TICKS,
    SLICE_TICKS,
    TICKS_HZ,
    Move,
    Segment,
)
from planarm_wire.steps import move_of


def fast_moves(duration: int, begun_at: Fraction, interval_q8: int) -> tuple[Move, Fraction]:
    """A joint's steps at one interval in a segment, from a moment on; and the moment of the first in the next."""
    first = int(begun_at)
    steps = ((duration - first) * 256 - 1) // interval_q8 + 1
    return Move(2 * steps + 1, first, interval_q8), first + Fraction(steps * interval_q8, 256) - duration


def fast(interval: int, ratio: float, duration: int, count: int) -> list[Segment]:
    """Both joints in one direction, joint 1 at an interval and joint 2 slower by a ratio, without a pause."""
    intervals = (interval << 8, round(interval * ratio * 256))
    begun_at = [Fraction(0), Fraction(7)]
    segments = []
    for _ in range(count):
        # A fraction cut off at a boundary shortens the interval there: the next tick is taken instead.
        moves, begun_at = zip(
            *(
                fast_moves(duration, Fraction(math.ceil(at)), interval)
                for at, interval in zip(begun_at, intervals, strict=True)
            ),
            strict=True,
        )
        segments.append(segment_of(duration, *moves))
    return segments


def steady(name: str, interval: int, seconds: float, duration: int = 8 * SLICE_TICKS) -> list[Segment]:
    """All joints at nearly one interval, each a little slower than the one before it, so that all phases occur."""
    joints = BOARDS[name].joints
    intervals = [round(256 * interval * ratio) for ratio in (1.0, 1.0037, 1.0071, 1.0113)[:joints]]
    begun_at = [Fraction(7 * joint) for joint in range(joints)]
    segments = []
    for _ in range(math.ceil(seconds * TICKS_HZ / duration)):
        moves, begun_at = zip(
            *(
                fast_moves(duration, Fraction(math.ceil(at)), each)
                for at, each in zip(begun_at, intervals, strict=True)
            ),
            strict=True,
        )
        segments.append(segment_of(duration, *moves, joints=joints))
    return end_motion(segments)


class RestlessJoint:
    """Speeds up, slows down, cruises at its least interval, pauses and turns round, as chance has it."""

    def __init__(self, chance: random.Random, least_interval: int) -> None:
        self.chance = chance
        self.least_interval = least_interval
        self.interval = 4000
        self.rest_ticks = 10**9
        self.positive = True

    def move(self, duration: int) -> Move:
        kind = self.chance.choice(["cruise", "cruise", "change", "change", "change", "turn", "pause"])
        positive = self.positive ^ (kind == "turn")
        end = self.least_interval if kind == "cruise" else self.chance.randint(self.least_interval, 6000)
        if kind in ("turn", "pause"):
            self.interval = self.chance.randint(self.least_interval, 2000)
        least_gap = MIN_INTERVAL_TICKS + (MIN_DIR_SETUP_TICKS if positive is not self.positive else 0)
        first = max(0, least_gap - self.rest_ticks) + self.chance.randint(0, 50)
        steps = (duration - first) * 2 // (self.interval + end) - 1
        if kind == "pause" or steps < 3:
            self.rest_ticks += duration
            return Move(0)
        add = (abs(end - self.interval) << 16) // (steps - 1)  # rounded to 0: no interval gets below the least
        if steps <= MAX_COARSE_STEPS:
            add &= ~0xFF  # whole 2^-8 ticks
        add = add if end >= self.interval else -add
        last = first + ((steps - 1) * (self.interval << 16) + (steps - 1) * (steps - 2) // 2 * add >> 16)
        self.rest_ticks = duration - last
        move = move_of(steps, positive, first, self.interval << 8, add)
        self.positive, self.interval = positive, max(self.least_interval, self.interval + (steps - 2) * add // 65_536)
        assert self.interval <= MAX_INTERVAL_TICKS and self.rest_ticks > 0
        return move


def restless(seed: int, least_interval: int, count: int) -> list[Segment]:
    """A random motion of both joints in segments of 2 to 12 ms."""
    chance = random.Random(seed)
    joints = [RestlessJoint(chance, least_interval) for _ in range(2)]
    segments = []
    for _ in range(count):
        duration = chance.randint(32_000, 190_000)
        segments.append(segment_of(duration, *(joint.move(duration) for joint in joints)))
    return segments
