"""Where a search begins and ends: the node at a given point, or the node that the point is joined to."""

from dataclasses import dataclass
from math import hypot

import numpy as np

from planarm.scene import Point
from planarm.workspace.free_map import FreeMap
from planarm.workspace.line_proof import prove_line
from planarm.workspace.proof import PROVED
from planarm.workspace.world import BEYOND_REACH, FREE, INNER_HOLE, LIMIT, OBSTACLE, region_at

ON_NODE_CM = 1e-9
"""A point this near to a node is the node: rounding, not geometry."""

JOIN_CELLS = 3
"""A point is joined to a node whose column and row are at most this many cells away."""

_FORBIDDEN = {
    BEYOND_REACH: "is beyond the arm's reach",
    INNER_HOLE: "is nearer to the base than the links and the limits of joint 2 allow",
    OBSTACLE: "brings a link's centre line to within {margin:g} cm of an obstacle (half of arm.link_width_cm, "
    "workspace.clearance_cm, half a micro-step)",
    LIMIT: "needs a joint beyond arm.joint_limits_deg or a link below the floor",
}


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A start or a goal: its node as column and row in cells (x / cell_cm, y / cell_cm), or what is wrong with it."""

    point_cm: Point
    column: int = 0
    row: int = 0
    on_node: bool = False
    """True when the point is the node, so that nothing has to be joined."""
    problem: str = ""
    """A sentence, when the search cannot begin or end here."""


def endpoint(free_map: FreeMap, name: str, point_cm: Point) -> Endpoint:
    """Return the node of a free point, or of a point that is no node the nearest one that a proved move leads to."""
    point_cm = (float(point_cm[0]), float(point_cm[1]))
    column, row = (round(value / free_map.cell_cm) for value in point_cm)
    x_cm, y_cm = column * free_map.cell_cm, row * free_map.cell_cm
    on_node = hypot(point_cm[0] - x_cm, point_cm[1] - y_cm) <= ON_NODE_CM
    here = f"{name} ({point_cm[0]:g}, {point_cm[1]:g}) cm"
    problem = _node_problem(free_map, column, row) if on_node else _point_problem(free_map, point_cm)
    if problem:
        return Endpoint(point_cm, problem=f"The {here} {problem.format(margin=free_map.margin_cm)}.")
    if on_node:
        return Endpoint(point_cm, column, row, on_node=True)
    for column, row in _near_free_nodes(free_map, point_cm):
        node_cm = column * free_map.cell_cm, row * free_map.cell_cm
        if prove_line(free_map.world, *point_cm, *node_cm)[0] == PROVED:
            return Endpoint(point_cm, column, row)
    return Endpoint(
        point_cm,
        problem=f"The {here} is free, but no straight move to a free node within {JOIN_CELLS} cells of "
        f"{free_map.cell_cm:g} cm can be proved free; a smaller workspace.cell_cm may help.",
    )


def _node_region(free_map: FreeMap, column: int, row: int) -> int | None:
    """Return the region of a node, or None when it is not on the map."""
    ix, iy = column - _first(free_map)[0], row - _first(free_map)[1]
    rows, columns = free_map.region.shape
    return int(free_map.region[iy, ix]) if 0 <= ix < columns and 0 <= iy < rows else None


def _node_problem(free_map: FreeMap, column: int, row: int) -> str:
    """Return what forbids the pose at a node, or an empty text."""
    region = _node_region(free_map, column, row)
    if region is None:
        return "lies outside workspace.x_cm or workspace.y_cm"
    return _FORBIDDEN.get(region, "")


def _first(free_map: FreeMap) -> tuple[int, int]:
    """Return column and row of the map's first node."""
    return round(float(free_map.x_cm[0]) / free_map.cell_cm), round(float(free_map.y_cm[0]) / free_map.cell_cm)


def _point_problem(free_map: FreeMap, point_cm: Point) -> str:
    """Return what forbids the pose with the tip at any point, or an empty text."""
    if prove_line(free_map.world, *point_cm, *point_cm)[0] == PROVED:
        return ""
    arm = free_map.world.arm
    region = int(region_at(arm, hypot(point_cm[0] - arm.base_x_cm, point_cm[1] - arm.base_y_cm)))
    return _FORBIDDEN[region] if region != FREE else f"{_FORBIDDEN[OBSTACLE]}, or {_FORBIDDEN[LIMIT]}"


def _near_free_nodes(free_map: FreeMap, point_cm: Point) -> list[tuple[int, int]]:
    """Return the free nodes around a point as (column, row), the nearest first."""
    middle = [round(value / free_map.cell_cm) for value in point_cm]
    span = range(-JOIN_CELLS, JOIN_CELLS + 1)
    nodes = [(middle[0] + dx, middle[1] + dy) for dy in span for dx in span]
    free = [node for node in nodes if _node_region(free_map, *node) == FREE]
    return sorted(free, key=lambda node: float(np.hypot(*(np.array(node) * free_map.cell_cm - point_cm))))
