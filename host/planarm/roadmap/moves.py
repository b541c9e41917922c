"""Straight moves between configurations: which are neighbours, and which moves are free for the whole arm.

A move is judged as in `planarm.workspace.joint_proof`, by halving, but with a bound that costs nothing at each pose:
when all joints stay within half of the move, d_i = |b_i - a_i| / 2, the end of link p moves by at most

    full_p = full_(p-1) + l_p (d_1 + ... + d_p),

and within a piece of width w (1 is the whole move) by w full_p. It is larger than the bound there by what folding takes
off the levers; the pieces get a little smaller, and each costs half.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planarm.model.collision import segment_clearance
from planarm.model.kinematics import ROUNDING_CM
from planarm.workspace.joint_proof import SMALLEST_CM, JointWorld, link_ends
from planarm.workspace.proof import next_piece
from planarm_wire.kernel_cache import bare_kernel, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

PARTS = 20
"""After each of so many parts of the moves is told how far their proof is."""


def nearest_pairs(world: JointWorld, poses_rad: Floats, neighbours: int) -> Ints:
    """Return pairs (i, j), i < j, of which one is among the other's nearest configurations; shape (m, 2).

    Near is what moves the arm little: each joint's angle counts with the reach of the links that it turns.
    """
    levers = np.cumsum(world.lengths_cm[::-1])[::-1]
    scaled = poses_rad * levers
    count = min(neighbours + 1, len(poses_rad))
    _, near = cKDTree(scaled).query(scaled, k=count)
    near = near.reshape(len(poses_rad), count)
    own = np.repeat(np.arange(len(poses_rad)), count)
    pairs = np.sort(np.stack([own, near.ravel()], axis=1), axis=1)
    return np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0)


def all_free(world: JointWorld, poses_rad: Floats, pairs: Ints, told: Callable[[float], None] | None = None) -> Flags:
    """Tell for each pair, shape (m, 2), whether the move between its poses is free; the share done goes to `told`."""
    free = np.empty(len(pairs), np.bool_)
    borders = np.linspace(0, len(pairs), PARTS + 1).astype(np.int64)
    for part, (begin, end) in enumerate(pairwise(borders), start=1):
        free[begin:end] = are_free(world, poses_rad, pairs, np.arange(begin, end))
        if told is not None:
            told(part / PARTS)
    return free


@kernel
def are_free(world: JointWorld, poses_rad: Floats, pairs: Ints, which: Ints) -> NDArray[np.bool_]:
    """Tell for each of the pairs named by `which`, shape (k,), whether the move between its poses is free."""
    joints = poses_rad.shape[1]
    out = np.empty(which.shape[0], np.bool_)
    q, full, ends = np.empty(joints), np.empty(joints), np.empty((joints + 1, 2))
    for k in range(which.shape[0]):
        pair = pairs[which[k]]
        out[k] = move_is_free(world, poses_rad[pair[0]], poses_rad[pair[1]], q, full, ends)
    return out


@bare_kernel
def move_is_free(world: JointWorld, a_rad: Floats, b_rad: Floats, q: Floats, full: Floats, ends: Floats) -> bool:
    """Tell whether the straight move is proved free; q, full (n,) and ends (n + 1, 2) are room to work in."""
    joints = a_rad.shape[0]
    fill_full(world.lengths_cm, a_rad, b_rad, full)
    obstacles, margin = world.obstacles, world.margin_cm
    start, width = 0.0, 1.0
    while start < 1.0:
        middle = start + 0.5 * width
        for j in range(joints):
            q[j] = a_rad[j] + middle * (b_rad[j] - a_rad[j])
        link_ends(world, q, ends)
        proved = True
        for k in range(joints):
            wanted = margin + width * full[k] + ROUNDING_CM
            spare, _ = segment_clearance(ends[k, 0], ends[k, 1], ends[k + 1, 0], ends[k + 1, 1], obstacles, wanted)
            if world.floor:
                spare = min(spare, ends[k + 1, 1])
            if spare <= margin:
                return False
            proved = proved and spare >= wanted
        if proved:
            start, width = next_piece(start, width)
        elif width * full[joints - 1] <= SMALLEST_CM:
            return False
        else:
            width *= 0.5
    return True


@bare_kernel
def fill_full(lengths_cm: Floats, a_rad: Floats, b_rad: Floats, full: Floats) -> None:
    """Fill the module's bound for a whole move, each link's from its middle pose."""
    turned, moved = 0.0, 0.0
    for p in range(lengths_cm.shape[0]):
        turned += 0.5 * abs(b_rad[p] - a_rad[p])
        moved += lengths_cm[p] * turned
        full[p] = moved
