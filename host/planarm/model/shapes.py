"""Shapes of obstacles: circles and simple polygons, and the flat arrays that kernels read.

Every named shape is given by its centre and the diameter of its circumscribed circle: the square is axis-aligned
(side = diameter / sqrt 2), the diamond is that square turned by 45 degrees, the triangle is equilateral and points
up, the hexagon is regular with a vertex towards +x.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import cos, hypot, radians, sin
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from planarm.scene import Obstacle, Point

FIRST_VERTEX_DEG = {"square": 45.0, "diamond": 0.0, "triangle": 90.0, "hexagon": 0.0}
VERTICES = {"square": 4, "diamond": 4, "triangle": 3, "hexagon": 6}


@dataclass(frozen=True, slots=True)
class Circle:
    """A filled circle."""

    center_cm: Point
    radius_cm: float


@dataclass(frozen=True, slots=True)
class Polygon:
    """A filled simple polygon, convex or not, in either sense of turning."""

    vertices_cm: tuple[Point, ...]

    @classmethod
    def inscribed(cls, shape: str, center_cm: Point, diameter_cm: float) -> Self:
        """Return a square, diamond, triangle or hexagon inscribed in the circle of the given diameter."""
        count, first = VERTICES[shape], radians(FIRST_VERTEX_DEG[shape])
        angles = [first + radians(360.0 * k / count) for k in range(count)]
        radius = 0.5 * diameter_cm
        return cls(tuple((center_cm[0] + radius * cos(a), center_cm[1] + radius * sin(a)) for a in angles))


class ObstacleSet(NamedTuple):
    """All obstacles as flat arrays, in the scene's order: what collision kernels read.

    Each obstacle has a bounding circle. A circle is its own bounding circle and has no vertices; a polygon's
    vertices are the rows `first_vertex[i]` to `first_vertex[i + 1]` of `vertices_cm`.
    """

    centers_cm: NDArray[np.float64]
    """Shape (n, 2)."""
    radii_cm: NDArray[np.float64]
    """Shape (n,)."""
    first_vertex: NDArray[np.int64]
    """Shape (n + 1,)."""
    vertices_cm: NDArray[np.float64]
    """Shape (all vertices, 2)."""


def shape_of(obstacle: Obstacle) -> Circle | Polygon:
    """Return the shape that a scene's obstacle describes."""
    if obstacle.vertices_cm is not None:
        return Polygon(obstacle.vertices_cm)
    if obstacle.center_cm is None or obstacle.diameter_cm is None:
        raise ValueError(f"a {obstacle.shape} needs center_cm and diameter_cm")
    if obstacle.shape == "circle":
        return Circle(obstacle.center_cm, 0.5 * obstacle.diameter_cm)
    return Polygon.inscribed(obstacle.shape, obstacle.center_cm, obstacle.diameter_cm)


def obstacle_set(shapes: Sequence[Circle | Polygon]) -> ObstacleSet:
    """Return the shapes as flat arrays, in the given order."""
    bounds = [bounding_circle(shape) for shape in shapes]
    corners = [shape.vertices_cm if isinstance(shape, Polygon) else () for shape in shapes]
    return ObstacleSet(
        centers_cm=np.array([b.center_cm for b in bounds], np.float64).reshape(-1, 2),
        radii_cm=np.array([b.radius_cm for b in bounds], np.float64),
        first_vertex=np.array([0, *accumulate(map(len, corners))], np.int64),
        vertices_cm=np.array([v for c in corners for v in c], np.float64).reshape(-1, 2),
    )


def bounding_circle(shape: Circle | Polygon) -> Circle:
    """Return a circle that holds the shape: around the middle of a polygon's bounding box."""
    if isinstance(shape, Circle):
        return shape
    xs, ys = zip(*shape.vertices_cm, strict=True)
    center = (0.5 * (min(xs) + max(xs)), 0.5 * (min(ys) + max(ys)))
    return Circle(center, max(hypot(x - center[0], y - center[1]) for x, y in shape.vertices_cm))
