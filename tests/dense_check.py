"""The arm along a path, sampled densely, its distances by shapely: kinematics and geometry of the tests' own."""

from itertools import pairwise
from math import inf

import numpy as np
import shapely

from planarm.model.shapes import Circle, shape_of

SAMPLE_CM = 0.02


def links(scene, tips):
    """Return both links as line strings, the tips' distances from the base, and theta1 within its limits' turn.

    The elbow is where the links' circles meet, on the side that the scene names.
    """
    l1, l2 = scene.arm.link_lengths_cm
    base = np.array(scene.arm.base_cm)
    to_tip = tips - base
    r = np.hypot(*to_tip.T)
    along = (r**2 + l1**2 - l2**2) / (2.0 * r)
    aside = np.sqrt(np.maximum(0.0, l1**2 - along**2))
    unit = to_tip / r[:, None]
    left = np.column_stack([-unit[:, 1], unit[:, 0]])
    side = 1.0 if scene.arm.elbow == "up" else -1.0  # theta2 < 0 turns right at the elbow, so the elbow lies left
    elbows = base + along[:, None] * unit + side * aside[:, None] * left
    first = np.stack([np.broadcast_to(base, elbows.shape), elbows], axis=1)
    turn_start = scene.arm.joint_limits_rad[0][0]
    theta1 = (np.arctan2(*(elbows - base).T[::-1]) - turn_start) % (2.0 * np.pi) + turn_start
    return shapely.linestrings(first), shapely.linestrings(np.stack([elbows, tips], axis=1)), r, theta1


def least_clearance_cm(scene, points_cm):
    """Least distance of any link to any obstacle along straight moves between the points.

    -inf where the arm cannot reach or joint 1, whose range is one turn, would have to jump from one limit to the other.
    """
    tips = [points_cm[:1]]
    for a, b in pairwise(points_cm):
        steps = int(np.ceil(np.hypot(*(b - a)) / SAMPLE_CM)) + 1
        tips.append(a + np.linspace(0.0, 1.0, steps + 1)[1:, None] * (b - a))
    first, second, r, theta1 = links(scene, np.concatenate(tips))
    least, most = abs(np.diff(scene.arm.link_lengths_cm))[0], sum(scene.arm.link_lengths_cm)
    if r.min() < least - 1e-9 or r.max() > most + 1e-9 or np.abs(np.diff(theta1)).max(initial=0.0) > np.pi:
        return -inf
    clearance = inf
    for shape in map(shape_of, scene.obstacles):
        filled = shapely.Point(shape.center_cm) if isinstance(shape, Circle) else shapely.Polygon(shape.vertices_cm)
        radius = shape.radius_cm if isinstance(shape, Circle) else 0.0
        clearance = min(clearance, *(shapely.distance(link, filled).min() - radius for link in (first, second)))
    return clearance
