"""Proofs that the arm stays free while the tip moves straight on.

More is known of such a move than how far the arm may go: what its links sweep (`planarm.workspace.straight_sweep`). A
line is free as a whole when both links' sweeps keep off everything; else it is divided into pieces, found by bisection,
whose sweeps do, or the pose between two of them is the counterexample.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from planarm.model.collision import segment_polygon_distance
from planarm.model.kinematics import ROUNDING_CM
from planarm.workspace.proof import ALL, BLOCKED, PROVED, SMALLEST_CM, UNPROVED, judge_disc, next_piece
from planarm.workspace.straight_sweep import (
    Sweep,
    keeps_off_polygon,
    link1_keeps_off,
    link2_keeps_off,
    lowest,
    sweep_between,
)
from planarm.workspace.world import (
    FREE,
    ArmWorld,
    TwoLinkArm,
    elbow_from_base,
    links_apart2,
    region_at,
    within_limits,
)
from planarm_wire.kernel_cache import bare_kernel, kernel

Floats = NDArray[np.float64]

FEW = 8
"""So many obstacles are looked at for every piece of a line; of more, those that its first piece leaves."""


@kernel
def prove_line(world: ArmWorld, x0: float, y0: float, x1: float, y1: float) -> tuple[int, float]:
    """Judge the straight move of the tip from (x0, y0) to (x1, y1), in cm.

    The tip's least distance from the base on the move is taken exactly, the greatest is at an end.

    Returns:
        (verdict, parameter): PROVED; or BLOCKED with the share of the move, 0 to 1, at which the pose is not free; or
        UNPROVED with the share around which the margin is too small for a proof, or joint 1 comes to the end of its
        limits (at the ends of a full turn no single pose is forbidden, only the way across).
    """
    return prove_line_by(world, x0, y0, x1, y1, SMALLEST_CM)


@kernel
def prove_line_by(world: ArmWorld, x0: float, y0: float, x1: float, y1: float, smallest_cm: float) -> tuple[int, float]:
    """`prove_line` with pieces no shorter than twice this."""
    arm, obstacles = world.arm, world.obstacles
    radii, first_vertex = obstacles.radii_cm, obstacles.first_vertex
    near = np.empty(radii.size, np.int64) if radii.size > FEW else first_vertex
    return prove_pieces(
        arm,
        obstacles.centers_cm,
        radii,
        first_vertex,
        obstacles.vertices_cm,
        near,
        x0 - arm.base_x_cm,
        y0 - arm.base_y_cm,
        x1 - x0,
        y1 - y0,
        smallest_cm,
    )


@bare_kernel
def prove_pieces(
    arm: TwoLinkArm,
    centers_cm: Floats,
    radii_cm: Floats,
    first_vertex: NDArray[np.int64],
    vertices_cm: Floats,
    near: NDArray[np.int64],
    x0: float,
    y0: float,
    dx: float,
    dy: float,
    smallest_cm: float,
) -> tuple[int, float]:
    """`prove_line_by` for the line from (x0, y0), seen from the base, by (dx, dy); the obstacles' arrays one by one.

    `near` is memory for a number for each obstacle; with no more than FEW it is not used.
    """
    length = sqrt(dx * dx + dy * dy)
    ux, uy = (dx / length, dy / length) if length > 0.0 else (1.0, 0.0)
    x1, y1, before = x0 + dx, y0 + dy, -(x0 * ux + y0 * uy)
    if region_at(arm, sqrt(x0 * x0 + y0 * y0)) != FREE:
        return BLOCKED, 0.0
    if region_at(arm, sqrt(x1 * x1 + y1 * y1)) != FREE:
        return BLOCKED, 1.0
    if 0.0 < before < length and region_at(arm, abs(ux * y0 - uy * x0)) != FREE:
        return BLOCKED, before / length
    known, sweep = sweep_between(arm, _pose_at(arm, x0, y0), _pose_at(arm, x1, y1), ux, uy)
    if known and _is_free(arm, centers_cm, radii_cm, first_vertex, vertices_cm, near, ALL, sweep):
        return PROVED, 1.0
    return _divide(
        arm, centers_cm, radii_cm, first_vertex, vertices_cm, near, x0, y0, dx, dy, smallest_cm, sweep, known
    )


@bare_kernel
def _divide(
    arm: TwoLinkArm,
    centers_cm: Floats,
    radii_cm: Floats,
    first_vertex: NDArray[np.int64],
    vertices_cm: Floats,
    near: NDArray[np.int64],
    x0: float,
    y0: float,
    dx: float,
    dy: float,
    smallest_cm: float,
    sweep: Sweep,
    known: bool,
) -> tuple[int, float]:
    """Judge a line piece by piece that could not be proved as a whole; its sweep is given, and whether it is known."""
    length, count = sqrt(dx * dx + dy * dy), ALL
    if known and radii_cm.size > FEW:
        count = _near_obstacles(arm, centers_cm, radii_cm, sweep, near)
    # A pose that only touches can be on no piece that is free: the ends are looked at before the line is divided.
    for share in (0.0, 1.0):
        x, y = x0 + share * dx, y0 + share * dy
        verdict = judge_disc(arm, centers_cm, radii_cm, first_vertex, vertices_cm, near, count, x, y, 0.0)
        if verdict != PROVED:
            return verdict, share
    ux, uy = sweep.ux, sweep.uy
    start, width, free = 0.0, 1.0, False
    left = right = _pose_at(arm, x0, y0)
    while True:
        if free:
            start, width = next_piece(start, width)
            if start >= 1.0:
                return PROVED, 1.0
            left = right
        elif 0.5 * width * length <= smallest_cm:
            return UNPROVED, start + 0.5 * width
        else:
            width *= 0.5
            middle = start + width
            x, y = x0 + middle * dx, y0 + middle * dy
            verdict = judge_disc(arm, centers_cm, radii_cm, first_vertex, vertices_cm, near, count, x, y, 0.0)
            if verdict != PROVED:
                return verdict, middle
        end = start + width
        right = _pose_at(arm, x0 + end * dx, y0 + end * dy)
        known, sweep = sweep_between(arm, left, right, ux, uy)
        free = known and _is_free(arm, centers_cm, radii_cm, first_vertex, vertices_cm, near, count, sweep)


@bare_kernel
def _pose_at(arm: TwoLinkArm, x: float, y: float) -> tuple[float, float, float, float]:
    """Return elbow and tip (ex, ey, x, y) seen from the base."""
    r2 = x * x + y * y
    ex, ey = elbow_from_base(arm, x, y, r2, sqrt(r2))
    return ex, ey, x, y


@bare_kernel
def _is_free(
    arm: TwoLinkArm,
    centers_cm: Floats,
    radii_cm: Floats,
    first_vertex: NDArray[np.int64],
    vertices_cm: Floats,
    near: NDArray[np.int64],
    count: int,
    sweep: Sweep,
) -> bool:
    """Tell whether limits, floor and obstacles are shown to be kept off on a whole piece; `count` as for `_verdict`."""
    bx, by, margin, moves = arm.base_x_cm, arm.base_y_cm, arm.margin_cm, sweep.moves_cm + ROUNDING_CM
    ex, ey, x, y = sweep.eax, sweep.eay, sweep.xa, sweep.ya
    if arm.floor and by + lowest(sweep) <= margin + ROUNDING_CM:
        return False
    if not within_limits(arm, bx + ex, by + ey, moves):
        return False
    for k in range(radii_cm.size if count == ALL else count):
        i = k if count == ALL else near[k]
        cx, cy, keep = centers_cm[i, 0] - bx, centers_cm[i, 1] - by, radii_cm[i] + margin
        if links_apart2(cx, cy, ex, ey, x, y, arm.per_l1, arm.per_l2) > (keep + moves) * (keep + moves):
            continue
        first, end = first_vertex[i], first_vertex[i + 1]
        clear1, clear2 = link1_keeps_off(arm, sweep, cx, cy, keep), link2_keeps_off(arm, sweep, cx, cy, keep)
        if clear1 and clear2:
            continue
        if first == end:
            return False
        if (clear1 or keeps_off_polygon(arm, sweep, 1, vertices_cm, first, end, margin)) and (
            clear2 or keeps_off_polygon(arm, sweep, 2, vertices_cm, first, end, margin)
        ):
            continue
        apart = min(
            segment_polygon_distance(bx, by, bx + ex, by + ey, vertices_cm, first, end),
            segment_polygon_distance(bx + ex, by + ey, bx + x, by + y, vertices_cm, first, end),
        )
        if apart <= margin + moves:
            return False
    return True


@bare_kernel
def _near_obstacles(
    arm: TwoLinkArm, centers_cm: Floats, radii_cm: Floats, sweep: Sweep, near: NDArray[np.int64]
) -> int:
    """Fill `near` with the obstacles that the arm may touch on a piece; return how many."""
    reach = sweep.moves_cm + ROUNDING_CM + arm.margin_cm
    count = 0
    for i in range(radii_cm.size):
        cx, cy, keep = centers_cm[i, 0] - arm.base_x_cm, centers_cm[i, 1] - arm.base_y_cm, radii_cm[i] + reach
        apart2 = links_apart2(cx, cy, sweep.eax, sweep.eay, sweep.xa, sweep.ya, arm.per_l1, arm.per_l2)
        if apart2 <= keep * keep:
            near[count] = i
            count += 1
    return count
