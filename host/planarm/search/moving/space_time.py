"""Exact search in space and time: the earliest arrival that can be held, and of those the shortest path.

A state is a node and a sample; from it the arm waits or makes one of eight moves, in one sample's time. An edge exists
when the moving proof shows it free (`planarm.workspace.moving_proof`). Nearly all of them need no proof of their own:
a wait where the map's `stay` has the node and a move between two nodes that `room` has are proved by the map. So two
searches, bit-parallel over all nodes, bracket the answer: one over edges that the map proves, which gives an arrival
that is possible, and one over all edges that the nodes alone do not forbid, which gives one that cannot be beaten.
Where they differ the edges in between are proved one by one, only those that can still lead to the goal before the
known arrival. The path is the shortest for its arrival, by dynamic programming backwards, with the same lazy proofs.

When no arrival is found there is none on this grid within the horizon.
"""

from dataclasses import dataclass
from enum import Enum
from time import perf_counter
from typing import Self

import numpy as np
from numpy.typing import NDArray

from planarm.search.moving.bits import Bits, has, move_planes, put, spread
from planarm.search.moving.timed_path import TimedPath
from planarm.workspace.cell_poses import DX, DY, CellPoses
from planarm.workspace.moving_map import MovingMap
from planarm.workspace.moving_proof import MovingWorld, prove_cell_move
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
WAIT = 8
NO_CHOICE = 9


class MovingStatus(Enum):
    """How a search in space and time ended."""

    FOUND = "found"
    IMPOSSIBLE = "impossible"
    START_TAKEN = "start taken"
    GOAL_TAKEN = "goal taken"


@dataclass(frozen=True, slots=True)
class SpaceTimeResult:
    """The answer of a search in space and time."""

    status: MovingStatus
    path: TimedPath | None
    proofs: int
    """Edges that were proved, or refused, one by one."""
    trapped_at: int
    """No pose that the arm can be in at this sample stays free; -1 when there always is one."""
    search_s: float
    """Wall time, of these proofs too, without the map."""


def world_of(moving_map: MovingMap) -> MovingWorld:
    """Return what the moving proof needs to know of a map."""
    arm = moving_map.arm
    return MovingWorld(arm.l1_cm, arm.l2_cm, arm.base_x_cm, arm.base_y_cm, arm.margin_cm, moving_map.obstacles)


def hold_sample(moving_map: MovingMap, cell: int) -> int:
    """Return the first sample from which a node stays free to the horizon; -1 when it is taken at the horizon."""
    iy, ix = divmod(cell, moving_map.poses.columns)
    bit = np.uint64(1) << np.uint64(ix % 64)
    if not moving_map.free[-1, iy, ix // 64] & bit:
        return -1
    taken = np.flatnonzero((moving_map.stay[:, iy, ix // 64] & bit) == 0)
    return int(taken[-1]) + 1 if len(taken) else 0


def search_space_time(moving_map: MovingMap, start: int, goal: int, *, since: int = 0) -> SpaceTimeResult:
    """Return the earliest arrival at a node at which the arm can then rest to the horizon, or that there is none.

    Args:
        moving_map: the free space over time, with what lies between samples.
        start: the cell that the tip is on at sample `since`.
        goal: the cell that it is to reach.
        since: the sample at which the search begins; the path is counted from it.
    """
    began_s = perf_counter()

    def answer(status: MovingStatus, path: TimedPath | None, proofs: int, trapped: int) -> SpaceTimeResult:
        return SpaceTimeResult(status, path, proofs, trapped, perf_counter() - began_s)

    columns = moving_map.poses.columns
    if not has(moving_map.free[since], *divmod(start, columns)):
        return answer(MovingStatus.START_TAKEN, None, 0, since)
    hold = hold_sample(moving_map, goal)
    if hold < 0:
        return answer(MovingStatus.GOAL_TAKEN, None, 0, -1)
    case = _Case.of(moving_map, goal, since, max(0, hold - since))
    cells, proofs, trapped = _solve(case, start)
    if cells is None:
        return answer(MovingStatus.IMPOSSIBLE, None, proofs, trapped + since if trapped >= 0 else -1)
    return answer(MovingStatus.FOUND, TimedPath.through(moving_map, cells), proofs, -1)


@dataclass(frozen=True, slots=True)
class _Case:
    """What is searched: planes from the first sample on, and what the kernels take besides."""

    world: MovingWorld
    poses: CellPoses
    free: Bits
    stay: Bits
    room: Bits
    moves: Bits
    goal: int
    hold: int
    """The first sample at which the arm may arrive."""
    times_s: tuple[float, float, float]
    """The first sample's time, a sample's duration, the delay margin."""

    @classmethod
    def of(cls, moving_map: MovingMap, goal: int, since: int, hold: int) -> Self:
        clock = moving_map.clock
        return cls(
            world_of(moving_map),
            moving_map.poses,
            moving_map.free[since:],
            moving_map.stay[since:],
            moving_map.room[since:],
            move_planes(moving_map.poses),
            goal,
            hold,
            (since * clock.sample_s, clock.sample_s, clock.delay_s),
        )

    @property
    def at_goal(self) -> tuple[int, int]:
        """The goal's row and column."""
        return divmod(self.goal, self.poses.columns)


def _solve(case: _Case, start: int) -> tuple[NDArray[np.int64] | None, int, int]:
    """Return (cells of the path or None, proofs, sample at which the arm is trapped or -1)."""
    free, stay, room, moves = case.free, case.stay, case.room, case.moves
    at_start = divmod(start, case.poses.columns)
    possible, proved = np.zeros(free.shape, np.uint64), np.zeros(free.shape, np.uint64)
    put(possible[0], *at_start)
    soonest = forward(free, stay, room, moves, possible, *case.at_goal, case.hold, False)
    if soonest < 0:
        empty = np.flatnonzero(~possible.any(axis=(1, 2)))
        return None, 0, int(empty[0]) if len(empty) else -1
    put(proved[0], *at_start)
    known = forward(free, stay, room, moves, proved, *case.at_goal, case.hold, True)
    arrival, proofs = known, 0
    if known != soonest:
        limit = known if known >= 0 else len(stay)
        useful = np.zeros(free.shape, np.uint64)
        backward(free, stay, moves, useful, *case.at_goal, case.hold, limit)
        planes = free, stay, room, moves, useful, proved
        arrival, proofs = forward_proving(case.world, case.poses, *planes, case.goal, case.hold, limit, *case.times_s)
        if arrival < 0:
            return None, proofs, -1
        if arrival > soonest:  # the sets end where their search did
            forward(free, stay, room, moves, possible, *case.at_goal, arrival, False)
    useful = np.zeros((arrival + 1, *free.shape[1:]), np.uint64)
    backward(free, stay, moves, useful, *case.at_goal, arrival, arrival)
    useful &= possible[: arrival + 1]
    cells, more = shortest(case.world, case.poses, stay, room, useful, start, case.goal, *case.times_s)
    assert len(cells), "an arrival by proved edges has a path of them"
    return cells, proofs + more, -1


@kernel
def forward(
    free: Bits, stay: Bits, room: Bits, moves: Bits, reach: Bits, gy: int, gx: int, hold: int, by_map: bool
) -> int:
    """Fill the nodes that can be reached at each sample, from those of sample 0; return the arrival, or -1.

    By edges that the map proves; or by all that the nodes do not forbid: a wait is judged exactly, a move by its ends.
    """
    for k in range(stay.shape[0] + 1):
        if k >= hold and has(reach[k], gy, gx):
            return k
        if k == stay.shape[0]:
            return -1
        after = reach[k + 1]
        if by_map:
            spread(reach[k] & room[k], moves, after)
            after &= room[k]
        else:
            spread(reach[k], moves, after)
            after &= free[k + 1]
        after |= reach[k] & stay[k]
    return -1


@kernel
def backward(free: Bits, stay: Bits, moves: Bits, useful: Bits, gy: int, gx: int, hold: int, limit: int) -> None:
    """Fill the nodes from which the goal could be reached at a sample from `hold` to `limit`, by the nodes alone.

    A move exists in both senses or in none.
    """
    put(useful[limit], gy, gx)
    for k in range(limit - 1, -1, -1):
        before = useful[k]
        spread(useful[k + 1], moves, before)
        before &= free[k]
        before |= useful[k + 1] & stay[k]
        if k >= hold:
            put(before, gy, gx)


@kernel
def forward_proving(
    world: MovingWorld,
    poses: CellPoses,
    free: Bits,
    stay: Bits,
    room: Bits,
    moves: Bits,
    useful: Bits,
    reach: Bits,
    goal: int,
    hold: int,
    limit: int,
    begin_s: float,
    sample_s: float,
    delay_s: float,
) -> tuple[int, int]:
    """Fill `reach`, anew, with the useful nodes that proved edges lead to; return (arrival or -1, proofs)."""
    columns, proofs = poses.columns, 0
    piece = np.empty((4, 2))
    around = np.empty((free.shape[1], free.shape[2]), np.uint64)
    for k in range(limit + 1):
        if k >= hold and has(reach[k], goal // columns, goal % columns):
            return k, proofs
        if k == limit:
            break
        after = reach[k + 1]
        after[:] = np.uint64(0)
        spread(reach[k] & room[k], moves, after)
        after &= room[k]
        after |= reach[k] & stay[k]
        after &= useful[k + 1]
        around[:] = np.uint64(0)
        spread(reach[k], moves, around)
        around &= free[k + 1] & useful[k + 1] & ~after
        for iy in range(around.shape[0]):
            for w in range(around.shape[1]):
                ix = 64 * w
                left = around[iy, w]
                while left != np.uint64(0):
                    if left & np.uint64(1):
                        now = begin_s + k * sample_s
                        found, tried = _prove_into(world, poses, reach[k], iy, ix, now, sample_s, delay_s, piece)
                        proofs += tried
                        if found:
                            put(after, iy, ix)
                    left >>= np.uint64(1)
                    ix += 1
    return -1, proofs


@kernel
def _prove_into(
    world: MovingWorld,
    poses: CellPoses,
    reach: Bits,
    iy: int,
    ix: int,
    now_s: float,
    sample_s: float,
    delay_s: float,
    piece: Floats,
) -> tuple[bool, int]:
    """Tell whether a move from a reached neighbour into a node is proved, and how many were tried."""
    columns, rows, tried = poses.columns, poses.rows, 0
    b = poses.place[iy * columns + ix]
    for d in range(8):
        jy, jx = iy + DY[d], ix + DX[d]
        if (poses.moves[b] >> d) & 1 and 0 <= jy < rows and 0 <= jx < columns and has(reach, jy, jx):
            tried += 1
            a = poses.place[jy * columns + jx]
            if prove_cell_move(world, poses.q_rad[a], poses.q_rad[b], now_s, sample_s, delay_s, piece):
                return True, tried
    return False, tried


@kernel
def shortest(
    world: MovingWorld,
    poses: CellPoses,
    stay: Bits,
    room: Bits,
    useful: Bits,
    start: int,
    goal: int,
    begin_s: float,
    sample_s: float,
    delay_s: float,
) -> tuple[NDArray[np.int64], int]:
    """Return the shortest path of proved edges that ends at the last sample of `useful`, and the proofs it took."""
    columns, arrival, proofs = poses.columns, useful.shape[0] - 1, 0
    count = poses.cell.shape[0]
    later, here = np.full(count, np.inf), np.full(count, np.inf)
    choice = np.full((arrival, count), NO_CHOICE, np.uint8)
    later[poses.place[goal]] = 0.0
    piece, costs, ends = np.empty((4, 2)), np.empty(9), np.empty(9, np.int64)
    for k in range(arrival - 1, -1, -1):
        here[:] = np.inf
        now = begin_s + k * sample_s
        for n in range(count):
            iy, ix = poses.cell[n] // columns, poses.cell[n] % columns
            if not has(useful[k], iy, ix):
                continue
            _costs_of_moves(poses, later, n, iy, ix, costs, ends)
            while True:
                d = np.argmin(costs)
                if costs[d] == np.inf:
                    break
                jy, jx = poses.cell[ends[d]] // columns, poses.cell[ends[d]] % columns
                if d == WAIT:
                    proved = has(stay[k], iy, ix)
                else:
                    proved = has(room[k], iy, ix) and has(room[k], jy, jx)
                    if not proved:
                        proofs += 1
                        q_a, q_b = poses.q_rad[n], poses.q_rad[ends[d]]
                        proved = prove_cell_move(world, q_a, q_b, now, sample_s, delay_s, piece)
                if proved:
                    here[n], choice[k, n] = costs[d], d
                    break
                costs[d] = np.inf
        later, here = here, later
    cells = np.empty(arrival + 1, np.int64)
    cells[0] = start if later[poses.place[start]] < np.inf else -1
    if cells[0] < 0:
        return cells[:0], proofs
    for k in range(arrival):
        d = choice[k, poses.place[cells[k]]]
        cells[k + 1] = cells[k] if d == WAIT else cells[k] + DY[d] * columns + DX[d]
    return cells, proofs


@kernel
def _costs_of_moves(
    poses: CellPoses, later: Floats, n: int, iy: int, ix: int, costs: Floats, ends: NDArray[np.int64]
) -> None:
    """Fill the length to the goal by way of each move, and of waiting, and where it ends."""
    for d in range(8):
        costs[d], ends[d] = np.inf, n
        if (poses.moves[n] >> d) & 1:
            ends[d] = poses.place[(iy + DY[d]) * poses.columns + ix + DX[d]]
            costs[d] = later[ends[d]] + (1.0 if d < 4 else np.sqrt(2.0))
    costs[WAIT], ends[WAIT] = later[n], n
