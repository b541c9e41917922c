"""Moves against one new obstacle: the judgement of `moves`, with what does not concern one obstacle left out.

A configuration that the obstacle touches blocks all its moves, and where links stand at configurations is known: so
most moves that are blocked cost a look at their ends. The others are halved as in `moves.move_is_free`.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from planarm.model.collision import point_segment_distance2, segment_polygon_distance
from planarm.model.kinematics import ROUNDING_CM
from planarm.model.shapes import ObstacleSet
from planarm.roadmap.moves import fill_full
from planarm.workspace.joint_proof import SMALLEST_CM, JointWorld, link_ends
from planarm.workspace.proof import next_piece
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNSEEN, CLEAR, TOUCHED = 0, 1, 2


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
    out, seen = np.empty(which.shape[0], np.int64), np.zeros(poses_rad.shape[0], np.int8)
    full, ends = np.empty(joints), np.empty((joints + 1, 2))
    ends[0, 0], ends[0, 1] = world.base_x_cm, world.base_y_cm
    for k in range(which.shape[0]):
        i, j = pairs[which[k], 0], pairs[which[k], 1]
        for node in (i, j):
            if seen[node] == UNSEEN:
                apart = chain_distance(ends_cm[node], x, y, radius, vertices, margin_cm)
                seen[node] = TOUCHED if apart <= margin_cm else CLEAR
        touched = seen[i] == TOUCHED or seen[j] == TOUCHED
        if not touched:
            fill_full(lengths, poses_rad[i], poses_rad[j], full)
            touched = not _is_clear(lengths, poses_rad[i], poses_rad[j], full, ends, x, y, radius, vertices, margin_cm)
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


@kernel
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


@kernel
def chain_distance(ends: Floats, x: float, y: float, radius: float, vertices: Floats, enough: float) -> float:
    """Return the least distance of any link from the obstacle; one larger than `enough` may be told too small."""
    least = np.inf
    for k in range(ends.shape[0] - 1):
        least = min(least, link_distance(ends, k, x, y, radius, vertices, enough))
    return least


@kernel
def link_distance(ends: Floats, k: int, x: float, y: float, radius: float, vertices: Floats, enough: float) -> float:
    """Return link k's distance from the obstacle, or that from its bounding circle where it is larger than `enough`."""
    ax, ay, bx, by = ends[k, 0], ends[k, 1], ends[k + 1, 0], ends[k + 1, 1]
    apart = sqrt(point_segment_distance2(x, y, ax, ay, bx, by)) - radius
    if vertices.shape[0] == 0 or apart > enough:
        return max(0.0, apart)
    return float(segment_polygon_distance(ax, ay, bx, by, vertices, 0, vertices.shape[0]))
