"""What closes the way between two poses: which obstacles, and how much room is missing.

Maps are looked at on cells coarse enough for a quick answer; every answer is then checked with the planner itself.
"""

from collections.abc import Collection
from dataclasses import replace
from math import sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from planarm.model.kinematics import ElbowSide
from planarm.scene import Scene
from planarm.search.endpoints import endpoint
from planarm.search.grid_search import find_path
from planarm.workspace.free_map import FreeMap, build_free_map
from planarm.workspace.world import FREE, OBSTACLE

Flags = NDArray[np.bool_]
Counts = NDArray[np.int32]

COARSE_NODES: Final = 20_000
"""A map with more nodes than this is looked at on larger cells."""

SINGLES: Final = 16
"""Of the obstacles that open the way when removed alone, at most so many are checked and told."""

MOST_TRIED: Final = 64
"""From a set larger than this nothing is sought."""

HOP: Final = 1_000.0
"""What an obstacle on the way counts for, in cells: more than any way around."""

ROOM_CM: Final = 0.005
"""How exactly the missing room is found."""

EIGHT: Final = np.ones((3, 3), bool)


def coarse(scene: Scene) -> Scene:
    """Return the scene on cells that give a map of at most COARSE_NODES nodes."""
    space = scene.workspace
    shrink = sqrt(len(space.columns) * len(space.rows) / COARSE_NODES)
    return scene if shrink <= 1.0 else replace(scene, workspace=replace(space, cell_cm=space.cell_cm * shrink))


def passes(scene: Scene, margin_cm: float, side: ElbowSide, without: Collection[int] = ()) -> bool:
    """Tell whether the planner finds a path when some obstacles, by their place in the scene, are taken away."""
    left = tuple(obstacle for k, obstacle in enumerate(scene.obstacles) if k not in without)
    free_map = build_free_map(replace(scene, obstacles=left), margin_cm, side)
    planner = scene.planner
    if planner.algorithm == "chaos_a_star":  # an unlucky draw is not what is asked about
        planner = replace(planner, algorithm="chs", neighbours=56)
    return find_path(free_map, scene.task.start_cm, scene.task.goal_cm, planner).path is not None


def closing_obstacles(scene: Scene, margin_cm: float, side: ElbowSide) -> tuple[tuple[int, ...], ...]:
    """Return sets of obstacles, by their place in the scene, each of which opens the way when taken away.

    Single ones when there are any; else one set from which none can be left out, not always the smallest; nothing when
    it is not obstacles that close the way.
    """
    scene = coarse(scene)
    free_map = build_free_map(scene, margin_cm, side)
    bare = build_free_map(replace(scene, obstacles=()), margin_cm, side)
    ends = [endpoint(free_map, name, point) for name, point in _ends(scene)]
    if any(end.problem for end in ends):
        return ()
    column, row = (round(float(first[0]) / free_map.cell_cm) for first in (free_map.x_cm, free_map.y_cm))
    start, goal = ((end.row - row, end.column - column) for end in ends)
    base = bare.region == FREE
    masks = [_blocked_by(scene, k, margin_cm, side) for k in range(len(scene.obstacles))]
    count: Counts = sum((mask.astype(np.int32) for mask in masks), np.zeros(base.shape, np.int32))
    singles = [k for k, mask in enumerate(masks) if mask.any() and _joined(base & (count == mask), start, goal)]
    opening = tuple((k,) for k in singles[:SINGLES] if passes(scene, margin_cm, side, (k,)))
    if opening:
        return opening
    crossed = _cheapest_crossing(bare, base, count, start, goal)
    for around in (0, 1, 3, max(base.shape)):
        near = _near(crossed, around, base.shape)
        found = [k for k, mask in enumerate(masks) if np.any(mask & near)]
        if len(found) > MOST_TRIED:
            return ()
        if found and passes(scene, margin_cm, side, found):
            return (_least(scene, margin_cm, side, found),)
    return ()


def _near(nodes: list[tuple[int, int]], around: int, shape: tuple[int, ...]) -> Flags:
    """Return which nodes lie at most so many rows and columns from some of those given."""
    near = np.zeros(shape, bool)
    for row, column in nodes:
        near[max(0, row - around) : row + around + 1, max(0, column - around) : column + around + 1] = True
    return near


def _least(scene: Scene, margin_cm: float, side: ElbowSide, found: list[int]) -> tuple[int, ...]:
    """Return what is left of a set that opens the way when nothing more can be left out of it."""
    for k in tuple(found):
        fewer = [other for other in found if other != k]
        if passes(scene, margin_cm, side, fewer):
            found = fewer
    return tuple(found)


def widest_margin_cm(scene: Scene, margin_cm: float, side: ElbowSide) -> float | None:
    """Return the largest margin, to ROOM_CM below it, with which there is a path; None when none is small enough."""
    scene = coarse(scene)
    low, high = 0.0, margin_cm
    if not passes(scene, low, side):
        return None
    while high - low > ROOM_CM:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if passes(scene, middle, side) else (low, middle)
    return low


def _ends(scene: Scene) -> tuple[tuple[str, tuple[float, float]], ...]:
    return ("start", scene.task.start_cm), ("goal", scene.task.goal_cm)


def _blocked_by(scene: Scene, k: int, margin_cm: float, side: ElbowSide) -> Flags:
    """Tell for each node whether obstacle k alone blocks it."""
    blocked: Flags = build_free_map(replace(scene, obstacles=(scene.obstacles[k],)), margin_cm, side).region == OBSTACLE
    return blocked


def _joined(free: Flags, start: tuple[int, int], goal: tuple[int, int]) -> bool:
    """Tell whether two free nodes are joined by neighbours of neighbours."""
    labels, _ = ndimage.label(free, EIGHT)
    return bool(labels[start] == labels[goal] != 0)


def _cheapest_crossing(
    bare: FreeMap, base: Flags, count: Counts, start: tuple[int, int], goal: tuple[int, int]
) -> list[tuple[int, int]]:
    """Return the nodes of a path that crosses as little of the obstacles as it can; nothing when there is no path."""
    number = np.full(base.shape, -1, np.int32)
    number[base] = np.arange(np.count_nonzero(base))
    rows, columns, costs = [], [], []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here, there = _shifted(number, dy, dx), _shifted(number, -dy, -dx)
        both = (here >= 0) & (there >= 0)
        blocked = np.maximum(_shifted(count, dy, dx), _shifted(count, -dy, -dx))[both]
        rows.append(here[both])
        columns.append(there[both])
        costs.append(np.hypot(dx, dy) + HOP * blocked)
    edges = np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))
    size = int(number.max()) + 1
    graph = coo_array(edges, (size, size)).tocsr()
    _, before = dijkstra(graph, directed=False, indices=number[start], return_predecessors=True)
    nodes, place = np.argwhere(base), int(number[goal])
    crossed = []
    while place >= 0:
        crossed.append((int(nodes[place][0]), int(nodes[place][1])))
        place = int(before[place])
    return crossed if crossed[-1] == start else []


def _shifted(array: Counts, dy: int, dx: int) -> Counts:
    """Return the nodes from which a move by (dx, dy) stays on the map, in an array of all nodes."""
    rows, columns = array.shape
    part: Counts = array[max(0, -dy) : rows - max(0, dy), max(0, -dx) : columns - max(0, dx)]
    return part
