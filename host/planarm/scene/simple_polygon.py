"""Whether vertices make a simple polygon: the only test of geometry that reading a scene needs."""

from collections.abc import Sequence
from itertools import combinations

from planarm.scene.task import Point

MOST_VERTICES = 1000


def polygon_problem(vertices_cm: Sequence[Point]) -> str:
    """Return what keeps the vertices from being a simple polygon and what to change, or an empty text."""
    count = len(vertices_cm)
    if not 3 <= count <= MOST_VERTICES:
        return f"{count} vertices given, from 3 to {MOST_VERTICES} expected"
    edges = [(vertices_cm[i], vertices_cm[(i + 1) % count]) for i in range(count)]
    for i, (a, b) in enumerate(edges):
        if a == b:
            return f"vertices {i + 1} and {(i + 1) % count + 1} are the same point; remove one"
    for i, j in combinations(range(count), 2):
        neighbours = j - i == 1 or j - i == count - 1
        if _fold_back(edges, i, j) if neighbours else _meet(*edges[i], *edges[j]):
            return (
                f"edge {i + 1} (from vertex {i + 1}) and edge {j + 1} (from vertex {j + 1}) meet; "
                "order the vertices so that the outline does not touch itself"
            )
    return ""


def _fold_back(edges: Sequence[tuple[Point, Point]], i: int, j: int) -> bool:
    """Tell whether two edges that follow each other lie on one line and run back over each other."""
    first, second = (edges[i], edges[j]) if j - i == 1 else (edges[j], edges[i])
    (a, b), (_, c) = first, second
    ahead = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1])
    return _side(a, b, c) == 0 and ahead < 0.0


def _meet(a: Point, b: Point, p: Point, q: Point) -> bool:
    """Tell whether the segments ab and pq cross or touch."""
    sides = (_side(a, b, p), _side(a, b, q), _side(p, q, a), _side(p, q, b))
    if sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0:
        return True
    ends = ((a, b, p), (a, b, q), (p, q, a), (p, q, b))
    return any(side == 0 and _within_box(*end) for side, end in zip(sides, ends, strict=True))


def _side(a: Point, b: Point, p: Point) -> int:
    """Return 1 when p lies left of the line from a to b, -1 when right, 0 when on it."""
    value = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    return (value > 0.0) - (value < 0.0)


def _within_box(a: Point, b: Point, p: Point) -> bool:
    return min(a[0], b[0]) <= p[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= p[1] <= max(a[1], b[1])
