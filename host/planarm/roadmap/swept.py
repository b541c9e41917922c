"""Which moves can an obstacle touch? A grid over the workspace that lists, for each cell, the moves that sweep it.

A move is cut into pieces on which no point of the arm leaves the middle pose by more than half a cell. There each link
is a chain of points a cell apart, and every cell that a disc around a point meets is listed: discs of half a cell and
the piece's bound cover all that the link's centre line sweeps. An obstacle touches at most the moves of the
cells that come as near to it as the margin.
"""

from math import ceil, floor, hypot, sqrt
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from planarm.model.collision import segment_clearance
from planarm.model.shapes import ObstacleSet
from planarm.roadmap.moves import fill_full
from planarm.workspace.joint_proof import JointWorld, link_ends
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Cells = NDArray[np.int32]

CELLS_A_REACH = 32
MOST_PIECES = 64
"""A move longer than this many pieces is cut into as many, whose bound is larger."""


class Grid(NamedTuple):
    """Square cells over all that the arm reaches."""

    left_cm: float
    bottom_cm: float
    cell_cm: float
    side: int
    """Cells in a row, and rows."""

    @classmethod
    def over(cls, world: JointWorld) -> Self:
        """Return the grid around the arm's base."""
        reach = float(world.lengths_cm.sum())
        cell = reach / CELLS_A_REACH
        side = 2 * CELLS_A_REACH + 4  # a cell's rim on both sides: discs reach beyond the reach
        return cls(world.base_x_cm - 0.5 * side * cell, world.base_y_cm - 0.5 * side * cell, cell, side)


class SweptCells(NamedTuple):
    """The moves of each cell: `move[first[c] : first[c + 1]]`."""

    grid: Grid
    first: Ints
    move: Cells

    @classmethod
    def of(cls, world: JointWorld, poses_rad: Floats, pairs: Ints) -> Self:
        """Return the cells that the moves between pairs of poses, shape (m, 2), sweep."""
        grid = Grid.over(world)
        counts = np.zeros(grid.side * grid.side + 1, np.int64)
        nowhere = np.empty(0, np.int32)
        list_cells(world, poses_rad, pairs, grid, counts, nowhere)
        first = np.zeros(len(counts), np.int64)
        np.cumsum(counts[:-1], out=first[1:])
        move = np.empty(first[-1], np.int32)
        list_cells(world, poses_rad, pairs, grid, first.copy(), move)
        return cls(grid, first, move)

    def near(self, obstacles: ObstacleSet, distance_cm: float) -> Ints:
        """Return the moves, ascending, on which a link's centre line can come as near as that to an obstacle."""
        cells = cells_near(self.grid, obstacles, distance_cm)
        if not len(cells):
            return np.empty(0, np.int64)
        return union_of(self.first, self.move, cells)


@kernel
def list_cells(world: JointWorld, poses_rad: Floats, pairs: Ints, grid: Grid, at: Ints, move: Cells) -> None:
    """Count each cell's moves into `at`, shape (cells + 1,); or, given room in `move`, write them from `at` on."""
    joints, side, cell = poses_rad.shape[1], grid.side, grid.cell_cm
    stamp = np.full(side * side, -1, np.int32)
    q, full, ends = np.empty(joints), np.empty(joints), np.empty((joints + 1, 2))
    for m in range(pairs.shape[0]):
        a, b = poses_rad[pairs[m, 0]], poses_rad[pairs[m, 1]]
        fill_full(world.lengths_cm, a, b, full)
        pieces = min(MOST_PIECES, max(1, ceil(full[joints - 1] / (0.5 * cell))))
        for p in range(pieces):
            for j in range(joints):
                q[j] = a[j] + (p + 0.5) / pieces * (b[j] - a[j])
            link_ends(world, q, ends)
            for k in range(joints):
                dots = max(1, ceil(world.lengths_cm[k] / cell))
                radius = 0.5 * world.lengths_cm[k] / dots + full[k] / pieces + 1e-9
                for d in range(dots):
                    share = (d + 0.5) / dots
                    x = (ends[k, 0] + share * (ends[k + 1, 0] - ends[k, 0]) - grid.left_cm) / cell
                    y = (ends[k, 1] + share * (ends[k + 1, 1] - ends[k, 1]) - grid.bottom_cm) / cell
                    r = radius / cell
                    for row in range(max(0, floor(y - r)), min(side, floor(y + r) + 1)):
                        for column in range(max(0, floor(x - r)), min(side, floor(x + r) + 1)):
                            c = row * side + column
                            if stamp[c] != m:
                                stamp[c] = m
                                if move.shape[0]:
                                    move[at[c]] = m
                                at[c] += 1


@kernel
def cells_near(grid: Grid, obstacles: ObstacleSet, distance_cm: float) -> NDArray[np.int64]:
    """Return the cells that come as near as that to an obstacle."""
    side, cell = grid.side, grid.cell_cm
    limit = distance_cm + sqrt(0.5) * cell + 1e-9
    marked = np.zeros(side * side, np.bool_)
    for i in range(obstacles.radii_cm.shape[0]):
        x, y = obstacles.centers_cm[i, 0] - grid.left_cm, obstacles.centers_cm[i, 1] - grid.bottom_cm
        reach = obstacles.radii_cm[i] + limit
        for row in range(max(0, floor((y - reach) / cell)), min(side, floor((y + reach) / cell) + 1)):
            for column in range(max(0, floor((x - reach) / cell)), min(side, floor((x + reach) / cell) + 1)):
                cx, cy = (column + 0.5) * cell, (row + 0.5) * cell
                if hypot(cx - x, cy - y) <= reach:
                    cx, cy = cx + grid.left_cm, cy + grid.bottom_cm
                    apart, _ = segment_clearance(cx, cy, cx, cy, obstacles, limit)
                    marked[row * side + column] |= apart < limit
    return np.flatnonzero(marked)


@kernel
def union_of(first: Ints, move: Cells, cells: Ints) -> NDArray[np.int64]:
    """Return the moves of all these cells, each once, ascending."""
    last = 0
    for c in cells:
        for k in range(first[c], first[c + 1]):
            last = max(last, move[k])
    marked = np.zeros(last + 1, np.bool_)
    for c in cells:
        for k in range(first[c], first[c + 1]):
            marked[move[k]] = True
    return np.flatnonzero(marked)
