"""Obstacles that move: flat arrays for kernels, where each obstacle is, and how near it comes in a span of time."""

from dataclasses import replace
from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.model.collision import point_segment_distance2, segment_distance2, segment_polygon_distance
from planarm.model.shapes import Circle, ObstacleSet, Polygon, obstacle_set, shape_of
from planarm.scene import Obstacle, ObstacleMotion, Scene
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]


class MovingSet(NamedTuple):
    """Obstacles with their displacements over time; repeated motions are written out up to the time asked for."""

    obstacles: ObstacleSet
    """Where they are drawn, which is where they are at time 0."""
    first_knot: NDArray[np.int64]
    """Shape (n + 1,): obstacle i has the knots first_knot[i] to first_knot[i + 1]."""
    knot_s: Floats
    """Times, ascending for each obstacle; before the first and after the last it rests."""
    knot_cm: Floats
    """Displacements at those times, shape (knots, 2)."""
    speeds_cm_s: Floats
    """The greatest speed of each obstacle, shape (n,)."""


def moving_set(scene: Scene, until_s: float) -> MovingSet:
    """Return a scene's obstacles, moving and resting ones, with their motions up to `until_s` at least."""
    knots = [_knots(obstacle, until_s) for obstacle in scene.obstacles]
    speeds = [obstacle.motion.fastest_cm_s if obstacle.motion else 0.0 for obstacle in scene.obstacles]
    return MovingSet(
        obstacles=obstacle_set([shape_of(obstacle) for obstacle in scene.obstacles]),
        first_knot=np.cumsum([0, *(len(times) for times, _ in knots)], dtype=np.int64),
        knot_s=np.array([t for times, _ in knots for t in times], np.float64),
        knot_cm=np.array([p for _, places in knots for p in places], np.float64).reshape(-1, 2),
        speeds_cm_s=np.array(speeds, np.float64),
    )


def _knots(obstacle: Obstacle, until_s: float) -> tuple[list[float], list[tuple[float, float]]]:
    """Return an obstacle's times and displacements."""
    motion = obstacle.motion
    if motion is None:
        return [0.0], [(0.0, 0.0)]
    times, places = list(motion.times_s), list(motion.offsets_cm)
    while motion.repeat and times[-1] < until_s:
        begin = times[-1]
        times += [begin + t for t in motion.times_s[1:]]
        places += motion.offsets_cm[1:]
    return times, places


def offset_cm(motion: ObstacleMotion | None, time_s: float) -> tuple[float, float]:
    """Return an obstacle's displacement at a time, plainly, from its description."""
    if motion is None:
        return 0.0, 0.0
    at = time_s % motion.times_s[-1] if motion.repeat else time_s
    x, y = zip(*motion.offsets_cm, strict=True)
    return float(np.interp(at, motion.times_s, x)), float(np.interp(at, motion.times_s, y))


def shape_at(obstacle: Obstacle, time_s: float) -> Circle | Polygon:
    """Return the shape of an obstacle where it is at a time."""
    shape, (dx, dy) = shape_of(obstacle), offset_cm(obstacle.motion, time_s)
    if isinstance(shape, Circle):
        return Circle((shape.center_cm[0] + dx, shape.center_cm[1] + dy), shape.radius_cm)
    return Polygon(tuple((x + dx, y + dy) for x, y in shape.vertices_cm))


def later(scene: Scene, by_s: float) -> Scene:
    """Return the scene as it is after a time: obstacles where they are then, with what is left of their motions."""
    return replace(scene, obstacles=tuple(_later(obstacle, by_s) for obstacle in scene.obstacles))


def _later(obstacle: Obstacle, by_s: float) -> Obstacle:
    motion, (dx, dy) = obstacle.motion, offset_cm(obstacle.motion, by_s)
    moved = replace(
        obstacle,
        center_cm=None if obstacle.center_cm is None else (obstacle.center_cm[0] + dx, obstacle.center_cm[1] + dy),
        vertices_cm=None if obstacle.vertices_cm is None else tuple((x + dx, y + dy) for x, y in obstacle.vertices_cm),
    )
    if motion is None:
        return moved
    begin = by_s % motion.times_s[-1] if motion.repeat else by_s
    left = [(t, p) for t, p in zip(motion.times_s, motion.offsets_cm, strict=True) if t > begin]
    if motion.repeat:  # round once more, to where it is now
        period = motion.times_s[-1]
        left += [(t + period, p) for t, p in zip(motion.times_s, motion.offsets_cm, strict=True) if 0.0 < t < begin]
        left.append((begin + period, (dx, dy)))
    if not left:
        return replace(moved, motion=None)
    times = (0.0, *(t - begin for t, _ in left))
    places = ((0.0, 0.0), *((x - dx, y - dy) for _, (x, y) in left))
    return replace(moved, motion=ObstacleMotion(times, places, motion.repeat))


def sampled_offsets_cm(moving: MovingSet, times_s: Floats) -> Floats:
    """Return the displacement of each obstacle at each time, shape (n, times, 2)."""
    count = len(moving.speeds_cm_s)
    out = np.empty((count, len(times_s), 2))
    for i in range(count):
        begin, end = moving.first_knot[i], moving.first_knot[i + 1]
        for axis in range(2):
            out[i, :, axis] = np.interp(times_s, moving.knot_s[begin:end], moving.knot_cm[begin:end, axis])
    return out


@kernel
def gap_in_span(
    moving: MovingSet,
    i: int,
    since_s: float,
    until_s: float,
    ax: float,
    ay: float,
    bx: float,
    by: float,
    cx: float,
    cy: float,
    enough_cm: float,
) -> float:
    """Return the least distance in cm from the resting links ab and bc to obstacle i in a span of time.

    Exact; a circle's is negative when it overlaps a link by its centre's distance, a polygon's is 0 when they touch.
    Above `enough_cm` a lower bound may be returned.
    """
    begin, end = moving.first_knot[i], moving.first_knot[i + 1]
    least = inf
    k = begin
    while k + 1 < end and moving.knot_s[k + 1] <= since_s:
        k += 1
    x0, y0 = _place(moving, k, end, since_s)
    now = since_s
    while True:
        later = until_s if k + 1 >= end else min(until_s, moving.knot_s[k + 1])
        x1, y1 = _place(moving, k, end, later)
        least = min(least, _gap_on_leg(moving.obstacles, i, x0, y0, x1, y1, ax, ay, bx, by, cx, cy, enough_cm))
        now, x0, y0 = later, x1, y1
        if now >= until_s:
            return least
        k += 1


@kernel
def _place(moving: MovingSet, k: int, end: int, time_s: float) -> tuple[float, float]:
    """Return the displacement at a time on the leg that begins at knot k; at rest beyond the last knot."""
    x, y = moving.knot_cm[k, 0], moving.knot_cm[k, 1]
    if k + 1 >= end or time_s <= moving.knot_s[k]:
        return x, y
    share = min(1.0, (time_s - moving.knot_s[k]) / (moving.knot_s[k + 1] - moving.knot_s[k]))
    return x + share * (moving.knot_cm[k + 1, 0] - x), y + share * (moving.knot_cm[k + 1, 1] - y)


@kernel
def _gap_on_leg(
    obstacles: ObstacleSet,
    i: int,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    ax: float,
    ay: float,
    bx: float,
    by: float,
    cx: float,
    cy: float,
    enough_cm: float,
) -> float:
    """Return the least distance of links ab and bc to obstacle i while it moves straight from offset 0 to offset 1.

    A circle's centre draws a segment. A polygon is held and the link moved back instead: it draws a parallelogram.
    """
    px, py = obstacles.centers_cm[i, 0] + x0, obstacles.centers_cm[i, 1] + y0
    qx, qy = px + x1 - x0, py + y1 - y0
    if px == qx and py == qy:
        apart2 = min(point_segment_distance2(px, py, ax, ay, bx, by), point_segment_distance2(px, py, bx, by, cx, cy))
    else:
        apart2 = min(
            segment_distance2(ax, ay, bx, by, px, py, qx, qy), segment_distance2(bx, by, cx, cy, px, py, qx, qy)
        )
    gap = sqrt(apart2) - obstacles.radii_cm[i]
    first, end = obstacles.first_vertex[i], obstacles.first_vertex[i + 1]
    if first == end or gap > enough_cm:
        return float(gap)
    vertices = obstacles.vertices_cm
    return min(
        _link_polygon_gap(ax, ay, bx, by, x0, y0, x1, y1, vertices, first, end),
        _link_polygon_gap(bx, by, cx, cy, x0, y0, x1, y1, vertices, first, end),
    )


@kernel
def _link_polygon_gap(
    ax: float,
    ay: float,
    bx: float,
    by: float,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    vertices: Floats,
    first: int,
    end: int,
) -> float:
    """Return the distance of a polygon to the parallelogram that ab, moved by -offset, draws."""
    least = segment_polygon_distance(ax - x0, ay - y0, bx - x0, by - y0, vertices, first, end)
    if x0 == x1 and y0 == y1:
        return least
    least = min(least, segment_polygon_distance(ax - x1, ay - y1, bx - x1, by - y1, vertices, first, end))
    least = min(least, segment_polygon_distance(ax - x0, ay - y0, ax - x1, ay - y1, vertices, first, end))
    least = min(least, segment_polygon_distance(bx - x0, by - y0, bx - x1, by - y1, vertices, first, end))
    if least > 0.0 and _in_parallelogram(vertices[first], ax - x0, ay - y0, bx - ax, by - ay, x0 - x1, y0 - y1):
        return 0.0
    return least


@kernel
def _in_parallelogram(point: Floats, ox: float, oy: float, ux: float, uy: float, vx: float, vy: float) -> bool:
    """Tell whether a point lies in the parallelogram from o along u and v."""
    area = ux * vy - uy * vx
    if area == 0.0:
        return False
    px, py = point[0] - ox, point[1] - oy
    along_u, along_v = (px * vy - py * vx) / area, (ux * py - uy * px) / area
    return bool(0.0 <= along_u <= 1.0 and 0.0 <= along_v <= 1.0)


@kernel
def first_touches(moving: MovingSet, times_s: Floats, joints_cm: Floats, within_cm: float) -> NDArray[np.int64]:
    """Return for each obstacle the first pose that comes within a distance of it, and its link: (-1, -1) for none.

    Each pose is taken to last until the next pose's time; obstacles move meanwhile.

    Args:
        moving: the obstacles.
        times_s: when each pose begins, ascending, shape (n,).
        joints_cm: base, elbow and tip of each, shape (n, 3, 2).
        within_cm: from a link's centre line.
    """
    found = np.full((moving.speeds_cm_s.shape[0], 2), -1, np.int64)
    for i in range(found.shape[0]):
        for n in range(times_s.shape[0]):
            until = times_s[min(n + 1, times_s.shape[0] - 1)]
            for link in range(2):
                ax, ay = joints_cm[n, link, 0], joints_cm[n, link, 1]
                bx, by = joints_cm[n, link + 1, 0], joints_cm[n, link + 1, 1]
                gap = gap_in_span(moving, i, times_s[n], until, ax, ay, bx, by, bx, by, within_cm)
                if gap <= within_cm and found[i, 0] < 0:
                    found[i, 0], found[i, 1] = n, link
            if found[i, 0] >= 0:
                break
    return found
