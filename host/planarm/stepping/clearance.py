"""Distances between links and obstacles, a second time: the certificate's own geometry.

It shares nothing with the planner's collision code but the description of the shapes, so that a mistake there cannot
hide itself. Distances are taken point to segment; two segments that cross are told by which side of each other their
ends lie on, a point inside a polygon by counting the edges that a ray from it crosses.
"""

from math import cos, hypot, inf, sin

import numpy as np
from numpy.typing import NDArray

from planarm.model.shapes import ObstacleSet
from planarm.stepping.train import Floats
from planarm_wire.kernel_cache import kernel


@kernel
def joint_positions_cm(link_lengths_cm: Floats, base_cm: tuple[float, float], q_rad: Floats) -> Floats:
    """Return base, elbow(s) and tip of each pose, shape (poses, links + 1, 2), for angles of shape (poses, links)."""
    poses, links = q_rad.shape
    positions = np.empty((poses, links + 1, 2))
    for i in range(poses):
        x, y, heading = base_cm[0], base_cm[1], 0.0
        positions[i, 0, 0], positions[i, 0, 1] = x, y
        for j in range(links):
            heading += q_rad[i, j]
            x, y = x + link_lengths_cm[j] * cos(heading), y + link_lengths_cm[j] * sin(heading)
            positions[i, j + 1, 0], positions[i, j + 1, 1] = x, y
    return positions


@kernel
def clearances_cm(positions: Floats, obstacles: ObstacleSet) -> tuple[Floats, NDArray[np.int64]]:
    """Return each pose's least distance of any link's centre line to any obstacle, and that obstacle's index.

    The distance is 0 where they touch, cross or lie inside; (inf, -1) without obstacles.
    """
    poses = positions.shape[0]
    least, nearest = np.full(poses, inf), np.full(poses, -1, np.int64)
    for i in range(poses):
        for j in range(positions.shape[1] - 1):
            ax, ay = positions[i, j, 0], positions[i, j, 1]
            bx, by = positions[i, j + 1, 0], positions[i, j + 1, 1]
            for k in range(obstacles.radii_cm.shape[0]):
                center = obstacles.centers_cm[k]
                distance = point_distance(center[0], center[1], ax, ay, bx, by) - obstacles.radii_cm[k]
                begin, end = obstacles.first_vertex[k], obstacles.first_vertex[k + 1]
                if distance >= least[i]:
                    continue  # not even its bounding circle is as near
                if end > begin:
                    distance = polygon_distance(obstacles.vertices_cm[begin:end], ax, ay, bx, by)
                if distance < least[i]:
                    least[i], nearest[i] = max(0.0, distance), k
    return least, nearest


@kernel
def point_distance(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance of the point (x, y) to the segment ab."""
    along_x, along_y = bx - ax, by - ay
    length2 = along_x * along_x + along_y * along_y
    share = 0.0
    if length2 > 0.0:
        share = min(1.0, max(0.0, ((x - ax) * along_x + (y - ay) * along_y) / length2))
    return hypot(x - ax - share * along_x, y - ay - share * along_y)


@kernel
def polygon_distance(vertices: Floats, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance of the segment ab to the filled polygon."""
    count = vertices.shape[0]
    least, inside = inf, False
    px, py = vertices[count - 1, 0], vertices[count - 1, 1]
    for k in range(count):
        qx, qy = vertices[k, 0], vertices[k, 1]
        if crosses(px, py, qx, qy, ax, ay, bx, by):
            return 0.0
        if (py > ay) != (qy > ay) and ax < px + (ay - py) / (qy - py) * (qx - px):
            inside = not inside
        least = min(least, point_distance(px, py, ax, ay, bx, by), point_distance(qx, qy, ax, ay, bx, by))
        least = min(least, point_distance(ax, ay, px, py, qx, qy), point_distance(bx, by, px, py, qx, qy))
        px, py = qx, qy
    return 0.0 if inside else least


@kernel
def crosses(px: float, py: float, qx: float, qy: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Tell whether segments pq and ab cross: the ends of each on different sides of the other's line."""
    a_side = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    b_side = (qx - px) * (by - py) - (qy - py) * (bx - px)
    p_side = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    q_side = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    return a_side * b_side < 0.0 and p_side * q_side < 0.0
