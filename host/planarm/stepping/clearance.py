"""Distances between links and obstacles, a second time and in another way: numpy over all poses at once.

The certificate does not share the planner's collision code, so that a mistake there cannot hide itself.
"""

import numpy as np
from numpy.typing import NDArray

from planarm.model.shapes import Circle, Polygon
from planarm.stepping.train import Floats


def joint_positions_cm(link_lengths_cm: tuple[float, ...], base_cm: tuple[float, float], q_rad: Floats) -> list[Floats]:
    """Return base, elbow(s) and tip of each pose: one array of shape (poses, 2) for each joint and the tip."""
    at = np.broadcast_to(np.array(base_cm, np.float64), (len(q_rad), 2))
    heading = np.zeros(len(q_rad))
    positions = [at]
    for j, length in enumerate(link_lengths_cm):
        heading = heading + q_rad[:, j]
        at = at + length * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        positions.append(at)
    return positions


def link_clearance_cm(a: Floats, b: Floats, shape: Circle | Polygon) -> Floats:
    """Return the distance from each segment a-b, of shape (poses, 2), to the filled shape; 0 when they touch."""
    if isinstance(shape, Circle):
        return np.maximum(0.0, _point_distance(np.array(shape.center_cm), a, b) - shape.radius_cm)
    vertices = np.array(shape.vertices_cm)
    least = np.full(len(a), np.inf)
    for start, end in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
        least = np.minimum(least, _edge_distance(a, b, start, end))
    return np.where(_inside(a, vertices), 0.0, least)


def _point_distance(point: Floats, a: Floats, b: Floats) -> Floats:
    """Return the distance of one point, or one for each segment, to the segments a-b."""
    along = b - a
    length2 = np.sum(along * along, axis=-1)
    projected = np.sum((point - a) * along, axis=-1)
    share = np.clip(np.divide(projected, length2, out=np.zeros_like(projected), where=length2 > 0.0), 0.0, 1.0)
    gap = point - a - share[..., None] * along
    distance: Floats = np.hypot(gap[..., 0], gap[..., 1])
    return distance


def _edge_distance(a: Floats, b: Floats, start: Floats, end: Floats) -> Floats:
    """Return the distance of each segment a-b to the edge from `start` to `end`."""
    starts, ends = np.broadcast_to(start, a.shape), np.broadcast_to(end, a.shape)
    apart = np.minimum(
        np.minimum(_point_distance(start, a, b), _point_distance(end, a, b)),
        np.minimum(_point_distance(a, starts, ends), _point_distance(b, starts, ends)),
    )
    edge, link = end - start, b - a
    # start + t edge = a + u link
    determinant = _cross(edge, link)
    offset = a - start
    with np.errstate(divide="ignore", invalid="ignore"):
        t, u = _cross(offset, link) / determinant, _cross(offset, edge) / determinant
    crosses = (determinant != 0.0) & (t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0)
    return np.where(crosses, 0.0, apart)


def _inside(points: Floats, vertices: Floats) -> NDArray[np.bool_]:
    """Tell which points lie inside the polygon, by its winding number."""
    winding = np.zeros(len(points))
    from_point = vertices[None, :, :] - points[:, None, :]
    angles = np.arctan2(from_point[..., 1], from_point[..., 0])
    turns = np.diff(np.concatenate([angles, angles[:, :1]], axis=1), axis=1)
    winding = ((turns + np.pi) % (2.0 * np.pi) - np.pi).sum(axis=1)
    inside: NDArray[np.bool_] = np.abs(winding) > np.pi
    return inside


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
