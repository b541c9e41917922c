"""D* on the grid, replanned at every motion sample: the paths that know obstacles only where they are now.

The search runs from the goal and is repaired, not begun anew, when nodes are taken or freed (D* Lite by Koenig and
Likhachev, 2002: the same paths as Stentz's D*, with less bookkeeping). g is the known distance to the goal, rhs what
the neighbours say it is; nodes where they differ wait in a heap by (min(g, rhs) + h + km, min(g, rhs)). Entries are
never removed: one whose key is not its node's present key is passed over. Lengths are integers, so that nodes on one
shortest path have equal keys: with rounding errors a blocked node of the path can seem to lie beyond the start, and the
repair would end too soon.

`search.lifelong` does the same on a graph with its moves written out, real costs and a heap whose entries can be moved.
Here moves are looked up in a bit map of each sample. One core for both would have to be handed these as functions,
which kernels are not (`planarm_wire.kernel_cache`), or the grid be written out as a graph for each sample.
"""

import heapq
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from planarm.search.moving.bits import Bits, has
from planarm.workspace.cell_poses import DX, DY, CellPoses
from planarm_wire.kernel_cache import kernel

Ints = NDArray[np.int64]

REACHED, CONTACT, NO_PATH, HORIZON = range(4)
"""How a run by a rule ended."""

_KM, _EXPANDED = range(2)

STRAIGHT = 1 << 24
DIAGONAL = round(sqrt(2.0) * STRAIGHT)
FAR = 1 << 60
"""Stands for no way."""


@kernel
def run_plain(poses: CellPoses, free: Bits, start: int, goal: int, cells: Ints) -> tuple[int, int, int]:
    """Move along D*'s path of each sample's map; wait where there is none.

    Args:
        poses: the poses, with their moves.
        free: the free nodes of each sample.
        start: place of the first pose in `poses`.
        goal: place of the last.
        cells: filled with the place at each sample, shape (samples + 1,).

    Returns:
        (outcome, sample at which the run ended, nodes expanded). On CONTACT that sample's pose is not free.
    """
    count = poses.cell.shape[0]
    g, rhs, keys = np.full(count, FAR), np.full(count, FAR), np.full((count, 2), FAR)
    known = np.zeros(count, np.bool_)
    for n in range(count):
        known[n] = _is_free(poses, free[0], n)
    numbers = np.zeros(2, np.int64)
    heap = [(FAR, FAR, -1)]
    rhs[goal] = 0
    _queue(poses, g, rhs, keys, heap, goal, start, numbers[_KM])
    here, last, cells[0] = start, start, start
    for k in range(free.shape[0] - 1):
        if here == goal:
            return REACHED, k, numbers[_EXPANDED]
        if k > 0:
            numbers[_KM] += _octile(poses, last, here)
            last = here
        if k > 0 and not np.array_equal(free[k], free[k - 1]):
            _update_map(poses, free[k], known, g, rhs, keys, heap, here, goal, numbers[_KM])
        _repair(poses, known, g, rhs, keys, heap, here, goal, numbers)
        here = _best_neighbour(poses, known, g, here)
        cells[k + 1] = here
        if not _is_free(poses, free[k + 1], here):
            return CONTACT, k + 1, numbers[_EXPANDED]
    return REACHED if here == goal else HORIZON, free.shape[0] - 1, numbers[_EXPANDED]


def first_path(poses: CellPoses, free: Bits, start: int, goal: int) -> Ints:
    """Return D*'s path on one map, places in `poses` from start to goal; empty when there is none.

    It is where plain D* goes when the map does not change.
    """
    samples = poses.rows + poses.columns
    while True:
        places = np.full(samples + 1, -1, np.int64)
        outcome, end, _ = run_plain(poses, np.repeat(free[None], samples + 1, axis=0), start, goal, places)
        if outcome == REACHED:
            return places[: end + 1]
        if places[-1] == places[-2]:  # it waits for a way
            return places[:0]
        samples *= 2


@kernel
def run_modified(poses: CellPoses, free: Bits, path: Ints, cells: Ints) -> tuple[int, int]:
    """Follow a path sample by sample: on to the next node when it is free then, else stop, else return backward.

    Paper B's modification of D*. Returns (outcome, sample at which the run ended); `cells` as in `run_plain`. When
    neither the next node, nor this one, nor the one before is free, the arm stays and the outcome is CONTACT.
    """
    at, goal = 0, path.shape[0] - 1
    cells[0] = path[0]
    for k in range(free.shape[0] - 1):
        if at == goal:
            return REACHED, k
        if _is_free(poses, free[k + 1], path[at + 1]):
            at += 1
        elif not _is_free(poses, free[k + 1], path[at]):
            if at == 0 or not _is_free(poses, free[k + 1], path[at - 1]):
                cells[k + 1] = path[at]
                return CONTACT, k + 1
            at -= 1
        cells[k + 1] = path[at]
    return REACHED if at == goal else HORIZON, free.shape[0] - 1


@kernel
def _is_free(poses: CellPoses, free: Bits, n: int) -> bool:
    return has(free, poses.cell[n] // poses.columns, poses.cell[n] % poses.columns)


@kernel
def _octile(poses: CellPoses, a: int, b: int) -> int:
    """Return the least length between two nodes by moves to neighbours."""
    columns = poses.columns
    dx = abs(poses.cell[a] % columns - poses.cell[b] % columns)
    dy = abs(poses.cell[a] // columns - poses.cell[b] // columns)
    return int(STRAIGHT * abs(dx - dy) + DIAGONAL * min(dx, dy))


@kernel
def _neighbour(poses: CellPoses, n: int, d: int) -> int:
    """Return the place of the pose that move d leads to, -1 when there is no such move."""
    if not (poses.moves[n] >> d) & 1:
        return -1
    cell = poses.cell[n]
    return int(poses.place[cell + DY[d] * poses.columns + DX[d]])


@kernel
def _cost(d: int) -> int:
    return STRAIGHT if d < 4 else DIAGONAL


@kernel
def _best_neighbour(poses: CellPoses, known: NDArray[np.bool_], g: Ints, here: int) -> int:
    """Return the free neighbour on the shortest way to the goal, or `here` when none leads there."""
    best, to = FAR, here
    for d in range(8):
        n = _neighbour(poses, here, d)
        if n >= 0 and known[n] and g[n] < FAR and g[n] + _cost(d) < best:
            best, to = g[n] + _cost(d), n
    return to


@kernel
def _queue(
    poses: CellPoses,
    g: Ints,
    rhs: Ints,
    keys: Ints,
    heap: list[tuple[int, int, int]],
    n: int,
    start: int,
    km: int,
) -> None:
    """Put a node into the heap when it is not consistent; let its old entry lapse."""
    keys[n, 0] = keys[n, 1] = FAR
    if g[n] != rhs[n]:
        least = min(g[n], rhs[n])
        keys[n, 0], keys[n, 1] = least + _octile(poses, n, start) + km, least
        heapq.heappush(heap, (keys[n, 0], keys[n, 1], n))


@kernel
def _look_around(poses: CellPoses, known: NDArray[np.bool_], g: Ints, rhs: Ints, n: int, start: int, goal: int) -> None:
    """Set rhs from the neighbours. The start itself counts when taken: the arm stands there."""
    if n == goal:
        return
    rhs[n] = FAR
    if not known[n] and n != start:
        return
    for d in range(8):
        m = _neighbour(poses, n, d)
        if m >= 0 and known[m]:
            rhs[n] = min(rhs[n], g[m] + _cost(d), FAR)


@kernel
def _update_map(
    poses: CellPoses,
    free: Bits,
    known: NDArray[np.bool_],
    g: Ints,
    rhs: Ints,
    keys: Ints,
    heap: list[tuple[int, int, int]],
    start: int,
    goal: int,
    km: int,
) -> None:
    """Take over a new map and look again at every node whose moves it changes."""
    count = known.shape[0]
    changed = np.zeros(count, np.bool_)
    for n in range(count):
        now = _is_free(poses, free, n)
        if now != known[n]:
            known[n], changed[n] = now, True
    for n in range(count):
        if changed[n]:
            _look_again(poses, known, g, rhs, keys, heap, n, start, goal, km)
            for d in range(8):
                m = _neighbour(poses, n, d)
                if m >= 0 and not changed[m]:
                    _look_again(poses, known, g, rhs, keys, heap, m, start, goal, km)
    _look_again(poses, known, g, rhs, keys, heap, start, start, goal, km)


@kernel
def _look_again(
    poses: CellPoses,
    known: NDArray[np.bool_],
    g: Ints,
    rhs: Ints,
    keys: Ints,
    heap: list[tuple[int, int, int]],
    n: int,
    start: int,
    goal: int,
    km: int,
) -> None:
    _look_around(poses, known, g, rhs, n, start, goal)
    _queue(poses, g, rhs, keys, heap, n, start, km)


@kernel
def _repair(
    poses: CellPoses,
    known: NDArray[np.bool_],
    g: Ints,
    rhs: Ints,
    keys: Ints,
    heap: list[tuple[int, int, int]],
    start: int,
    goal: int,
    numbers: Ints,
) -> None:
    """Make the nodes consistent that the shortest way from the start depends on."""
    km = numbers[_KM]
    while len(heap) > 0:
        first, second, n = heap[0]
        if n < 0 or first != keys[n, 0] or second != keys[n, 1]:
            if n < 0:
                return
            heapq.heappop(heap)
            continue
        least = min(g[start], rhs[start])
        beyond = first > least + km or (first == least + km and second >= least)
        if beyond and rhs[start] == g[start]:
            return
        heapq.heappop(heap)
        keys[n, 0] = keys[n, 1] = FAR
        lowest = min(g[n], rhs[n])
        fresh = lowest + _octile(poses, n, start) + km
        if fresh > first:  # the start has moved since it was queued
            _queue(poses, g, rhs, keys, heap, n, start, km)
            continue
        numbers[_EXPANDED] += 1
        if g[n] > rhs[n]:
            g[n] = rhs[n]
        else:
            g[n] = FAR
            _look_again(poses, known, g, rhs, keys, heap, n, start, goal, km)
        for d in range(8):
            m = _neighbour(poses, n, d)
            if m >= 0:
                _look_again(poses, known, g, rhs, keys, heap, m, start, goal, km)
