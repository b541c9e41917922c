"""Distances between links and obstacles.

A link is the segment between two joints, an obstacle is filled: the distance is 0 when they touch, cross, or when the
segment lies inside. Lengths are centimetres. The kernels work for any number of links; a link's width is the
caller's margin.
"""

from math import inf, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.shapes import ObstacleSet
from planarm_wire.kernel_cache import bare_kernel as kernel


def pose_clearance_cm(arm: Arm, q_rad: ArrayLike, obstacles: ObstacleSet) -> float:
    """Return the least distance in cm from any link's centre line to any obstacle, for angles of shape (n,).

    Infinite when there are no obstacles.
    """
    clearance_cm, _ = chain_clearance(forward(arm, q_rad), obstacles)
    return float(clearance_cm)


@kernel
def chain_clearance(joints_cm: NDArray[np.float64], obstacles: ObstacleSet) -> tuple[float, int]:
    """Return (distance, index) of the obstacle nearest to the links between joints of shape (n + 1, 2).

    (inf, -1) when there are no obstacles.
    """
    best, nearest = inf, -1
    for i in range(joints_cm.shape[0] - 1):
        distance, index = segment_clearance(
            joints_cm[i, 0], joints_cm[i, 1], joints_cm[i + 1, 0], joints_cm[i + 1, 1], obstacles, best
        )
        if distance < best:
            best, nearest = distance, index
    return best, nearest


@kernel
def segment_clearance(
    ax: float, ay: float, bx: float, by: float, obstacles: ObstacleSet, best: float
) -> tuple[float, int]:
    """Return (distance in cm, index) of the obstacle nearest to ab, or (best, -1) when none is nearer than `best`."""
    return two_link_clearance(ax, ay, bx, by, bx, by, obstacles, best)


@kernel
def two_link_clearance(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, obstacles: ObstacleSet, best: float
) -> tuple[float, int]:
    """Return (distance in cm, index) of the obstacle nearest to ab and bc, or (best, -1) when none is nearer.

    An obstacle whose bounding circle is not nearer than the best so far is passed over.
    """
    # Each array is taken out of the tuple once: Numba counts a reference every time.
    centers, radii = obstacles.centers_cm, obstacles.radii_cm
    first_vertex, vertices = obstacles.first_vertex, obstacles.vertices_cm
    nearest = -1
    for i in range(radii.shape[0]):
        x, y, radius = centers[i, 0], centers[i, 1], radii[i]
        to_center2 = min(point_segment_distance2(x, y, ax, ay, bx, by), point_segment_distance2(x, y, bx, by, cx, cy))
        if to_center2 >= (best + radius) * (best + radius):
            continue
        first, end = first_vertex[i], first_vertex[i + 1]
        if first == end:
            distance = max(0.0, sqrt(to_center2) - radius)
        else:
            distance = min(
                segment_polygon_distance(ax, ay, bx, by, vertices, first, end),
                segment_polygon_distance(bx, by, cx, cy, vertices, first, end),
            )
        if distance < best:
            best, nearest = distance, i
    return best, nearest


@kernel
def segment_polygon_distance(
    ax: float, ay: float, bx: float, by: float, vertices_cm: NDArray[np.float64], first: int, end: int
) -> float:
    """Return the distance in cm from segment ab to the filled polygon with the vertices first .. end - 1.

    Either an edge is touched or crossed, or a lies inside, or the nearest edge tells: true of any simple polygon.
    """
    best2 = inf
    inside = False
    px, py = vertices_cm[end - 1, 0], vertices_cm[end - 1, 1]
    for k in range(first, end):
        qx, qy = vertices_cm[k, 0], vertices_cm[k, 1]
        best2 = min(best2, segment_distance2(ax, ay, bx, by, px, py, qx, qy))
        # Even-odd rule: the ray from a towards +x changes sides where an edge passes its height.
        if (py > ay) != (qy > ay) and ax < px + (ay - py) / (qy - py) * (qx - px):
            inside = not inside
        px, py = qx, qy
    return 0.0 if inside else sqrt(best2)


@kernel
def segment_distance2(ax: float, ay: float, bx: float, by: float, px: float, py: float, qx: float, qy: float) -> float:
    """Return the squared distance in cm^2 between the segments ab and pq, 0 when they cross or touch.

    Segments cross when each has its ends on both sides of the other. Segments of one line can seem to by rounding;
    their boxes tell them apart.
    """
    boxes_meet = (
        max(ax, bx) >= min(px, qx)
        and max(px, qx) >= min(ax, bx)
        and max(ay, by) >= min(py, qy)
        and max(py, qy) >= min(ay, by)
    )
    if boxes_meet:
        p_left = cross(bx - ax, by - ay, px - ax, py - ay) > 0.0
        q_left = cross(bx - ax, by - ay, qx - ax, qy - ay) > 0.0
        a_left = cross(qx - px, qy - py, ax - px, ay - py) > 0.0
        b_left = cross(qx - px, qy - py, bx - px, by - py) > 0.0
        if p_left != q_left and a_left != b_left:
            return 0.0
    return min(
        point_segment_distance2(ax, ay, px, py, qx, qy),
        point_segment_distance2(bx, by, px, py, qx, qy),
        point_segment_distance2(px, py, ax, ay, bx, by),
        point_segment_distance2(qx, qy, ax, ay, bx, by),
    )


@kernel
def point_segment_distance2(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the squared distance in cm^2 from point p to segment ab; a may equal b."""
    abx, aby = bx - ax, by - ay
    apx, apy = px - ax, py - ay
    length2 = abx * abx + aby * aby
    along = abx * apx + aby * apy
    share = 0.0 if along <= 0.0 else (1.0 if along >= length2 else along / length2)
    dx, dy = apx - share * abx, apy - share * aby
    return dx * dx + dy * dy


@kernel
def cross(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the z component of a x b."""
    return ax * by - ay * bx
