"""Pictures of the comparison: paths on the free map, and the stencils of paper C drawn from the code."""

from __future__ import annotations

from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.model.shapes import shape_of
from planarm.report import draw_joint_angles, draw_workspace
from planarm.report.stencils import StencilPanel, draw_stencils
from planarm.scene import Algorithm, Scene
from planarm.search.draw import draw_subset
from planarm.search.path import Path as TipPath
from planarm.search.stencils import DRAWN, stencil
from planarm.smoothing.blend import blend_corners
from planarm.trajectory.timing import time_path
from planarm.workspace.free_map import FreeMap

POSES_SHOWN = 7
CURVE_POINTS = 600
SEED = 1
"""Of the subsets shown for Chaos A*."""


def draw_path(
    path_png: Path,
    scene: Scene,
    free_map: FreeMap,
    path: TipPath,
    *,
    subtitle: str,
    tip_curve_cm: NDArray[np.float64] | None = None,
) -> None:
    """Draw a path on the free map, with the arm at equal distances along it, or along the curve where one is given."""
    arm = Arm.from_spec(scene.arm)
    tips_cm = _spread(path.points_cm if tip_curve_cm is None else tip_curve_cm, POSES_SHOWN)
    draw_workspace(
        path_png,
        x_cm=free_map.x_cm,
        y_cm=free_map.y_cm,
        region=free_map.region,
        obstacles=[shape_of(obstacle) for obstacle in scene.obstacles],
        path_points_cm=path.points_cm,
        poses_cm=forward(arm, inverse_2r(arm, tips_cm, path.elbow)),
        title=scene.name,
        subtitle=subtitle,
        tip_curve_cm=tip_curve_cm,
    )


def draw_free_space(path_png: Path, scene: Scene, free_map: FreeMap) -> None:
    """Draw the free Cartesian space and what forbids the rest, the arm at the start (paper C, fig. 10)."""
    arm = Arm.from_spec(scene.arm)
    map_words = f"margin {free_map.margin_cm:g} cm, cells of {free_map.cell_cm:g} cm"
    ends_cm = np.array([scene.task.start_cm, scene.task.goal_cm])
    draw_workspace(
        path_png,
        x_cm=free_map.x_cm,
        y_cm=free_map.y_cm,
        region=free_map.region,
        obstacles=[shape_of(obstacle) for obstacle in scene.obstacles],
        path_points_cm=None,
        ends_cm=ends_cm,
        poses_cm=forward(arm, inverse_2r(arm, ends_cm[:1], free_map.elbow)),
        title=scene.name,
        subtitle=f"{free_map.free_nodes} free nodes, {map_words}",
    )


def draw_angles(path_png: Path, scene: Scene, free_map: FreeMap, path: TipPath, *, subtitle: str) -> None:
    """Draw the joint angles over time along a path, timed within the scene's joint limits (paper C, figs. 12 to 18).

    The paper does not say how it times the motion; here corners are blended and the joints' limits used up.

    Raises:
        TimingError: the path runs into full stretch or full fold.
    """
    trajectory = time_path(blend_corners(path, free_map), scene.joints)
    t_s = np.linspace(0.0, trajectory.duration_s, CURVE_POINTS)
    draw_joint_angles(path_png, t_s, trajectory.sample(t_s)[0], title=scene.name, subtitle=subtitle)


def draw_paper_stencils(path_png: Path) -> None:
    """Draw every neighbourhood of paper C as the search uses it."""
    squares = [_panel("A*: 8 (Fig. 2)", "a_star", 8)]
    squares += [_panel(f"Modified A*: {count} (Fig. 4)", "modified_a_star", count) for count in (24, 48)]
    octagons = [_drawn_panel(count) for count in DRAWN]
    circles = [
        _panel(f"CHS: {count} (Fig. 8)", "chs", count, radius) for count, radius in ((12, 2.0), (28, 3.0), (48, 4.0))
    ]
    circles += [_panel("CHS: 56 (section VIII)", "chs", 56, sqrt(17.0)), _panel("CHS: 80 (Fig. 8)", "chs", 80, 5.0)]
    draw_stencils(path_png, [squares, octagons, circles], title="The neighbourhoods of the four planners")


def _panel(title: str, algorithm: Algorithm, neighbours: int, radius: float | None = None) -> StencilPanel:
    return StencilPanel(title, stencil(algorithm, neighbours), radius=radius)


def _drawn_panel(neighbours: int) -> StencilPanel:
    """Return an octagon with the subset that Chaos A* draws from it with SEED."""
    order = np.empty(neighbours, np.int64)
    draw_subset(order, DRAWN[neighbours], SEED, 0)
    used = np.isin(np.arange(neighbours), order[: DRAWN[neighbours]])
    return StencilPanel(
        f"Chaos A*: {DRAWN[neighbours]} of {neighbours} (Fig. 6)", stencil("chaos_a_star", neighbours), used
    )


def _spread(points_cm: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return `count` points at equal distances along a polyline, its ends included, shape (count, 2)."""
    along_cm = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points_cm, axis=0).T))))
    wanted_cm = np.linspace(0.0, along_cm[-1], count)
    return np.stack([np.interp(wanted_cm, along_cm, side) for side in points_cm.T], axis=1)
