"""Proofs that a moving arm stays clear of moving obstacles: a bisection of time, nothing is sampled.

In a piece of time around t the arm is within its sway of the pose at t (`planarm.workspace.joint_proof` has the bound,
here for two links), so the piece is free when, with the arm held in that pose, every obstacle keeps more than margin
and sway for as long as the piece lasts. With a delay margin each obstacle is looked at for that much longer: what is
proved then is that the arm may be late by any amount up to it, at any time. Since both sweeps are in the same bound, an
arm and an obstacle that change places are found, too.
"""

from math import cos, hypot, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.model.kinematics import ROUNDING_CM
from planarm.model.moving import MovingSet, gap_in_span
from planarm.workspace.proof import BLOCKED, PROVED, UNPROVED, next_piece
from planarm_wire.kernel_cache import bare_kernel as kernel

Floats = NDArray[np.float64]

SMALLEST_CM = 1e-3
"""A piece in which no point of the arm moves farther, nor any obstacle, is not halved: it stays unproved."""


class MovingWorld(NamedTuple):
    """A two-link arm among moving obstacles."""

    l1_cm: float
    l2_cm: float
    base_x_cm: float
    base_y_cm: float
    margin_cm: float
    obstacles: MovingSet


@kernel
def prove_moving(world: MovingWorld, borders_s: Floats, coefficients: Floats, delay_s: float) -> tuple[int, float, int]:
    """Judge a motion of cubic pieces in time against the moving obstacles.

    Args:
        world: the arm among its obstacles.
        borders_s: times at the ends of the pieces, ascending, shape (pieces + 1,).
        coefficients: angle of joint j on piece p at t is the sum over k of coefficients[p, k, j] (t - borders_s[p])^k,
            shape (pieces, 4, 2), radians.
        delay_s: each pose is to stay free from its time to this much later.

    Returns:
        (verdict, time, obstacle): PROVED; or BLOCKED with a time of the plan whose pose that obstacle touches then or
        within the delay; or UNPROVED with the time around which the margin is too small for a proof.
    """
    for p in range(coefficients.shape[0]):
        verdict, at_s, obstacle = prove_moving_piece(
            world, coefficients[p], borders_s[p], borders_s[p + 1] - borders_s[p], delay_s
        )
        if verdict != PROVED:
            return verdict, at_s, obstacle
    return PROVED, borders_s[-1], -1


@kernel
def prove_moving_piece(
    world: MovingWorld, piece: Floats, begin_s: float, size_s: float, delay_s: float
) -> tuple[int, float, int]:
    """Judge one cubic piece, shape (4, 2), that begins at a time; as `prove_moving`."""
    start, width = 0.0, 1.0
    while start < 1.0:
        middle, half = (start + 0.5 * width) * size_s, 0.5 * width * size_s
        verdict, obstacle = _judge(world, piece, middle, half, begin_s, delay_s)
        if verdict == PROVED:
            start, width = next_piece(start, width)
        elif verdict == BLOCKED or half <= 0.0:
            return verdict, begin_s + middle, obstacle
        elif _too_small(world, piece, middle, half, obstacle):
            return UNPROVED, begin_s + middle, obstacle
        else:
            width *= 0.5
    return PROVED, begin_s + size_s, -1


@kernel
def prove_cell_move(
    world: MovingWorld, q_a: Floats, q_b: Floats, begin_s: float, sample_s: float, delay_s: float, piece: Floats
) -> bool:
    """Tell whether the move from rest to rest between two poses in a sample is proved; `piece` is room to work in."""
    fill_move(q_a, q_b, sample_s, piece)
    return prove_moving_piece(world, piece, begin_s, sample_s, delay_s)[0] == PROVED


@kernel
def fill_move(q_a: Floats, q_b: Floats, sample_s: float, piece: Floats) -> None:
    """Fill the cubic piece, shape (4, 2), that moves from rest to rest between two poses."""
    for j in range(2):
        turn = q_b[j] - q_a[j]
        piece[0, j], piece[1, j] = q_a[j], 0.0
        piece[2, j], piece[3, j] = 3.0 * turn / sample_s**2, -2.0 * turn / sample_s**3


@kernel
def _judge(
    world: MovingWorld, piece: Floats, middle: float, half: float, begin_s: float, delay_s: float
) -> tuple[int, int]:
    """Judge the piece of time middle - half to middle + half; return (verdict, obstacle that stands in the way)."""
    theta1, theta2 = _angle(piece, 0, middle), _angle(piece, 1, middle)
    bx, by = world.base_x_cm, world.base_y_cm
    ex, ey = bx + world.l1_cm * cos(theta1), by + world.l1_cm * sin(theta1)
    x, y = ex + world.l2_cm * cos(theta1 + theta2), ey + world.l2_cm * sin(theta1 + theta2)
    sway = arm_sway(world, hypot(x - bx, y - by), _turn(piece, 0, middle, half), _turn(piece, 1, middle, half))
    need = world.margin_cm + sway + ROUNDING_CM
    now = begin_s + middle
    verdict, doubtful = PROVED, -1
    for i in range(world.obstacles.speeds_cm_s.shape[0]):
        if gap_in_span(world.obstacles, i, now - half, now + half + delay_s, bx, by, ex, ey, x, y, need) > need:
            continue
        at_once = gap_in_span(world.obstacles, i, now, now + delay_s, bx, by, ex, ey, x, y, world.margin_cm)
        if at_once <= world.margin_cm:
            return BLOCKED, i
        verdict, doubtful = UNPROVED, i
    return verdict, doubtful


@kernel
def arm_sway(world: MovingWorld, r_cm: float, turn1_rad: float, turn2_rad: float) -> float:
    """Return a bound of any point's displacement from a pose, its tip r from the base, while the joints turn so far."""
    by2 = turn2_rad * world.l2_cm
    tip = by2 + turn1_rad * min(world.l1_cm + world.l2_cm, r_cm + by2)
    return max(tip, turn1_rad * world.l1_cm)


@kernel
def _too_small(world: MovingWorld, piece: Floats, middle: float, half: float, obstacle: int) -> bool:
    """Tell whether so little moves in a piece of time that halving it helps no more."""
    reach = world.l1_cm + world.l2_cm
    sway = arm_sway(world, reach, _turn(piece, 0, middle, half), _turn(piece, 1, middle, half))
    return bool(max(sway, half * world.obstacles.speeds_cm_s[obstacle]) <= SMALLEST_CM)


@kernel
def _angle(piece: Floats, j: int, t: float) -> float:
    return float(piece[0, j] + t * (piece[1, j] + t * (piece[2, j] + t * piece[3, j])))


@kernel
def _turn(piece: Floats, j: int, middle: float, half: float) -> float:
    """Return how far joint j gets from its angle at `middle` within `half` on both sides, at most: Taylor's series."""
    rate = piece[1, j] + middle * (2.0 * piece[2, j] + 3.0 * middle * piece[3, j])
    bend, twist = 2.0 * piece[2, j] + 6.0 * middle * piece[3, j], 6.0 * piece[3, j]
    return float(half * (abs(rate) + half * (0.5 * abs(bend) + half * abs(twist) / 6.0)))
