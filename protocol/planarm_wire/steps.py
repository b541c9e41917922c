"""The moments of the steps, in exact integers: the plain reference for every other expansion.

Step n of a move with count N, I = interval_q8 and A = add_q16 rises, counted from its segment's start, at

    T_n = first_ticks + floor((256 n I + n (n - 1) / 2 A) / 2^16)        n = 0 .. N - 1

which is one step every I / 2^8 ticks, with each interval A / 2^16 ticks longer than the one before it.
"""

from __future__ import annotations

from planarm_wire.messages import Move, Segment


def expand_moves(segment: Segment) -> tuple[tuple[int, ...], ...]:
    """Return the step ticks of each joint, relative to the segment's start; empty for a joint that rests."""
    return tuple(step_ticks(move) for move in segment.moves)


def step_ticks(move: Move) -> tuple[int, ...]:
    """Return the ticks of the move's steps, relative to its segment's start."""
    return tuple(step_tick(move, n) for n in range(step_count(move)))


def step_tick(move: Move, n: int) -> int:
    """Return the tick of the move's step n, relative to its segment's start."""
    return move.first_ticks + ((n * (move.interval_q8 << 8) + n * (n - 1) // 2 * move.add_q16) >> 16)


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
