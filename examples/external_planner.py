"""A sample planner for `planarm compare --external`: plain Python, A* over 8 neighbours, moves looked at closely.

    planarm compare --external "python examples/external_planner.py" --scenes 20

Replace `plan` by your own. The protocol is in docs/benchmark.md: one scene a line in, one path a line out.
"""

import heapq
import json
import math
import sys

SAFETY_CM = 0.15
"""Kept beside the margin: looking at a move's poses one by one proves nothing about those in between."""
STEPS = 8
"""Poses looked at on each move."""


def plan(scene):
    """Return the way-points [(x, y), ...] in cm from start to goal, or None."""
    cell = scene["cell_cm"]
    start, goal = (tuple(round(v / cell) for v in scene[key]) for key in ("start_cm", "goal_cm"))
    low, high = ([round(scene[axis][end] / cell) for axis in ("x_cm", "y_cm")] for end in (0, 1))
    best, before, closed = {start: 0.0}, {}, set()
    waiting = [(math.dist(start, goal), start)]
    while waiting:
        _, node = heapq.heappop(waiting)
        if node == goal:
            way = [node]
            while way[-1] != start:
                way.append(before[way[-1]])
            return [(x * cell, y * cell) for x, y in reversed(way)]
        if node in closed:
            continue
        closed.add(node)
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                to = (node[0] + dx, node[1] + dy)
                length = best[node] + math.hypot(dx, dy)
                inside = all(a <= v <= b for v, a, b in zip(to, low, high))
                if inside and to not in closed and length < best.get(to, math.inf) and is_free(scene, node, to, cell):
                    best[to], before[to] = length, node
                    heapq.heappush(waiting, (length + math.dist(to, goal), to))
    return None


def is_free(scene, a, b, cell):
    """Look at poses along a move."""
    return all(pose_is_free(scene, *(cell * (p + k / STEPS * (q - p)) for p, q in zip(a, b))) for k in range(STEPS + 1))


def pose_is_free(scene, x, y):
    """Tell whether the arm with its tip at (x, y) keeps the margin and its joints' limits."""
    (l1, l2), (bx, by) = scene["link_lengths_cm"], scene["base_cm"]
    r = math.hypot(x - bx, y - by)
    if not abs(l1 - l2) < r < l1 + l2:
        return False
    sign = -1.0 if scene["elbow"] == "up" else 1.0
    theta2 = sign * math.acos((r * r - l1 * l1 - l2 * l2) / (2 * l1 * l2))
    theta1 = math.atan2(y - by, x - bx) - math.atan2(l2 * math.sin(theta2), l1 + l2 * math.cos(theta2))
    low, high = scene["joint_limits_rad"][0]
    start = 0.5 * (low + high) - math.pi
    theta1 -= 2 * math.pi * math.floor((theta1 - start) / (2 * math.pi))
    if not low + 0.3 < theta1 < high - 0.3:  # joint 1 must not jump from one end of its turn to the other
        return False
    elbow = (bx + l1 * math.cos(theta1), by + l1 * math.sin(theta1))
    keep = scene["margin_cm"] + SAFETY_CM
    links = (((bx, by), elbow), (elbow, (x, y)))
    return all(distance(link, obstacle) > keep for link in links for obstacle in scene["obstacles"])


def distance(link, obstacle):
    """Return the distance in cm from a link to a filled circle or convex polygon."""
    a, b = link
    if "radius_cm" in obstacle:
        return point_to_segment(obstacle["center_cm"], a, b) - obstacle["radius_cm"]
    corners = obstacle["vertices_cm"]
    sides = list(zip(corners, corners[1:] + corners[:1]))
    if inside(a, sides) or any(cross(a, b, p, q) for p, q in sides):
        return 0.0
    ends = [point_to_segment(end, p, q) for end in (a, b) for p, q in sides]
    return min(ends + [point_to_segment(corner, a, b) for corner in corners])


def point_to_segment(p, a, b):
    """Return the distance from a point to a segment."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    share = max(0.0, min(1.0, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy)))
    return math.hypot(p[0] - a[0] - share * dx, p[1] - a[1] - share * dy)


def inside(p, sides):
    """Even-odd rule."""
    odd = False
    for (x1, y1), (x2, y2) in sides:
        if (y1 > p[1]) != (y2 > p[1]) and p[0] < x1 + (p[1] - y1) / (y2 - y1) * (x2 - x1):
            odd = not odd
    return odd


def cross(a, b, p, q):
    """Tell whether two segments cross."""

    def left(u, v, w):
        return (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0]) > 0

    return left(a, b, p) != left(a, b, q) and left(p, q, a) != left(p, q, b)


def main():
    """Answer one scene a line."""
    for line in sys.stdin:
        way = plan(json.loads(line))
        print(json.dumps({"points_cm": way}), flush=True)


if __name__ == "__main__":
    main()
