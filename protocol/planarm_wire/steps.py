"""The moments of the steps, in exact integers: the plain reference for every other expansion.

Step n of a move with count N, I = interval_q8 and A = add_q16(move) rises, counted from its segment's start, at

    T_n = first_ticks + floor((256 n I + n (n - 1) / 2 A) / 2^16)        n = 0 .. N - 1

which is one step every I / 2^8 ticks, with each interval A / 2^16 ticks longer than the one before it. A move of few
steps tells its A in 2^-8 ticks, where n (n - 1) / 2 such units are little; others in 2^-16.
"""

from __future__ import annotations

from typing import Final

from planarm_wire.messages import MAX_COARSE_STEPS, SLOW_INTERVAL_TICKS, Move, Segment

COARSE_ADD_BITS: Final = 8
"""By so many bits the add of a move of few steps is longer in 2^-16 ticks than on the wire."""
LONGEST_INTERVAL_TICKS: Final = (1 << 18) - 1
"""Longest interval inside a move that hosts send, 16 ms, less than the wire allows: a slow move's interval and add then
take no more than four bytes each, and a segment of four joints fits a message."""


def expand_moves(segment: Segment) -> tuple[tuple[int, ...], ...]:
    """Return the step ticks of each joint, relative to the segment's start; empty for a joint that rests."""
    return tuple(step_ticks(move) for move in segment.moves)


def step_ticks(move: Move) -> tuple[int, ...]:
    """Return the ticks of the move's steps, relative to its segment's start."""
    return tuple(step_tick(move, n) for n in range(step_count(move)))


def step_tick(move: Move, n: int) -> int:
    """Return the tick of the move's step n, relative to its segment's start."""
    return move.first_ticks + ((n * (move.interval_q8 << 8) + n * (n - 1) // 2 * add_q16(move)) >> 16)


def add_q16(move: Move) -> int:
    """Return what each interval has more than the one before, in 2^-16 ticks."""
    if step_count(move) > MAX_COARSE_STEPS:
        return move.add
    add = move.add << COARSE_ADD_BITS
    return add if is_slow(move) else (add + 2**31) % 2**32 - 2**31


def is_slow(move: Move) -> bool:
    """Tell whether the move begins with a long interval, so that its limits are those of slow moves."""
    return move.interval_q8 >= SLOW_INTERVAL_TICKS << 8


def step_count(move: Move) -> int:
    """Return how many steps the move makes."""
    return move.steps_dir >> 1


def direction(move: Move) -> int:
    """Return +1 when the joint turns in the positive direction (DIR high), -1 otherwise."""
    return 1 if move.steps_dir & 1 else -1


def signed_steps(move: Move) -> int:
    """Return by how many micro-steps the move changes the joint's position."""
    return direction(move) * step_count(move)


def duration_ticks(segment: Segment) -> int:
    """Return how long the segment is."""
    return segment.duration_flags >> 1


def is_last(segment: Segment) -> bool:
    """Tell whether the segment ends its motion."""
    return bool(segment.duration_flags & 1)


def move_of(steps: int, positive: bool, first_ticks: int, interval_q8: int, add_q16: int) -> Move:
    """Return the move with these numbers; with few steps the add must be in whole 2^-8 ticks."""
    add = add_q16 >> COARSE_ADD_BITS if steps <= MAX_COARSE_STEPS else add_q16
    return Move(2 * steps + int(positive), first_ticks, interval_q8, add)
