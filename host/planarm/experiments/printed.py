"""The papers' equations and pseudo-code as printed, errors included: nothing here is used to move an arm.

They exist so that what the printed form does can be run and measured (`planarm compare table2 --as-printed`, the tests
in tests/errata); docs/errata.md lists what is wrong with each.
"""

from __future__ import annotations

from heapq import heappop, heappush
from math import hypot, nan
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planarm.search.stencils import Offsets
from planarm.workspace.free_map import FreeMap
from planarm.workspace.world import FREE

Floats = NDArray[np.float64]
ArcTangent = Literal["printed", "atan2"]
"""tan^-1 of a quotient, as printed, which cannot tell opposite quadrants apart; or atan2."""


def inverse_paper_c(links_cm: tuple[float, ...], tip_cm: Floats, arc_tangent: ArcTangent = "printed") -> Floats:
    """Return the joint angles of paper C's eqs. 5-9, shape (n, 2), for tips of shape (n, 2) and a base at the origin.

    Eq. 9 is taken with the plus sign that it is printed with.
    """
    l1_cm, l2_cm = links_cm
    x, y = tip_cm.T
    r2 = x * x + y * y
    theta2 = np.arccos(np.clip((l1_cm**2 + l2_cm**2 - r2) / (2.0 * l1_cm * l2_cm), -1.0, 1.0)) - np.pi  # eq. 7
    theta1 = _arc_tangent(y, x, arc_tangent) + _arc_tangent(  # eqs. 8, 9
        l2_cm * np.sin(theta2), l1_cm + l2_cm * np.cos(theta2), arc_tangent
    )
    return np.stack([theta1, theta2], axis=1)


def forward_paper_b(links_cm: tuple[float, ...], q_rad: Floats) -> Floats:
    """Return the tips of paper B's eqs. 1-2, shape (n, 2), for joint angles of shape (n, 2)."""
    l1_cm, l2_cm = links_cm
    theta1, theta2 = q_rad.T
    x = l1_cm * np.cos(theta1) * np.cos(theta2) + l2_cm * np.cos(theta1 + theta2)
    y = l1_cm * np.sin(theta1) * np.sin(theta2) + l2_cm * np.sin(theta1 + theta2)
    return np.stack([x, y], axis=1)


def search_paper_c(
    free_map: FreeMap, offsets: Offsets, start_cm: tuple[float, float], goal_cm: tuple[float, float]
) -> float:
    """Return the length of the path that paper C's pseudo-code (figs. 3, 5, 9) finds, or NaN when it finds none.

    It puts the successors that are not on the closed list on the open one and calculates their cost, and says nothing
    of a node that is already open: here such a node keeps the cost and the parent that it got first. Only the node at
    a move's end is checked. Start and goal are nodes; among equal f the newest is expanded first.
    """
    cell_cm = free_map.cell_cm
    first = round(float(free_map.x_cm[0]) / cell_cm), round(float(free_map.y_cm[0]) / cell_cm)
    (sx, sy), (gx, gy) = (
        tuple(round(value / cell_cm) - low for value, low in zip(point, first, strict=True))
        for point in (start_cm, goal_cm)
    )
    rows, columns = free_map.region.shape
    seen = free_map.region != FREE  # on a list already, or not to be entered
    seen[sy, sx] = True
    moves = [(int(dx), int(dy), cell_cm * hypot(dx, dy)) for dx, dy in offsets]
    waiting = [(cell_cm * hypot(gx - sx, gy - sy), 0, sx, sy, 0.0)]
    made = 0
    while waiting:
        _, _, x, y, g_cm = heappop(waiting)
        if (x, y) == (gx, gy):
            return g_cm
        for dx, dy, length_cm in moves:
            i, j = x + dx, y + dy
            if 0 <= i < columns and 0 <= j < rows and not seen[j, i]:
                seen[j, i] = True
                made += 1
                to_cm = g_cm + length_cm
                heappush(waiting, (to_cm + cell_cm * hypot(gx - i, gy - j), -made, i, j, to_cm))
    return nan


def _arc_tangent(y: Floats, x: Floats, kind: ArcTangent) -> Floats:
    if kind == "atan2":
        return np.arctan2(y, x)
    with np.errstate(divide="ignore", invalid="ignore"):
        quotient = np.arctan(y / x)
    return np.where(np.isnan(quotient), 0.0, quotient)
