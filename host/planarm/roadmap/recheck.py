"""Moves against one new obstacle: the judgement of `moves`, with what does not concern one obstacle left out.

A configuration that the obstacle touches blocks all its moves, and where links stand at configurations is known: so
most moves that are blocked cost a look at their ends. Most that are not cost no more. With its heading turning by w_k
while the move goes from 0 to 1, a point of link k has an acceleration of at most sum(l_i w_i^2) over the links up to k,
so it leaves the straight line between where it is at the two ends by at most an eighth of that; and those lines lie in
the hull of the link's four end points. What cannot be told by that is halved, among polygons as in
`moves.move_is_free`.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from planarm.model.collision import cross, point_segment_distance2, segment_polygon_distance
from planarm.model.kinematics import ROUNDING_CM
from planarm.model.shapes import ObstacleSet
from planarm.roadmap.moves import fill_full
from planarm.workspace.joint_proof import SMALLEST_CM, JointWorld, link_ends
from planarm.workspace.proof import next_piece
from planarm_wire.kernel_cache import bare_kernel, kernel

MOST_HALVINGS = 20
"""Of a move before it counts as touched: it then comes within a millionth of its sag."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel
def all_ends_cm(world: JointWorld, poses_rad: Floats) -> NDArray[np.float64]:
    """Return where the links of each configuration begin and end, shape (n, joints + 1, 2)."""
    out = np.empty((poses_rad.shape[0], poses_rad.shape[1] + 1, 2))
    for i in range(poses_rad.shape[0]):
        link_ends(world, poses_rad[i], out[i])
    return out


@kernel
def touched_moves(
    world: JointWorld,
    obstacle: ObstacleSet,
    margin_cm: float,
    poses_rad: Floats,
    ends_cm: Floats,
    pairs: Ints,
    which: Ints,
) -> NDArray[np.int64]:
    """Return those of the moves `which`, shape (k,), that cannot be proved clear of an obstacle by the margin.

    Args:
        world: the arm; its own obstacles are not looked at.
        obstacle: one obstacle.
        margin_cm: to keep from the links' centre lines.
        poses_rad: configurations, shape (n, joints).
        ends_cm: `all_ends_cm` of them.
        pairs: of configurations, shape (m, 2).
        which: the moves to look at.
    """
    joints, found = poses_rad.shape[1], 0
    lengths = world.lengths_cm
    x, y, radius = obstacle.centers_cm[0, 0], obstacle.centers_cm[0, 1], obstacle.radii_cm[0]
    vertices = obstacle.vertices_cm
    out, apart = np.empty(which.shape[0], np.int64), np.full(poses_rad.shape[0], -1.0)
    full, ends = np.empty(joints), np.empty((2 + MOST_HALVINGS, joints + 1, 2))
    ends[:, 0, 0], ends[:, 0, 1] = world.base_x_cm, world.base_y_cm
    until = np.empty(1 + MOST_HALVINGS)
    for k in range(which.shape[0]):
        i, j = pairs[which[k], 0], pairs[which[k], 1]
        if apart[i] < 0.0:
            apart[i] = chain_distance(ends_cm[i], x, y, radius, vertices, margin_cm)
        touched = apart[i] <= margin_cm
        if not touched:
            if apart[j] < 0.0:
                apart[j] = chain_distance(ends_cm[j], x, y, radius, vertices, margin_cm)
            touched = apart[j] <= margin_cm
        if not touched and not _sweeps_clear(
            lengths, poses_rad[i], poses_rad[j], 1.0, ends_cm[i], ends_cm[j], x, y, radius + margin_cm
        ):
            a, b = poses_rad[i], poses_rad[j]
            if vertices.shape[0] == 0:
                ends[0], ends[1] = ends_cm[i], ends_cm[j]
                touched = not _keeps_clear(lengths, a, b, until, ends, x, y, radius + margin_cm)
            else:
                fill_full(lengths, a, b, full)
                touched = not _is_clear(lengths, a, b, full, ends[0], x, y, radius, vertices, margin_cm)
        if touched:
            out[found] = which[k]
            found += 1
    return out[:found].copy()


@kernel
def first_contact(
    world: JointWorld, obstacle: ObstacleSet, margin_cm: float, poses_rad: Floats, sway_cm: Floats
) -> int:
    """Return the first of poses, shape (m, n), at which a link may be as near as the margin to an obstacle, or -1.

    `sway_cm`, shape (m,), is how far any point of the arm may be from where the pose has it.
    """
    ends = np.empty((poses_rad.shape[1] + 1, 2))
    x, y, radius = obstacle.centers_cm[0, 0], obstacle.centers_cm[0, 1], obstacle.radii_cm[0]
    for i in range(poses_rad.shape[0]):
        link_ends(world, poses_rad[i], ends)
        enough = margin_cm + sway_cm[i]
        if chain_distance(ends, x, y, radius, obstacle.vertices_cm, enough) <= enough:
            return i
    return -1


@bare_kernel
def _keeps_clear(
    lengths: Floats, a: Floats, b: Floats, until: Floats, ends: Floats, x: float, y: float, distance: float
) -> bool:
    """Tell whether the straight move from a to b is proved to keep farther than that from a point.

    Pieces whose hull is not far enough are halved: the sag falls with the square of a piece's share, so few are. Room
    to work in: `until`, shape (1 + MOST_HALVINGS,), and `ends`, shape (2 + MOST_HALVINGS, joints + 1, 2), which holds
    the links' ends at a, then at b.
    """
    joints, at, depth = a.shape[0], 0.0, 0
    until[0] = 1.0
    while depth >= 0:
        left, right = ends[0], ends[1 + depth]
        if _sweeps_clear(lengths, a, b, until[depth] - at, left, right, x, y, distance):
            at = until[depth]
            for k in range(1, joints + 1):
                left[k, 0], left[k, 1] = right[k, 0], right[k, 1]
            depth -= 1
            continue
        if depth == MOST_HALVINGS:
            return False
        middle, heading = 0.5 * (at + until[depth]), 0.0
        depth += 1
        until[depth], between = middle, ends[1 + depth]
        for k in range(joints):
            heading += a[k] + middle * (b[k] - a[k])
            between[k + 1, 0] = between[k, 0] + lengths[k] * np.cos(heading)
            between[k + 1, 1] = between[k, 1] + lengths[k] * np.sin(heading)
            ax, ay, bx, by = between[k, 0], between[k, 1], between[k + 1, 0], between[k + 1, 1]
            if point_segment_distance2(x, y, ax, ay, bx, by) <= distance * distance:
                return False
    return True


@bare_kernel
def _is_clear(
    lengths: Floats,
    a: Floats,
    b: Floats,
    full: Floats,
    ends: Floats,
    x: float,
    y: float,
    radius: float,
    vertices: Floats,
    margin: float,
) -> bool:
    """Tell whether the straight move from a to b is proved clear; `ends`, room to work in, begins with the base."""
    joints = a.shape[0]
    start, width = 0.0, 1.0
    while start < 1.0:
        middle, heading = start + 0.5 * width, 0.0
        for k in range(joints):
            heading += a[k] + middle * (b[k] - a[k])
            ends[k + 1, 0] = ends[k, 0] + lengths[k] * np.cos(heading)
            ends[k + 1, 1] = ends[k, 1] + lengths[k] * np.sin(heading)
        proved = True
        for k in range(joints):
            wanted = margin + width * full[k] + ROUNDING_CM
            apart = link_distance(ends, k, x, y, radius, vertices, wanted)
            if apart <= margin:
                return False
            proved = proved and apart >= wanted
        if proved:
            start, width = next_piece(start, width)
        elif width * full[joints - 1] <= SMALLEST_CM:
            return False
        else:
            width *= 0.5
    return True


@bare_kernel
def _sweeps_clear(
    lengths: Floats,
    a: Floats,
    b: Floats,
    share: float,
    a_ends: Floats,
    b_ends: Floats,
    x: float,
    y: float,
    distance: float,
) -> bool:
    """Tell whether a share of a move from a to b, between links with these ends, surely keeps farther from a point."""
    turned, sag = 0.0, 0.0
    for k in range(a.shape[0]):
        turned += share * (b[k] - a[k])
        sag += 0.125 * lengths[k] * turned * turned
        if not _hull_is_far(a_ends, b_ends, k, x, y, distance + sag + ROUNDING_CM):
            return False
    return True


@bare_kernel
def _hull_is_far(a_ends: Floats, b_ends: Floats, k: int, x: float, y: float, distance: float) -> bool:
    """Tell whether a point is farther than that from the convex hull of link k's ends at both ends of a move."""
    ax, ay, bx, by = a_ends[k, 0], a_ends[k, 1], a_ends[k + 1, 0], a_ends[k + 1, 1]
    cx, cy, dx, dy = b_ends[k, 0], b_ends[k, 1], b_ends[k + 1, 0], b_ends[k + 1, 1]
    # Most often a line across the way from the point to the hull's middle parts them.
    ux, uy = ax + bx + cx + dx - 4.0 * x, ay + by + cy + dy - 4.0 * y
    nearest = min(ux * (ax - x) + uy * (ay - y), ux * (bx - x) + uy * (by - y))
    nearest = min(nearest, ux * (cx - x) + uy * (cy - y), ux * (dx - x) + uy * (dy - y))
    if nearest > 0.0 and nearest * nearest > distance * distance * (ux * ux + uy * uy):
        return True
    least = min(
        point_segment_distance2(x, y, ax, ay, bx, by),
        point_segment_distance2(x, y, cx, cy, dx, dy),
        point_segment_distance2(x, y, ax, ay, cx, cy),
        point_segment_distance2(x, y, bx, by, dx, dy),
        point_segment_distance2(x, y, ax, ay, dx, dy),
        point_segment_distance2(x, y, bx, by, cx, cy),
    )
    # The hull is the union of two of these triangles, whichever way its corners go round.
    return least > distance * distance and not (
        _is_inside(x, y, ax, ay, bx, by, cx, cy)
        or _is_inside(x, y, ax, ay, bx, by, dx, dy)
        or _is_inside(x, y, ax, ay, cx, cy, dx, dy)
        or _is_inside(x, y, bx, by, cx, cy, dx, dy)
    )


@bare_kernel
def _is_inside(x: float, y: float, ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> bool:
    """Tell whether a point lies in a triangle."""
    ab, bc = cross(bx - ax, by - ay, x - ax, y - ay), cross(cx - bx, cy - by, x - bx, y - by)
    ca = cross(ax - cx, ay - cy, x - cx, y - cy)
    return (ab >= 0.0 and bc >= 0.0 and ca >= 0.0) or (ab <= 0.0 and bc <= 0.0 and ca <= 0.0)


@bare_kernel
def chain_distance(ends: Floats, x: float, y: float, radius: float, vertices: Floats, enough: float) -> float:
    """Return the least distance of any link from the obstacle; one larger than `enough` may be told too small."""
    least = np.inf
    for k in range(ends.shape[0] - 1):
        least = min(least, link_distance(ends, k, x, y, radius, vertices, enough))
    return least


@bare_kernel
def link_distance(ends: Floats, k: int, x: float, y: float, radius: float, vertices: Floats, enough: float) -> float:
    """Return link k's distance from the obstacle, or that from its bounding circle where it is larger than `enough`."""
    ax, ay, bx, by = ends[k, 0], ends[k, 1], ends[k + 1, 0], ends[k + 1, 1]
    apart = sqrt(point_segment_distance2(x, y, ax, ay, bx, by)) - radius
    if vertices.shape[0] == 0 or apart > enough:
        return max(0.0, apart)
    return float(segment_polygon_distance(ax, ay, bx, by, vertices, 0, vertices.shape[0]))
