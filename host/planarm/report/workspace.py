"""The free Cartesian space with obstacles, the path and the arm along it (as in paper C, Figs. 10 and 11)."""

# ruff: noqa: PLC0415 - matplotlib takes its time to load, so only those who draw import it

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.report.style import BLUE, GREEN, INK, ORANGE, QUIET, TEXT_SIZE, dress, new_figure, save, set_title

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes


class RegionStyle(NamedTuple):
    """How a region of the map is drawn and called."""

    label: str
    colour: str


REGIONS: Final = (
    RegionStyle("free", "#F3F8F4"),
    RegionStyle("beyond reach", "#C9D0D8"),
    RegionStyle("inner hole", "#7C8A9A"),
    RegionStyle("blocked by an obstacle", "#F2B48C"),
    RegionStyle("joint limit or floor", "#C79BC9"),
)
"""By the map's region codes 0 to 4."""

OBSTACLE_COLOUR: Final = "#8A3B00"


class _Map(NamedTuple):
    x_cm: NDArray[np.float64]
    y_cm: NDArray[np.float64]
    region: NDArray[np.uint8]


class CircleOutline(Protocol):
    """A circle."""

    @property
    def center_cm(self) -> tuple[float, float]:
        """Its centre."""

    @property
    def radius_cm(self) -> float:
        """Its radius."""


class PolygonOutline(Protocol):
    """A polygon."""

    @property
    def vertices_cm(self) -> tuple[tuple[float, float], ...]:
        """Its vertices in order."""


def draw_workspace(
    path_png: Path | str,
    *,
    x_cm: ArrayLike,
    y_cm: ArrayLike,
    region: ArrayLike,
    obstacles: Sequence[CircleOutline | PolygonOutline],
    path_points_cm: ArrayLike | None,
    poses_cm: ArrayLike,
    title: str,
    subtitle: str = "",
    tip_curve_cm: ArrayLike | None = None,
    ends_cm: ArrayLike | None = None,
) -> None:
    """Draw the map's regions, the obstacles, the path and the arm on its way from start to goal.

    Args:
        path_png: the file to write.
        x_cm: the map's node coordinates, equally spaced, shape (columns,); a cell is centred on its node.
        y_cm: the same, shape (rows,).
        region: region code of each node, shape (rows, columns).
        obstacles: circles (`center_cm`, `radius_cm`) and polygons (`vertices_cm`), outlined as they are.
        path_points_cm: way-points from start to goal, shape (n, 2), n >= 1; None where there is no path.
        poses_cm: a handful of poses, from start to goal, each the base, the joints and the end effector: shape
            (k, joints + 1, 2). They fade in on the way to the goal.
        title: above the picture.
        subtitle: a quiet line below the title.
        tip_curve_cm: points along the smoothed path, shape (m, 2), when there is one.
        ends_cm: start and goal, shape (2, 2), for where there is no path to show them.

    Raises:
        ValueError: the arrays do not have these shapes, or a region code is unknown.
    """
    free_map = _checked_map(x_cm, y_cm, region)
    points_cm = None if path_points_cm is None else _array(path_points_cm, "path_points_cm", (None, 2))
    arms_cm = _array(poses_cm, "poses_cm", (None, None, 2))
    figure = new_figure(9.0, _height_in(free_map, 9.0))
    axes = figure.add_subplot()
    handles: list[Artist] = [*_draw_regions(axes, free_map), *_draw_obstacles(axes, obstacles)]
    handles += _draw_arms(axes, arms_cm)
    if tip_curve_cm is not None:
        handles += _draw_path(axes, _array(tip_curve_cm, "tip_curve_cm", (None, 2)), "path, corners blended")
        if points_cm is not None:
            look: dict[str, Any] = {"color": "white", "markeredgecolor": BLUE, "markersize": 3.2}
            axes.plot(*points_cm.T, "o", **look, markeredgewidth=0.9, zorder=6)
    elif points_cm is not None:
        handles += _draw_path(axes, points_cm, "path")
    ends = points_cm if ends_cm is None else _array(ends_cm, "ends_cm", (2, 2))
    if ends is not None:
        handles += _draw_ends(axes, ends)
    _finish(axes, free_map, arms_cm)
    set_title(axes, title, subtitle)
    figure.legend(handles=handles, loc="outside lower center", ncols=5, fontsize=TEXT_SIZE, frameon=False)
    save(figure, path_png)


def _array(values: ArrayLike, name: str, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape, strict=True)):
        raise ValueError(f"{name} has the shape {array.shape}, expected {shape} (None: any length)")
    return array


def _checked_map(x_cm: ArrayLike, y_cm: ArrayLike, region: ArrayLike) -> _Map:
    free_map = _Map(_array(x_cm, "x_cm", (None,)), _array(y_cm, "y_cm", (None,)), np.asarray(region, dtype=np.uint8))
    expected = (len(free_map.y_cm), len(free_map.x_cm))
    if free_map.region.shape != expected:
        raise ValueError(f"region has the shape {free_map.region.shape}, expected (rows, columns) = {expected}")
    highest = int(free_map.region.max(initial=0))
    if highest >= len(REGIONS):
        raise ValueError(f"region holds the code {highest}, known are 0 to {len(REGIONS) - 1}")
    return free_map


def _extent_cm(free_map: _Map) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of the map: half a cell beyond its outer nodes."""
    x_cm, y_cm = free_map.x_cm, free_map.y_cm
    half_x, half_y = (0.5 * float(nodes[1] - nodes[0]) if len(nodes) > 1 else 0.5 for nodes in (x_cm, y_cm))
    return float(x_cm[0]) - half_x, float(x_cm[-1]) + half_x, float(y_cm[0]) - half_y, float(y_cm[-1]) + half_y


def _height_in(free_map: _Map, width_in: float) -> float:
    left, right, bottom, top = _extent_cm(free_map)
    return (width_in - 0.7) * (top - bottom) / (right - left) + 1.7


def _draw_regions(axes: Axes, free_map: _Map) -> list[Artist]:
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    codes = [int(code) for code in np.unique(free_map.region)]
    axes.imshow(
        free_map.region,
        origin="lower",
        extent=_extent_cm(free_map),
        interpolation="nearest",
        cmap=ListedColormap([style.colour for style in REGIONS]),
        norm=BoundaryNorm(np.arange(-0.5, len(REGIONS)), len(REGIONS)),
        zorder=0,
    )
    return [Patch(facecolor=REGIONS[c].colour, edgecolor=QUIET, linewidth=0.6, label=REGIONS[c].label) for c in codes]


def _draw_obstacles(axes: Axes, obstacles: Sequence[CircleOutline | PolygonOutline]) -> list[Artist]:
    from matplotlib import patches

    look: dict[str, Any] = {"facecolor": OBSTACLE_COLOUR, "edgecolor": INK, "linewidth": 1.4, "zorder": 3}
    for obstacle in obstacles:
        vertices_cm = getattr(obstacle, "vertices_cm", None)
        if vertices_cm is not None:
            axes.add_patch(patches.Polygon(np.asarray(vertices_cm, dtype=np.float64), closed=True, **look))
        else:
            axes.add_patch(patches.Circle(obstacle.center_cm, obstacle.radius_cm, **look))  # type: ignore[union-attr]
    return [patches.Patch(**look, label="obstacle")] if obstacles else []


def _draw_arms(axes: Axes, arms_cm: NDArray[np.float64]) -> list[Artist]:
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import Normal, Stroke

    count = len(arms_cm)
    for index, joints_cm in enumerate(arms_cm):
        strength = 1.0 - 0.78 * (count - 1 - index) / count
        effects = [Stroke(linewidth=5.4, foreground="white", alpha=strength), Normal()]
        axes.plot(
            *joints_cm.T,
            color=INK,
            linewidth=3.4,
            alpha=strength,
            solid_capstyle="round",
            path_effects=effects,
            zorder=4,
        )
        axes.plot(*joints_cm[1:-1].T, "o", color="white", markeredgecolor=INK, markersize=6, alpha=strength, zorder=4.5)
    if not count:
        return []
    axes.plot(*arms_cm[:, -1].T, "o", color=INK, markeredgecolor="white", markersize=5, zorder=6.5)
    axes.plot(*arms_cm[0, 0], "s", color=INK, markeredgecolor="white", markersize=11, zorder=5, clip_on=False)
    return [Line2D([], [], color=INK, linewidth=3.4, solid_capstyle="round", label="arm, fading in towards the goal")]


def _draw_path(axes: Axes, points_cm: NDArray[np.float64], label: str) -> list[Artist]:
    from matplotlib.patheffects import Normal, Stroke

    effects = [Stroke(linewidth=4.2, foreground="white"), Normal()]
    return [*axes.plot(*points_cm.T, color=BLUE, linewidth=2.2, label=label, path_effects=effects, zorder=5.5)]


def _draw_ends(axes: Axes, points_cm: NDArray[np.float64]) -> list[Artist]:
    look: dict[str, Any] = {"markeredgewidth": 1.2, "linestyle": "none", "zorder": 7, "clip_on": False}
    start = axes.plot(*points_cm[0], "o", color=GREEN, markersize=10, label="start", markeredgecolor="white", **look)
    goal = axes.plot(*points_cm[-1], "*", color=ORANGE, markersize=17, label="goal", markeredgecolor=INK, **look)
    return [*start, *goal]


def _finish(axes: Axes, free_map: _Map, arms_cm: NDArray[np.float64]) -> None:
    """Equal scales, the whole map and the whole arm in view, axes in cm."""
    left, right, bottom, top = _extent_cm(free_map)
    if arms_cm.size:
        low, high = arms_cm.reshape(-1, 2).min(axis=0) - 1.5, arms_cm.reshape(-1, 2).max(axis=0) + 1.5
        left, bottom = min(left, float(low[0])), min(bottom, float(low[1]))
        right, top = max(right, float(high[0])), max(top, float(high[1]))
    dress(axes)
    axes.grid(visible=False)
    axes.set_aspect("equal")
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_xlabel("x (cm)", fontsize=TEXT_SIZE, color=INK)
    axes.set_ylabel("y (cm)", fontsize=TEXT_SIZE, color=INK)
