"""Where links touch obstacles: how deep, in which direction, and at which place of the link.

A link is a bar with round ends. A circle touches it at the nearest point of its centre line; a polygon touches it with
a vertex, or with an edge at the link's outer end. The deepest touch of a link and an obstacle counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there
from planarm_sim.plant.spec import CircleObstacle, PolygonObstacle

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Obstacles(NamedTuple):
    """All obstacles as flat arrays; a circle has no vertices and is its own bounding circle."""

    centers: Floats
    radii: Floats
    first_vertex: Ints
    vertices: Floats


def obstacle_arrays(obstacles: Sequence[CircleObstacle | PolygonObstacle]) -> Obstacles:
    """Return the obstacles as the kernels read them."""
    centers, radii, corners = [], [], []
    for obstacle in obstacles:
        if isinstance(obstacle, CircleObstacle):
            centers.append(obstacle.center_m)
            radii.append(obstacle.radius_m)
            corners.append(np.empty((0, 2)))
        else:
            vertices = np.array(obstacle.vertices_m, dtype=float)
            middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
            centers.append((float(middle[0]), float(middle[1])))
            radii.append(float(np.hypot(*(vertices - middle).T).max()))
            corners.append(vertices)
    return Obstacles(
        np.array(centers, dtype=float).reshape(-1, 2),
        np.array(radii, dtype=float),
        np.cumsum([0, *map(len, corners)], dtype=np.int64),
        np.concatenate([np.empty((0, 2)), *corners]),
    )


@inner
def touch(
    ax: float, ay: float, bx: float, by: float, half_width: float, obstacles: Obstacles, k: int
) -> tuple[float, float, float, float]:
    """Return depth, normal (x, y) from the obstacle to the link, and place as a share of the link; depth 0: no touch.

    Args:
        ax: inner end of the link's centre line, m.
        ay: its y.
        bx: outer end, m.
        by: its y.
        half_width: of the link, m.
        obstacles: all obstacles.
        k: the one looked at.
    """
    cx, cy, radius = obstacles.centers[k, 0], obstacles.centers[k, 1], obstacles.radii[k]
    u, dx, dy, distance = from_point(cx, cy, ax, ay, bx, by)
    depth = radius + half_width - distance
    if depth <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    first, end = obstacles.first_vertex[k], obstacles.first_vertex[k + 1]
    if first == end:
        return (depth, dx, dy, u) if distance > 0.0 else (depth, 0.0, 1.0, u)
    return touch_polygon(ax, ay, bx, by, half_width, obstacles.vertices[first:end])


@inner
def touch_polygon(
    ax: float, ay: float, bx: float, by: float, half_width: float, vertices: Floats
) -> tuple[float, float, float, float]:
    """As `touch`, for one polygon."""
    deepest, nx, ny, place = 0.0, 0.0, 0.0, 0.0
    count = len(vertices)
    inside = False
    edge_distance, ex, ey = np.inf, 0.0, 0.0
    for i in range(count):
        vx, vy = vertices[i, 0], vertices[i, 1]
        wx, wy = vertices[(i + 1) % count, 0], vertices[(i + 1) % count, 1]
        u, dx, dy, distance = from_point(vx, vy, ax, ay, bx, by)
        if half_width - distance > deepest and distance > 0.0:
            deepest, nx, ny, place = half_width - distance, dx, dy, u
        if (vy > by) != (wy > by) and bx < vx + (by - vy) / (wy - vy) * (wx - vx):
            inside = not inside
        _, dx, dy, distance = from_point(bx, by, vx, vy, wx, wy)
        if distance < edge_distance:
            edge_distance, ex, ey = distance, -dx, -dy
    depth = half_width + edge_distance if inside else half_width - edge_distance
    if depth > deepest and edge_distance > 0.0:
        sign = -1.0 if inside else 1.0
        return depth, sign * ex, sign * ey, 1.0
    return deepest, nx, ny, place


@inner
def from_point(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> tuple[float, float, float, float]:
    """Return the segment's point nearest to p as a share, the unit vector from p to it, and its distance."""
    sx, sy = bx - ax, by - ay
    length2 = sx * sx + sy * sy
    u = 0.0 if length2 == 0.0 else min(1.0, max(0.0, ((px - ax) * sx + (py - ay) * sy) / length2))
    dx, dy = ax + u * sx - px, ay + u * sy - py
    distance = np.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return u, 0.0, 0.0, 0.0
    return u, dx / distance, dy / distance, distance
