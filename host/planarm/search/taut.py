"""Pull a path taut: the shortest way through some of its points, straight legs in sight only.

Dynamic programming over the path's points in their order: the shortest way to a point is that to an earlier one in
sight and on. The legs of the path itself always count as in sight, so the result is never longer than the path.
Candidates are the path's nodes and, on coarse maps, the nodes of the cells that it crosses.

The last corner before a point moves forward along the path or, where the path bends back, a little backward: only
candidates from a few before the last corner of the previous point on are tried. Last, corners are moved by single cells
as long as that shortens the path.
"""

from itertools import pairwise
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from planarm.search.legal import SHUT, Lattice
from planarm.search.sight import in_sight, next_crossing
from planarm.workspace.world import ArmWorld
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RICH = 160
"""Up to so many points, the nodes of the cells between them are candidates, too."""

LOOK_BACK = 6
"""How far the last corner may move back from one point to the next, in candidates."""

MOST_CELLS = 8
"""Cells that a move of a stencil or a join crosses in each direction, at most."""

SHORTER = 1e-9
"""In cells: what counts as shorter when corners are moved."""


def pull_taut(lattice: Lattice, world: ArmWorld, legal: int, points: Floats) -> Floats:
    """Return the points of a path that is no longer, shape (m, 2).

    Args:
        lattice: the map.
        world: the arm, for proofs.
        legal: CELLS or PROOF, as in `planarm.search.best_first.Rules`.
        points: way-points in cells from the lattice's node 0, shape (n, 2), n >= 1, each leg of which is legal.
    """
    if len(points) <= 2:
        return points
    rich = _with_cells_between(lattice, points) if len(points) <= RICH else (points, np.arange(len(points)))
    taut = _shortest_chain(lattice, world, legal, points, *rich)
    move_corners(lattice, world, legal, taut)
    return taut


def _with_cells_between(lattice: Lattice, points: Floats) -> tuple[Floats, Ints]:
    """Return the points with the free nodes of the cells between them, in order, and each one's number or -1."""
    out, number = (
        np.empty((len(points) * (2 * MOST_CELLS + 1), 2)),
        np.empty(len(points) * (2 * MOST_CELLS + 1), np.int64),
    )
    count = _add_cells(lattice, points, out, number)
    return out[:count], number[:count]


@kernel
def _add_cells(lattice: Lattice, points: Floats, out: Floats, number: Ints) -> int:
    count = 0
    for i in range(points.shape[0] - 1):
        out[count, 0], out[count, 1], number[count] = points[i, 0], points[i, 1], i
        count += 1
        ax, ay, dx, dy = points[i, 0], points[i, 1], points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        x, y = round(ax), round(ay)
        step_x, step_y = 1 if dx > 0.0 else -1, 1 if dy > 0.0 else -1
        across, up = next_crossing(x, ax, dx), next_crossing(y, ay, dy)
        for _ in range(2 * MOST_CELLS):
            if across >= 1.0 and up >= 1.0:
                break
            go_across, go_up = across <= up, up <= across
            if go_across:
                x += step_x
                across = next_crossing(x, ax, dx)
            if go_up:
                y += step_y
                up = next_crossing(y, ay, dy)
            if (x != points[i + 1, 0] or y != points[i + 1, 1]) and lattice.room[y * lattice.width + x] != SHUT:
                out[count, 0], out[count, 1], number[count] = x, y, -1
                count += 1
    last = points.shape[0] - 1
    out[count, 0], out[count, 1], number[count] = points[last, 0], points[last, 1], last
    return count + 1


def _shortest_chain(
    lattice: Lattice, world: ArmWorld, legal: int, points: Floats, candidates: Floats, number: Ints
) -> Floats:
    """Return the shortest path through candidates in their order.

    A candidate with a number >= 0 is that one of `points`; from one such to the next, `points` may be followed.
    """
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    own = np.flatnonzero(number >= 0)
    link, link_cells = np.full(len(candidates), -1, np.int64), np.full(len(candidates), inf)
    link[own[1:]], link_cells[own[1:]] = own[:-1], np.diff(along[number[own]])
    before, by_link = chain_kernel(lattice, world, legal, candidates, link, link_cells)
    chain = [len(candidates) - 1]
    while before[chain[-1]] >= 0:
        chain.append(int(before[chain[-1]]))
    chain.reverse()
    parts = [candidates[:1]]
    for i, j in pairwise(chain):
        parts.append(points[number[i] + 1 : number[j] + 1] if by_link[j] else candidates[j : j + 1])
    return np.concatenate(parts)


@kernel
def chain_kernel(
    lattice: Lattice, world: ArmWorld, legal: int, points: Floats, link: Ints, link_cells: Floats
) -> tuple[Ints, NDArray[np.bool_]]:
    """Return each point's predecessor on the shortest way from the first, and whether it is reached by its link."""
    count = points.shape[0]
    length, through = np.full(count, inf), np.empty(count)
    before, by_link = np.full(count, -1), np.zeros(count, np.bool_)
    length[0] = 0.0
    for j in range(1, count):
        if link[j] >= 0:
            length[j], before[j], by_link[j] = length[link[j]] + link_cells[j], link[j], True
        low = max(0, min(before[j - 1], before[j]) - LOOK_BACK)
        for i in range(low, j):
            dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            through[i] = length[i] + sqrt(dx * dx + dy * dy)
        while True:
            i = low
            for k in range(low + 1, j):
                if through[k] < through[i]:
                    i = k
            if through[i] >= length[j]:
                break
            if in_sight(lattice, world, legal, points[i, 0], points[i, 1], points[j, 0], points[j, 1]):
                length[j], before[j], by_link[j] = through[i], i, False
                break
            through[i] = inf
    return before, by_link


@kernel
def move_corners(lattice: Lattice, world: ArmWorld, legal: int, points: Floats) -> None:
    """Move each corner by single cells, in place, as long as that shortens the path and both legs stay in sight."""
    moved = True
    while moved:
        moved = False
        for i in range(1, points.shape[0] - 1):
            ax, ay, bx, by = points[i - 1, 0], points[i - 1, 1], points[i + 1, 0], points[i + 1, 1]
            shortest = leg_cells(ax, ay, points[i, 0], points[i, 1]) + leg_cells(points[i, 0], points[i, 1], bx, by)
            x, y = points[i, 0], points[i, 1]
            for k in range(9):
                cx, cy = x + k % 3 - 1, y + k // 3 - 1
                cells = leg_cells(ax, ay, cx, cy) + leg_cells(cx, cy, bx, by)
                if (
                    cells < shortest - SHORTER
                    and lattice.room[int(cy) * lattice.width + int(cx)] != SHUT
                    and in_sight(lattice, world, legal, ax, ay, cx, cy)
                    and in_sight(lattice, world, legal, cx, cy, bx, by)
                ):
                    shortest, points[i, 0], points[i, 1], moved = cells, cx, cy, True


@kernel
def leg_cells(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the length of a leg."""
    return sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
