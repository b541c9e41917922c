"""What is in sight: straight legs of any direction between points of a map, the edges of every any-angle path.

A leg is in sight when the nodes of all cells that it crosses are free and, with moves = "proved", every stretch of it
that lies outside cells free as a whole is proved free for the arm, with discs not much smaller than a cell: what needs
finer ones grazes an obstacle and would take long to prove. A leg between two nodes at most SHORT_CELLS long is
in sight when it is a legal move, whatever cells it crosses: so each move of the stencils is.

Both directions of a leg agree: it is always walked from its lower end.
"""

from math import floor, inf

import numpy as np
from numpy.typing import NDArray

from planarm.search.legal import PROOF, SHUT, WHOLE_ROOM, Lattice
from planarm.workspace.line_proof import prove_line_by
from planarm.workspace.proof import PROVED, SMALLEST_CM
from planarm.workspace.world import ArmWorld
from planarm_wire.kernel_cache import kernel

SHORT_CELLS = 5.0
"""The longest move of any stencil."""

SMALLEST_SHARE = 0.03
"""Radius of the smallest disc that a long leg is proved with, in cells."""

OVERLAP = 1e-6
"""Stretches that are proved reach this share of a cell into the cells beside them."""

Floats = NDArray[np.float64]


@kernel
def in_sight(lattice: Lattice, world: ArmWorld, legal: int, ax: float, ay: float, bx: float, by: float) -> bool:
    """Tell whether the leg from a to b is in sight; points in cells from node 0, `legal` CELLS or PROOF."""
    if by < ay or (by == ay and bx < ax):
        ax, ay, bx, by = bx, by, ax, ay
    clear, whole = _cells_are_free(lattice, ax, ay, bx, by)
    if legal != PROOF or whole:
        return clear
    dx, dy = bx - ax, by - ay
    if dx * dx + dy * dy <= SHORT_CELLS * SHORT_CELLS:
        if clear or (ax == floor(ax) and ay == floor(ay) and bx == floor(bx) and by == floor(by)):
            return _proved(lattice, world, ax, ay, bx, by, SMALLEST_CM)
        return False
    return clear and _stretches_are_proved(lattice, world, ax, ay, bx, by)


@kernel
def next_crossing(cell: int, start: float, delta: float) -> float:
    """Return the share of a leg at which it leaves a column (or row) of cells: equal crossings give equal numbers."""
    if delta == 0.0:
        return inf
    return (cell + (0.5 if delta > 0.0 else -0.5) - start) / delta


@kernel
def _cells_are_free(lattice: Lattice, ax: float, ay: float, bx: float, by: float) -> tuple[bool, bool]:
    """Tell whether all cells that a leg crosses have free nodes, and whether all are free as a whole."""
    room, width = lattice.room, lattice.width
    dx, dy, x, y = bx - ax, by - ay, floor(ax + 0.5), floor(ay + 0.5)
    step = 1 if dx > 0.0 else -1
    across, up = next_crossing(x, ax, dx), next_crossing(y, ay, dy)
    whole = True
    while True:
        here = room[y * width + x]
        if here == SHUT:
            return False, False
        whole = whole and here == WHOLE_ROOM
        if across >= 1.0 and up >= 1.0:
            return True, whole
        go_across, go_up = across <= up, up <= across
        if go_across:
            x += step
            across = next_crossing(x, ax, dx)
        if go_up:
            y += 1
            up = next_crossing(y, ay, dy)


@kernel
def _stretches_are_proved(lattice: Lattice, world: ArmWorld, ax: float, ay: float, bx: float, by: float) -> bool:
    """Prove the stretches of a leg that lie outside cells free as a whole."""
    room, width = lattice.room, lattice.width
    dx, dy, x, y = bx - ax, by - ay, floor(ax + 0.5), floor(ay + 0.5)
    step = 1 if dx > 0.0 else -1
    across, up = next_crossing(x, ax, dx), next_crossing(y, ay, dy)
    more = OVERLAP / max(abs(dx) + abs(dy), OVERLAP)
    entered, open_since, smallest_cm = 0.0, -1.0, max(SMALLEST_CM, SMALLEST_SHARE * lattice.cell_cm)
    while True:
        if room[y * width + x] != WHOLE_ROOM:
            open_since = entered if open_since < 0.0 else open_since
        elif open_since >= 0.0:
            low, high = max(0.0, open_since - more), min(1.0, entered + more)
            if not _proved(lattice, world, ax + low * dx, ay + low * dy, ax + high * dx, ay + high * dy, smallest_cm):
                return False
            open_since = -1.0
        if across >= 1.0 and up >= 1.0:
            low = max(0.0, open_since - more)
            return open_since < 0.0 or _proved(lattice, world, ax + low * dx, ay + low * dy, bx, by, smallest_cm)
        go_across, go_up = across <= up, up <= across
        entered = min(across, up)
        if go_across:
            x += step
            across = next_crossing(x, ax, dx)
        if go_up:
            y += 1
            up = next_crossing(y, ay, dy)


@kernel
def _proved(lattice: Lattice, world: ArmWorld, ax: float, ay: float, bx: float, by: float, smallest_cm: float) -> bool:
    cell, column, row = lattice.cell_cm, lattice.column, lattice.row
    x0, y0, x1, y1 = (column + ax) * cell, (row + ay) * cell, (column + bx) * cell, (row + by) * cell
    verdict, _ = prove_line_by(world, x0, y0, x1, y1, smallest_cm)
    return verdict == PROVED
