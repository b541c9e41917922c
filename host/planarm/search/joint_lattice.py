"""The one best-first search in joint space, compiled: a lattice over (theta1, theta2), moves proved late.

Entries of the open list are moves: (f, from, to). A move is proved when it comes to the top and its end is still open,
so only the moves that a shortest path might use are proved; a node may wait in the list once for each move to it, and
the first proved one is the shortest way to it, as h is consistent. Nodes beyond the lattice are the given poses.
"""

from math import cos, hypot, inf, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.search.heap import rise, sink
from planarm.workspace.joint_proof import JointWorld, pose_spare_cm, prove_pieces
from planarm.workspace.proof import PROVED
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NONE = -1
JOINT_TRAVEL, TIME, TIP_LENGTH = 0, 1, 2
"""Objectives: the length of the way in joint space in rad; the seconds that the joints' speeds alone ask for; the
length of the tip's way in cm."""

TIP_SAMPLES = 8
"""Chords by which the tip's way along a move is measured; for a move of 6 degrees they are 1e-5 short."""

TIE_S_PER_RAD = 1e-3
"""Of two ways that take the joints equally long the shorter one is better: added to the time for each radian."""

JOIN_CELLS = 2
"""A given pose is joined to lattice nodes at most this many rows and columns away."""


class JointLattice(NamedTuple):
    """Poses at multiples of the cell, and beyond them the given poses: first the goals, then the starts."""

    column: int
    """theta1 of the first column in cells."""
    row: int
    """theta2 of the first row in cells."""
    columns: int
    rows: int
    cell_rad: float
    given_rad: Floats
    """Goals and starts, shape (goals + starts, 2)."""
    goals: int
    spare_cm: Floats
    """Clearance beyond the margin at every node and given pose; not above 0 where it is not to be entered."""


class Costs(NamedTuple):
    """What a move costs."""

    objective: int
    speeds_rad_s: Floats
    change: float
    """Added when the elbow changes its side, in the objective's unit."""
    reach_cm: Floats
    """How far one radian of each joint can move a point of the arm at most, shape (2,)."""
    closed: Floats
    """Half lines that no move may cross, shape (m, 2): theta1, and the sign of theta2."""


@kernel
def fill_spare(world: JointWorld, lattice: JointLattice) -> None:
    """Fill the room of every node and given pose; nodes outside the joints' limits have none."""
    q = np.empty(2)
    for node in range(lattice.spare_cm.shape[0]):
        q[0], q[1] = pose_of(lattice, node)
        inside = True
        for j in range(2):
            if not world.low_rad[j] - 1e-9 <= q[j] <= world.high_rad[j] + 1e-9:
                inside = False
        lattice.spare_cm[node] = pose_spare_cm(world, q) if inside else -inf


@kernel
def pose_of(lattice: JointLattice, node: int) -> tuple[float, float]:
    """Return the joint angles of a node or given pose."""
    size = lattice.columns * lattice.rows
    if node >= size:
        return lattice.given_rad[node - size, 0], lattice.given_rad[node - size, 1]
    column, row = node % lattice.columns, node // lattice.columns
    return (lattice.column + column) * lattice.cell_rad, (lattice.row + row) * lattice.cell_rad


@kernel
def move_cost(world: JointWorld, costs: Costs, a1: float, a2: float, b1: float, b2: float) -> float:
    """Return what the straight move between two poses costs."""
    d1, d2 = b1 - a1, b2 - a2
    cost = 0.0
    if costs.objective == JOINT_TRAVEL:
        cost = hypot(d1, d2)
    elif costs.objective == TIME:
        cost = max(abs(d1) / costs.speeds_rad_s[0], abs(d2) / costs.speeds_rad_s[1]) + TIE_S_PER_RAD * hypot(d1, d2)
    else:
        x0, y0 = tip_of(world, a1, a2)
        for k in range(1, TIP_SAMPLES + 1):
            x1, y1 = tip_of(world, a1 + k * d1 / TIP_SAMPLES, a2 + k * d2 / TIP_SAMPLES)
            cost += hypot(x1 - x0, y1 - y0)
            x0, y0 = x1, y1
    if (a2 < 0.0) != (b2 < 0.0):
        cost += costs.change
    return cost


@kernel
def least_cost(world: JointWorld, costs: Costs, a1: float, a2: float, b1: float, b2: float) -> float:
    """Return a lower bound of any way between two poses: the heuristic, consistent with `move_cost`."""
    if costs.objective != TIP_LENGTH:
        return move_cost(world, costs, a1, a2, b1, b2)
    (x0, y0), (x1, y1) = tip_of(world, a1, a2), tip_of(world, b1, b2)
    return hypot(x1 - x0, y1 - y0) + (costs.change if (a2 < 0.0) != (b2 < 0.0) else 0.0)


@kernel
def tip_of(world: JointWorld, theta1: float, theta2: float) -> tuple[float, float]:
    """Return where the tip is."""
    l1, l2 = world.lengths_cm[0], world.lengths_cm[1]
    x = world.base_x_cm + l1 * cos(theta1) + l2 * cos(theta1 + theta2)
    return x, world.base_y_cm + l1 * sin(theta1) + l2 * sin(theta1 + theta2)


@kernel
def crosses(lines: Floats, a1: float, a2: float, b1: float, b2: float) -> bool:
    """Tell whether a straight move crosses one of some half lines; theta2 = 0 belongs to the positive ones."""
    for k in range(lines.shape[0]):
        theta1 = lines[k, 0]
        if (a1 < theta1) != (b1 < theta1):
            theta2 = a2 + (theta1 - a1) / (b1 - a1) * (b2 - a2)
            if (theta2 < 0.0) == (lines[k, 1] < 0.0):
                return True
    return False


@kernel
def move_is_free(
    world: JointWorld, costs: Costs, a1: float, a2: float, spare_a: float, b1: float, b2: float, spare_b: float
) -> bool:
    """Tell whether a straight move crosses nothing closed and is proved free.

    At once where there is room enough at both ends, else by halving.
    """
    if crosses(costs.closed, a1, a2, b1, b2):
        return False
    half = 0.5 * (abs(b1 - a1) * costs.reach_cm[0] + abs(b2 - a2) * costs.reach_cm[1])
    if spare_a > half + 1e-9 and spare_b > half + 1e-9:
        return True
    piece = np.zeros((1, 4, 2))
    piece[0, 0, 0], piece[0, 0, 1], piece[0, 1, 0], piece[0, 1, 1] = a1, a2, b1 - a1, b2 - a2
    verdict, _ = prove_pieces(world, np.array([0.0, 1.0]), piece)
    return verdict == PROVED


@kernel
def search_joints(world: JointWorld, lattice: JointLattice, costs: Costs, dx: Ints, dy: Ints) -> tuple[Ints, int, int]:
    """Search a cheapest way from any start to any goal.

    Returns:
        (nodes from start to goal, none when there is no way; nodes closed; entries made).
    """
    size, given = lattice.columns * lattice.rows, lattice.given_rad.shape[0]
    before = np.full(size + given, NONE, np.int64)
    g, closed = np.full(size + given, inf), np.zeros(size + given, np.bool_)
    room = 1 << 12
    f_of, g_of, made_from, made_to = np.empty(room), np.empty(room), np.empty(room, np.int64), np.empty(room, np.int64)
    heap, heaped, made, expanded = np.empty(room, np.int64), 0, 0, 0
    next_to = np.empty(dx.shape[0] + (2 * JOIN_CELLS + 1) * (2 * JOIN_CELLS + 1) + given, np.int64)
    for start in range(size + lattice.goals, size + given):
        if lattice.spare_cm[start] > 0.0:
            f_of[made], g_of[made], made_from[made], made_to[made] = 0.0, 0.0, NONE, start
            heap[heaped] = made
            made, heaped = made + 1, heaped + 1  # all with f = 0: a heap in any order
    while heaped > 0:
        entry = heap[0]
        heaped -= 1
        sink(heap, heaped, heap[heaped], f_of)
        node, source = made_to[entry], made_from[entry]
        if closed[node]:
            continue
        q1, q2 = pose_of(lattice, node)
        if source != NONE:
            p1, p2 = pose_of(lattice, source)
            if not move_is_free(world, costs, p1, p2, lattice.spare_cm[source], q1, q2, lattice.spare_cm[node]):
                continue
        closed[node], g[node], before[node] = True, g_of[entry], source
        expanded += 1
        if size <= node < size + lattice.goals:
            return _trace(before, node), expanded, made
        count = _neighbours(lattice, node, dx, dy, next_to)
        if made + count > room:
            f_of, g_of, heap = _twice(f_of), _twice(g_of), _twice_ints(heap)
            made_from, made_to = _twice_ints(made_from), _twice_ints(made_to)
            room *= 2
        for i in range(count):
            to = next_to[i]
            if closed[to] or not lattice.spare_cm[to] > 0.0:
                continue
            t1, t2 = pose_of(lattice, to)
            g_to = g[node] + move_cost(world, costs, q1, q2, t1, t2)
            h = inf
            for goal in range(lattice.goals):
                h = min(h, least_cost(world, costs, t1, t2, lattice.given_rad[goal, 0], lattice.given_rad[goal, 1]))
            f_of[made], g_of[made], made_from[made], made_to[made] = g_to + h, g_to, node, to
            rise(heap, heaped, made, f_of)
            made, heaped = made + 1, heaped + 1
    return np.empty(0, np.int64), expanded, made


@kernel
def _neighbours(lattice: JointLattice, node: int, dx: Ints, dy: Ints, out: Ints) -> int:
    """Put where the moves from a node lead into `out`; return how many. A given pose leads to the nodes around it."""
    size, count = lattice.columns * lattice.rows, 0
    q1, q2 = pose_of(lattice, node)
    if node >= size:
        column = int(np.floor(q1 / lattice.cell_rad + 0.5)) - lattice.column
        row = int(np.floor(q2 / lattice.cell_rad + 0.5)) - lattice.row
        for j in range(row - JOIN_CELLS, row + JOIN_CELLS + 1):
            for i in range(column - JOIN_CELLS, column + JOIN_CELLS + 1):
                if 0 <= i < lattice.columns and 0 <= j < lattice.rows:
                    out[count] = j * lattice.columns + i
                    count += 1
    else:
        column, row = node % lattice.columns, node // lattice.columns
        for k in range(dx.shape[0]):
            i, j = column + dx[k], row + dy[k]
            if 0 <= i < lattice.columns and 0 <= j < lattice.rows:
                out[count] = j * lattice.columns + i
                count += 1
    near = (JOIN_CELLS + 0.5) * lattice.cell_rad
    for goal in range(lattice.goals):
        if abs(lattice.given_rad[goal, 0] - q1) <= near and abs(lattice.given_rad[goal, 1] - q2) <= near:
            out[count] = size + goal
            count += 1
    return count


@kernel
def pull(world: JointWorld, costs: Costs, poses_rad: Floats, spare_cm: Floats) -> Ints:
    """Return which of a way's poses are kept so that it is the cheapest through any of them, in order.

    Dynamic programming over all pairs that a proved straight move joins; the way itself is one of the choices, so the
    result never costs more.
    """
    count = poses_rad.shape[0]
    cost, before = np.full(count, inf), np.full(count, NONE, np.int64)
    cost[0] = 0.0
    for j in range(1, count):
        for i in range(j - 1, -1, -1):
            a1, a2, b1, b2 = poses_rad[i, 0], poses_rad[i, 1], poses_rad[j, 0], poses_rad[j, 1]
            through = cost[i] + move_cost(world, costs, a1, a2, b1, b2)
            if through < cost[j] and (
                i == j - 1 or move_is_free(world, costs, a1, a2, spare_cm[i], b1, b2, spare_cm[j])
            ):
                cost[j], before[j] = through, i
    return _trace(before, count - 1)


@kernel
def _trace(before: Ints, last: int) -> Ints:
    """Return the chain that ends at `last`, from its beginning."""
    count, place = 1, last
    while before[place] != NONE:
        count, place = count + 1, before[place]
    chain, place = np.empty(count, np.int64), last
    for k in range(count - 1, -1, -1):
        chain[k] = place
        place = before[place]
    return chain


@kernel
def _twice(array: Floats) -> Floats:
    larger = np.empty(2 * array.shape[0])
    larger[: array.shape[0]] = array
    return larger


@kernel
def _twice_ints(array: Ints) -> Ints:
    larger = np.empty(2 * array.shape[0], np.int64)
    larger[: array.shape[0]] = array
    return larger
