"""From a map and a stencil to the flat arrays that the search runs on."""

import numpy as np

from planarm.search.best_first import Lattice, Moves
from planarm.search.stencils import Offsets, cover
from planarm.workspace.free_map import FreeMap
from planarm.workspace.world import FREE


def make_lattice(free_map: FreeMap, border: int) -> Lattice:
    """Return the lattice of a map, shut all round by `border` nodes: at least any move's longest coordinate."""
    rows, columns = free_map.region.shape
    shut = np.ones((rows + 2 * border, columns + 2 * border), np.uint8)
    whole = np.zeros_like(shut)
    inner = slice(border, border + rows), slice(border, border + columns)
    shut[inner] = free_map.region != FREE
    whole[inner] = free_map.whole
    column, row = (round(float(first_cm) / free_map.cell_cm) for first_cm in (free_map.x_cm[0], free_map.y_cm[0]))
    return Lattice(
        shut=shut.reshape(-1),
        whole=whole.reshape(-1),
        width=shut.shape[1],
        column=column - border,
        row=row - border,
        cell_cm=free_map.cell_cm,
    )


def make_moves(offsets: Offsets, lattice: Lattice) -> Moves:
    """Return the moves of a stencil, int[n, 2], on a lattice."""
    dx, dy = np.ascontiguousarray(offsets.T, dtype=np.int64)
    covers = [[x + y * lattice.width for x, y in cover(int(i), int(j))] for i, j in offsets]
    return Moves(
        dx=dx,
        dy=dy,
        jump=dx + dy * lattice.width,
        length_cm=lattice.cell_cm * np.sqrt((dx * dx + dy * dy).astype(np.float64)),
        cover_first=np.cumsum([0, *map(len, covers)], dtype=np.int64),
        cover=np.array([cell for cells in covers for cell in cells], dtype=np.int64),
    )


def node_at(lattice: Lattice, column: int, row: int) -> int:
    """Return the node at (column * cell_cm, row * cell_cm)."""
    return (row - lattice.row) * lattice.width + column - lattice.column
