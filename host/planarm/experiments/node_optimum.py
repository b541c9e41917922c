"""The shortest legal polyline through cell centres, exactly: the yardstick of the open benchmark.

Legal is what `planarm.workspace.proof` proves free for the whole arm, all along each straight move; way-points may be
any free nodes, however far apart. A* over all pairs of nodes, moves proved when they come to the top of the list. A
path that is known bounds the search: what cannot be shorter is never put on the list, and that is nearly everything.
"""

from math import hypot, inf

import numpy as np
from numpy.typing import NDArray

from planarm.scene import PlannerSpec, Point
from planarm.search.grid_search import find_path
from planarm.search.heap import rise, sink
from planarm.search.path import Path
from planarm.workspace.free_map import FreeMap
from planarm.workspace.line_proof import prove_line
from planarm.workspace.proof import PROVED
from planarm.workspace.world import FREE, ArmWorld
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BOUND = PlannerSpec("chs", 56, "run", 0, "proved")
ROUNDING_CM = 1e-9
NONE = -1


def shortest_through_nodes(free_map: FreeMap, start_cm: Point, goal_cm: Point) -> Path | None:
    """Return the shortest legal path through nodes, or None when CHS finds none at all.

    Args:
        free_map: the map; its margin is kept.
        start_cm: a free node.
        goal_cm: a free node.
    """
    known = find_path(free_map, start_cm, goal_cm, BOUND).path
    if known is None:
        return None
    rows, columns = np.nonzero(free_map.region == FREE)
    nodes = np.stack([free_map.x_cm[columns], free_map.y_cm[rows]], axis=1)
    start, goal = (int(np.argmin(np.hypot(*(nodes - point).T))) for point in (start_cm, goal_cm))
    bound_cm = pulled_length_cm(free_map.world, np.ascontiguousarray(known.points_cm)) + ROUNDING_CM
    chain = _search(free_map.world, nodes, start, goal, bound_cm)
    return Path.through(nodes[chain], free_map.elbow)


@kernel
def line_is_legal(world: ArmWorld, ax: float, ay: float, bx: float, by: float) -> bool:
    """Tell whether a straight move of the tip is proved free; both directions agree."""
    if (bx, by) < (ax, ay):
        ax, ay, bx, by = bx, by, ax, ay
    verdict, _ = prove_line(world, ax, ay, bx, by)
    return verdict == PROVED


@kernel
def pulled_length_cm(world: ArmWorld, points: Floats) -> float:
    """Return the length of the shortest path through some of a legal path's points, in their order."""
    count = points.shape[0]
    length = np.full(count, inf)
    length[0] = 0.0
    for j in range(1, count):
        for i in range(j - 1, -1, -1):
            through = length[i] + hypot(points[j, 0] - points[i, 0], points[j, 1] - points[i, 1])
            if through < length[j] and (
                i == j - 1 or line_is_legal(world, points[i, 0], points[i, 1], points[j, 0], points[j, 1])
            ):
                length[j] = through
    return float(length[count - 1])


@kernel
def _search(world: ArmWorld, nodes: Floats, start: int, goal: int, bound_cm: float) -> Ints:
    """Return the nodes of a shortest path that is no longer than the bound."""
    count, room = nodes.shape[0], 1 << 12
    before, closed = np.full(count, NONE, np.int64), np.zeros(count, np.bool_)
    f_of, g_of, source, target = np.empty(room), np.empty(room), np.empty(room, np.int64), np.empty(room, np.int64)
    heap = np.empty(room, np.int64)
    f_of[0], g_of[0], source[0], target[0], heap[0] = 0.0, 0.0, NONE, start, 0
    made, heaped = 1, 1
    while heaped > 0:
        entry = heap[0]
        heaped -= 1
        sink(heap, heaped, heap[heaped], f_of)
        u, a = target[entry], source[entry]
        if closed[u]:
            continue
        if a != NONE and not line_is_legal(world, nodes[a, 0], nodes[a, 1], nodes[u, 0], nodes[u, 1]):
            continue
        closed[u], before[u] = True, a
        if u == goal:
            break
        for v in range(count):
            if closed[v]:
                continue
            g = g_of[entry] + hypot(nodes[v, 0] - nodes[u, 0], nodes[v, 1] - nodes[u, 1])
            f = g + hypot(nodes[goal, 0] - nodes[v, 0], nodes[goal, 1] - nodes[v, 1])
            if f > bound_cm:
                continue
            if made == room:
                room *= 2
                f_of, g_of = np.append(f_of, np.empty(made)), np.append(g_of, np.empty(made))
                source, target = (
                    np.append(source, np.empty(made, np.int64)),
                    np.append(target, np.empty(made, np.int64)),
                )
                heap = np.append(heap, np.empty(made, np.int64))
            f_of[made], g_of[made], source[made], target[made] = f, g, u, v
            rise(heap, heaped, made, f_of)
            made, heaped = made + 1, heaped + 1
    chain, place = [goal], goal
    while before[place] != NONE:
        place = before[place]
        chain.append(place)
    return np.array(chain[::-1])
