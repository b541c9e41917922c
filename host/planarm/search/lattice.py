"""From a map and a stencil to the flat arrays that the search runs on."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from planarm.search.costs import move_costs, norm_planes
from planarm.search.legal import ROOM, SHUT, THREE, WHOLE_ROOM, Lattice, Moves
from planarm.search.stencils import Offsets, cover
from planarm.workspace.free_map import FreeMap
from planarm.workspace.world import FREE
from planarm_wire.kernel_cache import kernel


def make_lattice(free_map: FreeMap, border: int) -> Lattice:
    """Return the lattice of a map, shut all round by `border` nodes: at least any move's longest coordinate."""
    rows, columns = free_map.region.shape
    room = np.empty((rows + 2 * border, columns + 2 * border), np.uint8)
    _fill(free_map.region, free_map.whole, border, room)
    column, row = (round(float(first_cm) / free_map.cell_cm) for first_cm in (free_map.x_cm[0], free_map.y_cm[0]))
    return Lattice(room.reshape(-1), room.shape[1], column - border, row - border, free_map.cell_cm)


@kernel
def _fill(region: NDArray[np.uint8], whole: NDArray[np.bool_], border: int, room: NDArray[np.uint8]) -> None:
    # Loops, not slices: Numba takes seconds to compile an assignment to a slice.
    rows, columns = region.shape
    for iy in range(room.shape[0]):
        line = room[iy]
        if iy < border or iy >= border + rows:
            for ix in range(room.shape[1]):
                line[ix] = SHUT
            continue
        regions, wholes = region[iy - border], whole[iy - border]
        for ix in range(border):
            line[ix] = line[border + columns + ix] = SHUT
        for ix in range(columns):
            line[border + ix] = SHUT if regions[ix] != FREE else (WHOLE_ROOM if wholes[ix] else ROOM)


def make_moves(offsets: Offsets, lattice: Lattice, stencil: Offsets | None = None) -> Moves:
    """Return the moves of a stencil, int[n, 2], on a lattice; the same arrays for the same question.

    Args:
        offsets: the moves.
        lattice: where they are made.
        stencil: the whole neighbourhood that `offsets` is a part of, when it is.
    """
    whole = offsets if stencil is None else stencil
    return _make_moves(tuple(map(tuple, offsets.tolist())), tuple(map(tuple, whole.tolist())), lattice.width)


@lru_cache(maxsize=64)
def _make_moves(moves: tuple[tuple[int, int], ...], stencil: tuple[tuple[int, int], ...], width: int) -> Moves:
    offsets = np.array(moves, np.int16)
    dx, dy = np.ascontiguousarray(offsets.T, dtype=np.int64)
    covers = [[x + y * width for x, y in cover(i, j)] for i, j in moves]
    return Moves(
        dx=dx,
        dy=dy,
        jump=dx + dy * width,
        cost=move_costs(offsets),
        planes=norm_planes(np.array(stencil, np.int16)),
        after=_moves_after(offsets),
        cover_first=np.cumsum([0, *map(len, covers)], dtype=np.int64),
        cover=np.array([cell for cells in covers for cell in cells], dtype=np.int64),
        longest=int(move_costs(offsets).max()),
    )


def _moves_after(offsets: Offsets) -> NDArray[np.int64]:
    """Return `Moves.after`: in its rows 1 on, the shortest move of each of three neighbouring directions."""
    count = len(offsets)
    after = np.tile(np.arange(count, dtype=np.int64), (count + 1, 1))
    angles = np.arctan2(offsets[:, 1].astype(float), offsets[:, 0].astype(float))
    single = np.flatnonzero(np.gcd(offsets[:, 0], offsets[:, 1]) == 1)
    around = single[np.argsort(angles[single])]
    if len(around) >= THREE:
        for move in range(count):
            place = int(np.argmin(np.abs(angles[around] - angles[move])))
            after[1 + move, :THREE] = around[place], around[place - 1], around[(place + 1) % len(around)]
    return after


def open_room(lattice: Lattice, reach: int, least: int) -> NDArray[np.uint8]:
    """Return 1 for each node around which all nodes up to `reach` rows and columns away have at least that room.

    `reach` is at most the lattice's border.
    """
    grid = lattice.room.reshape(-1, lattice.width)
    out = np.zeros_like(grid)
    _erode(grid, reach, least, out)
    return out.reshape(-1)


@kernel
def _erode(room: NDArray[np.uint8], reach: int, least: int, out: NDArray[np.uint8]) -> None:
    """For each row: how many rows up to here are open in a column, then a run of columns in which that is enough."""
    rows, columns = room.shape
    size = 2 * reach + 1
    height = np.zeros(columns, np.int32)
    for iy in range(rows):
        line = room[iy]
        for ix in range(columns):
            height[ix] = height[ix] + 1 if line[ix] >= least else 0
        if iy < 2 * reach:
            continue
        target, run = out[iy - reach], 0
        for ix in range(columns):
            run = run + 1 if height[ix] >= size else 0
            if run >= size:
                target[ix - reach] = 1


def near_room(lattice: Lattice, reach: int) -> Lattice:
    """Return a lattice whose nodes are open where one at most `reach` rows and columns away has room in this one.

    The border must be wider than `reach` by what moves on the result need.
    """
    shut = (lattice.room == SHUT).astype(np.uint8)
    enclosed = open_room(lattice._replace(room=shut), reach, 1).reshape(-1, lattice.width) != 0
    edge = np.ones_like(enclosed)
    edge[reach:-reach, reach:-reach] = False
    return lattice._replace(room=np.where(enclosed | edge, SHUT, ROOM).astype(np.uint8).reshape(-1))


def node_at(lattice: Lattice, column: int, row: int) -> int:
    """Return the node at (column * cell_cm, row * cell_cm)."""
    return (row - lattice.row) * lattice.width + column - lattice.column


def nodes_cm(lattice: Lattice, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the points (x, y) of nodes, shape (n, 2)."""
    row, column = np.divmod(nodes, lattice.width)
    return np.column_stack([column + lattice.column, row + lattice.row]) * lattice.cell_cm
