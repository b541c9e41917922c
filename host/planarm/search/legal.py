"""The nodes and the moves between them, as kernels see them, and which moves are legal."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.workspace.line_proof import FEW, prove_pieces
from planarm.workspace.proof import PROVED, SMALLEST_CM
from planarm.workspace.world import ArmWorld
from planarm_wire.kernel_cache import bare_kernel, kernel

SHUT, ROOM, WHOLE_ROOM = 0, 1, 2
"""A node that is not to be entered: not free, or border; a free one; one whose cell is free as a whole."""

NODES, CELLS, PROOF = range(3)
"""What makes a move legal: its end is free; all cells it crosses are, at their nodes; it is proved free as a whole."""


THREE = 3
"""Moves that can follow one in the open: the same and its neighbours in direction."""


class Lattice(NamedTuple):
    """The nodes row by row, with a border as wide as the longest move so that no move leaves the arrays.

    A node is known by its place in these arrays.
    """

    room: NDArray[np.uint8]
    """SHUT, ROOM or WHOLE_ROOM."""
    width: int
    """Nodes in a row."""
    column: int
    """x of node 0 in cells: a node in its column is at x = column * cell_cm."""
    row: int
    """y of node 0 in cells."""
    cell_cm: float


class Moves(NamedTuple):
    """The stencil, one value for each move."""

    dx: NDArray[np.int64]
    dy: NDArray[np.int64]
    jump: NDArray[np.int64]
    """What the move adds to a node's place in the lattice."""
    cost: NDArray[np.int64]
    planes: NDArray[np.int64]
    """The norm of the stencil, for `planarm.search.costs.norm`."""
    after: NDArray[np.int64]
    """Row 0: all moves. Row 1 + k: the THREE that can follow move k in the open."""
    cover_first: NDArray[np.int64]
    """Where the move's cells begin in `cover`; one value more than there are moves."""
    cover: NDArray[np.int64]
    """The cells that each move crosses, relative to the node that it leaves."""
    longest: int
    """The greatest cost of a move."""


@kernel
def move_is_legal(lattice: Lattice, moves: Moves, legal: int, world: ArmWorld, to: int, move: int) -> bool:
    """Tell whether a move to the node `to` is: all cells crossed are as free as `legal` asks, or the line is proved."""
    x, y = to % lattice.width, to // lattice.width
    return is_legal(lattice, moves, legal, world, memory_for(world), x, y, move)


@kernel
def line_is_free(lattice: Lattice, world: ArmWorld, a: int, b: int) -> bool:
    """Tell whether all poses of the straight move between two nodes are proved free; both directions agree."""
    ax, ay, bx, by = a % lattice.width, a // lattice.width, b % lattice.width, b // lattice.width
    return is_proved(lattice, world, memory_for(world), ax, ay, bx - ax, by - ay)


@kernel
def memory_for(world: ArmWorld) -> NDArray[np.int64]:
    """Return memory for `is_legal` and `is_proved`."""
    obstacles = world.obstacles
    if obstacles.radii_cm.size > FEW:
        return np.empty(obstacles.radii_cm.size, np.int64)
    return obstacles.first_vertex


@bare_kernel
def is_legal(
    lattice: Lattice, moves: Moves, legal: int, world: ArmWorld, near: NDArray[np.int64], x: int, y: int, move: int
) -> bool:
    """`move_is_legal` to the node in column x and row y of the lattice, with memory from `memory_for`."""
    x, y = x - moves.dx[move], y - moves.dy[move]
    node = y * lattice.width + x
    for i in range(moves.cover_first[move], moves.cover_first[move + 1]):
        if lattice.room[node + moves.cover[i]] < legal:
            return legal == PROOF and is_proved(lattice, world, near, x, y, moves.dx[move], moves.dy[move])
    return True


@bare_kernel
def is_proved(lattice: Lattice, world: ArmWorld, near: NDArray[np.int64], x: int, y: int, dx: int, dy: int) -> bool:
    """`line_is_free` from column x and row y of the lattice by (dx, dy), with memory from `memory_for`."""
    x, y, cell_cm = x + lattice.column, y + lattice.row, lattice.cell_cm
    if dy < 0 or (dy == 0 and dx < 0):  # the proof divides the line from its first end: fix which one that is
        x, y, dx, dy = x + dx, y + dy, -dx, -dy
    x0, y0, x1, y1 = x * cell_cm, y * cell_cm, (x + dx) * cell_cm, (y + dy) * cell_cm
    arm, (centers_cm, radii_cm, first_vertex, vertices_cm) = world
    verdict, _ = prove_pieces(
        arm,
        centers_cm,
        radii_cm,
        first_vertex,
        vertices_cm,
        near,
        x0 - arm.base_x_cm,
        y0 - arm.base_y_cm,
        x1 - x0,
        y1 - y0,
        SMALLEST_CM,
    )
    return verdict == PROVED


@kernel
def node_cm(lattice: Lattice, node: int) -> tuple[float, float]:
    """Return the (x, y) of a node."""
    x = (lattice.column + node % lattice.width) * lattice.cell_cm
    y = (lattice.row + node // lattice.width) * lattice.cell_cm
    return x, y
