"""Classify the cells of a map, large blocks at once.

A block of cells is judged by the disc around it: while the tip stays in it no point of the arm moves farther than the
bound of `planarm.workspace.proof`. Obstacles farther off than that, seen from the pose at its centre, are forgotten for
the whole block; with none left it is free as a whole, with one that stays too near it is blocked as a whole. What
cannot be settled is divided into four, down to small blocks, whose cells are judged one by one against the few
obstacles left. So the work grows with the border between free and blocked, and a thousand obstacles cost little more
than ten.
"""

from math import acos, inf, sqrt

import numpy as np
from numpy.typing import NDArray

from planarm.model.collision import point_segment_distance2, segment_polygon_distance
from planarm.model.kinematics import ROUNDING_CM
from planarm.workspace.proof import disc_within_reach, displacement_bound
from planarm.workspace.world import (
    BEYOND_REACH,
    FREE,
    INNER_HOLE,
    LIMIT,
    OBSTACLE,
    SINGULAR_CM,
    ArmWorld,
    TwoLinkArm,
    cos_beta_at,
    elbow_at,
    floor_clearance,
    links_apart2,
    region_at,
    theta1_at,
    within_limits,
)
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAF_CELLS = 8
"""Blocks of so many rows and columns are judged cell by cell: found by measurement."""

LARGEST_BLOCK = 256

MOST_CELLS = LEAF_CELLS * LEAF_CELLS
WORK_ROWS = 8
X, Y, R, EX, EY, MOVES, BESIDE, SPARE = range(0, WORK_ROWS * MOST_CELLS, MOST_CELLS)
"""Where the cells' values begin in one array: tip, its distance and elbow, seen from the base; the bound of how far the
arm moves within the cell; what the nearest obstacle leaves of the margin, without that bound and with it, in places of
squares: above 0 or not. In one array at fixed distances the compiler sees that they do not overlap and takes four cells
at once.
"""

MIXED_BLOCK = 255
"""Stands for a block's region where its cells differ, or might."""


@kernel
def fill(
    world: ArmWorld, x_cm: Floats, y_cm: Floats, cell_cm: float, region: NDArray[np.uint8], whole: NDArray[np.bool_]
) -> None:
    """Fill `region` and `whole`, both [iy, ix], for the nodes at `x_cm` and `y_cm`; no `whole` that has no rows."""
    rows, columns = region.shape
    obstacles = world.obstacles.radii_cm.size
    block = LEAF_CELLS
    while block < LARGEST_BLOCK and block < max(rows, columns):
        block *= 2
    near = np.empty(12 * (obstacles + 1), np.int64)
    stack = np.empty((64, 4), np.int64)
    work = np.empty(WORK_ROWS * MOST_CELLS)
    for top in range(0, rows, block):
        for left in range(0, columns, block):
            for i in range(obstacles):
                near[i] = i
            stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = top, left, block, 0
            _fill_block(world, x_cm, y_cm, cell_cm, region, whole, stack, near, obstacles, work)


@kernel
def _fill_block(
    world: ArmWorld,
    x_cm: Floats,
    y_cm: Floats,
    cell_cm: float,
    region: NDArray[np.uint8],
    whole: NDArray[np.bool_],
    stack: Ints,
    near: Ints,
    obstacles: int,
    work: Floats,
) -> None:
    """Divide and judge the block on the stack: rows (iy, ix, size, place of its list of obstacles in `near`).

    A list ends where its length was noted: `counts` by its place's level. Lists of finer blocks lie behind those of the
    blocks that hold them.
    """
    rows, columns = region.shape
    ends = np.zeros(64, np.int64)
    depth, ends[0] = 1, obstacles
    while depth > 0:
        depth -= 1
        iy, ix, size, first = stack[depth, 0], stack[depth, 1], stack[depth, 2], stack[depth, 3]
        end = ends[depth]
        bottom, right = min(iy + size, rows), min(ix + size, columns)
        if bottom <= iy or right <= ix:
            continue
        x, y = 0.5 * (x_cm[ix] + x_cm[right - 1]), 0.5 * (y_cm[iy] + y_cm[bottom - 1])
        dx, dy = 0.5 * (x_cm[right - 1] - x_cm[ix] + cell_cm), 0.5 * (y_cm[bottom - 1] - y_cm[iy] + cell_cm)
        verdict, no_limit, kept = judge_block(world, x, y, sqrt(dx * dx + dy * dy), near, first, end)
        if verdict != MIXED_BLOCK:
            for y_at in range(iy, bottom):  # a slice takes Numba seconds to compile
                for x_at in range(ix, right):
                    region[y_at, x_at] = verdict
                    if whole.size > 0:
                        whole[y_at, x_at] = verdict == FREE
        elif size <= LEAF_CELLS:
            _fill_cells(
                world, x_cm, y_cm, cell_cm, region, whole, iy, bottom, ix, right, near[end:kept], no_limit, work
            )
        else:
            half = size // 2
            for i in range(4):
                stack[depth, 0], stack[depth, 1] = iy + (i >> 1) * half, ix + (i & 1) * half
                stack[depth, 2], stack[depth, 3] = half, end
                ends[depth] = kept
                depth += 1


@kernel
def judge_block(
    world: ArmWorld, x_cm: float, y_cm: float, rho_cm: float, near: Ints, first: int, end: int
) -> tuple[int, bool, int]:
    """Judge all poses with the tip in a disc, given the obstacles near[first:end] that may matter.

    Returns:
        (region of all of them or MIXED_BLOCK, whether no limit or floor is met, end of the list of the obstacles that
        still matter): that list begins at `end`.
    """
    arm = world.arm
    dx, dy = x_cm - arm.base_x_cm, y_cm - arm.base_y_cm
    r = sqrt(dx * dx + dy * dy)
    if r - rho_cm > arm.reach_cm + ROUNDING_CM:
        return BEYOND_REACH, True, end
    if r + rho_cm < arm.r_min_cm - ROUNDING_CM:
        return INNER_HOLE, True, end
    if not disc_within_reach(arm, r, rho_cm):
        for i in range(first, end):
            near[end + i - first] = near[i]
        return MIXED_BLOCK, False, end + end - first
    ex, ey = elbow_at(arm, x_cm, y_cm, r)
    displacement = displacement_bound(arm, r, rho_cm) + ROUNDING_CM
    no_limit = within_limits(arm, ex, ey, displacement)
    no_limit = no_limit and floor_clearance(arm, ey, y_cm) > arm.margin_cm + displacement
    kept, blocked = end, False
    for i in range(first, end):
        distance = _clearance(world, near[i], ex, ey, x_cm, y_cm, arm.margin_cm + displacement)
        if distance <= arm.margin_cm + displacement:
            near[kept] = near[i]
            kept += 1
            blocked = blocked or distance + displacement <= arm.margin_cm
    if no_limit and blocked:
        return OBSTACLE, True, kept
    return FREE if no_limit and kept == end else MIXED_BLOCK, no_limit, kept


@kernel
def _clearance(world: ArmWorld, i: int, ex: float, ey: float, x: float, y: float, enough_cm: float) -> float:
    """Return the distance in cm of obstacle i to the links, negative inside a circle; a lower one above `enough_cm`."""
    arm, obstacles = world.arm, world.obstacles
    cx, cy, radius = obstacles.centers_cm[i, 0], obstacles.centers_cm[i, 1], obstacles.radii_cm[i]
    bx, by = arm.base_x_cm, arm.base_y_cm
    distance = sqrt(min(point_segment_distance2(cx, cy, bx, by, ex, ey), point_segment_distance2(cx, cy, ex, ey, x, y)))
    first, end = obstacles.first_vertex[i], obstacles.first_vertex[i + 1]
    if first == end or distance - radius > enough_cm:
        return float(distance - radius)
    to_link1 = segment_polygon_distance(bx, by, ex, ey, obstacles.vertices_cm, first, end)
    to_link2 = segment_polygon_distance(ex, ey, x, y, obstacles.vertices_cm, first, end)
    return to_link1 if to_link1 < to_link2 else to_link2


@kernel
def _fill_cells(
    world: ArmWorld,
    x_cm: Floats,
    y_cm: Floats,
    cell_cm: float,
    region: NDArray[np.uint8],
    whole: NDArray[np.bool_],
    top: int,
    bottom: int,
    left: int,
    right: int,
    near: Ints,
    no_limit: bool,
    work: Floats,
) -> None:
    """Judge the cells of a small block; `work` has WORK_ROWS * MOST_CELLS places."""
    arm, obstacles = world.arm, world.obstacles
    columns = right - left
    cells = columns * (bottom - top)
    _pose_cells(arm, x_cm[left:right], y_cm[top:bottom], work)
    proving = whole.size > 0
    rho = 0.5 * sqrt(2.0) * cell_cm
    if proving:
        for c in range(cells):
            r = work[R + c]
            inside = region_at(arm, r) == FREE and rho < r and disc_within_reach(arm, r, rho)
            work[MOVES + c] = displacement_bound(arm, r, rho) + ROUNDING_CM if inside else inf
    for i in near:
        cx, cy = obstacles.centers_cm[i, 0] - arm.base_x_cm, obstacles.centers_cm[i, 1] - arm.base_y_cm
        keep = obstacles.radii_cm[i] + arm.margin_cm
        if obstacles.first_vertex[i] == obstacles.first_vertex[i + 1]:
            _keep_off_circle(arm, cx, cy, keep, cells, proving, work)
            continue
        for c in range(cells):
            ex, ey, x, y, moves = work[EX + c], work[EY + c], work[X + c], work[Y + c], work[MOVES + c]
            bound = keep + moves if proving else keep
            if region_at(arm, work[R + c]) != FREE or (
                links_apart2(cx, cy, ex, ey, x, y, arm.per_l1, arm.per_l2) > bound * bound
            ):
                continue
            bx, by, margin = arm.base_x_cm, arm.base_y_cm, arm.margin_cm
            apart = _clearance(world, i, ex + bx, ey + by, x + bx, y + by, margin + (moves if proving else 0.0))
            work[BESIDE + c] = min(work[BESIDE + c], apart - margin)
            work[SPARE + c] = min(work[SPARE + c], apart - margin - moves)
    limited = not no_limit or arm.floor
    for iy in range(top, bottom):
        first = (iy - top) * columns - left
        for ix in range(left, right):
            c = first + ix
            node = region_at(arm, work[R + c])
            free = proving and node == FREE and work[MOVES + c] < inf and work[SPARE + c] > 0.0
            if node == FREE and limited:
                moves = work[MOVES + c] if free else 0.0
                bounded, within = _limits(arm, work, c, moves, no_limit)
                free = free and bounded
                node = node if within else LIMIT
            if node == FREE and work[BESIDE + c] <= 0.0:
                node = OBSTACLE
            region[iy, ix] = node
            if proving:
                whole[iy, ix] = free and node == FREE


@kernel
def _pose_cells(arm: TwoLinkArm, x_cm: Floats, y_cm: Floats, work: Floats) -> None:
    """Fill in, for the cells row by row, tip, its distance and elbow, seen from the base, and that nothing is near."""
    # As elbow_from_base in world.py, to the last bit: whoever proves a move from a node has to see the node's pose.
    l1, l2, side, columns = arm.l1_cm, arm.l2_cm, arm.side, x_cm.size
    for row in range(y_cm.size):
        first, y = row * columns, y_cm[row] - arm.base_y_cm
        for ix in range(columns):
            x = x_cm[ix] - arm.base_x_cm
            c = first + ix
            r2 = x * x + y * y
            r = sqrt(r2)
            per_r = 1.0 / max(r, SINGULAR_CM)
            along = min(l1, max(-l1, 0.5 * (r2 + l1 * l1 - l2 * l2) * per_r))
            aside = side * sqrt(l1 * l1 - along * along)
            work[X + c], work[Y + c], work[R + c] = x, y, r
            work[EX + c], work[EY + c] = per_r * (x * along - y * aside), per_r * (y * along + x * aside)
            work[BESIDE + c], work[SPARE + c] = inf, inf


@kernel
def _keep_off_circle(
    arm: TwoLinkArm, cx: float, cy: float, keep_cm: float, cells: int, proving: bool, work: Floats
) -> None:
    """Note how a circle's distance from the links compares with `keep_cm`, and with that and the cell's moves."""
    per_l1, per_l2 = arm.per_l1, arm.per_l2
    if proving:
        for c in range(cells):
            apart2 = links_apart2(cx, cy, work[EX + c], work[EY + c], work[X + c], work[Y + c], per_l1, per_l2)
            bound = keep_cm + work[MOVES + c]
            work[BESIDE + c] = min(work[BESIDE + c], apart2 - keep_cm * keep_cm)
            work[SPARE + c] = min(work[SPARE + c], apart2 - bound * bound)
    else:
        for c in range(cells):
            apart2 = links_apart2(cx, cy, work[EX + c], work[EY + c], work[X + c], work[Y + c], per_l1, per_l2)
            work[BESIDE + c] = min(work[BESIDE + c], apart2 - keep_cm * keep_cm)


@kernel
def _limits(arm: TwoLinkArm, work: Floats, c: int, moves_cm: float, no_limit: bool) -> tuple[bool, bool]:
    """Tell whether limits of joint 1 and floor are kept by all poses of a cell, and whether by the one at its node."""
    bx, by = arm.base_x_cm, arm.base_y_cm
    ex, ey, x, y = work[EX + c], work[EY + c], work[X + c], work[Y + c]
    bounded, within = True, True
    if not no_limit and not within_limits(arm, ex + bx, ey + by, moves_cm):
        theta1 = theta1_at(arm, x + bx, y + by, acos(cos_beta_at(arm, work[R + c])))
        bounded, within = False, arm.theta1_min_rad <= theta1 <= arm.theta1_max_rad
    height = floor_clearance(arm, ey + by, y + by)
    return bounded and height > arm.margin_cm + moves_cm, within and height > arm.margin_cm
