"""Pictures of an arm among moving obstacles, like paper B's Figs. 5 to 16: plain values in, PNG files out."""

# ruff: noqa: PLC0415 - matplotlib takes its time to load, so only those who draw import it

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from planarm.report.style import (
    BLUE,
    GREEN,
    INK,
    JOINT_COLOURS,
    ORANGE,
    QUIET,
    TEXT_SIZE,
    TITLE_SIZE,
    VERMILION,
    dress,
    new_figure,
    save,
    set_title,
)
from planarm.report.workspace import OBSTACLE_COLOUR, CircleOutline, PolygonOutline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Nodes = NDArray[np.bool_]
Floats = NDArray[np.float64]
Outline = CircleOutline | PolygonOutline

FREE_COLOURS: Final = {"down": "#9CC9E8", "up": "#F2B48C", "both": "#A9DCC3"}


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One moment: what is free, where the obstacles are, the arm, and where its tip has been."""

    title: str
    free: Nodes
    """Shape [iy, ix]."""
    obstacles: Sequence[Outline]
    joints_cm: Floats
    """Base, elbow and tip, shape (3, 2)."""
    trail_cm: Floats
    """Shape (m, 2)."""
    alarm: bool = False
    """True for a step backward: its title is in another colour."""


def draw_free_spaces(
    path_png: Path | str,
    rows: Sequence[tuple[str, Mapping[str, Nodes], Sequence[Outline]]],
    extent_cm: tuple[float, float, float, float],
    title: str,
) -> None:
    """Draw the free Cartesian space for elbow down, up and both, one row a motion sample (Figs. 5 and 11).

    Args:
        path_png: the file.
        rows: (words, free nodes by "down", "up" and "both", obstacles at that time).
        extent_cm: left, right, bottom, top of the map.
        title: above the picture.
    """
    figure = new_figure(8.0, 2.55 * len(rows) + 0.5)
    panels = figure.subplots(len(rows), 3, squeeze=False, sharex=True, sharey=True)
    for axes_row, (words, free, obstacles) in zip(panels, rows, strict=True):
        for axes, side in zip(axes_row, ("down", "up", "both"), strict=True):
            _draw_free(axes, free[side], extent_cm, FREE_COLOURS[side])
            _draw_shapes(axes, obstacles)
            axes.set_title(f"{words}, elbow {side}" if side != "both" else f"{words}, both", fontsize=TEXT_SIZE)
    figure.suptitle(title, x=0.01, ha="left", fontsize=TITLE_SIZE, fontweight="bold", color=INK)
    save(figure, path_png)


def draw_frames(
    path_png: Path | str,
    frames: Sequence[Frame],
    extent_cm: tuple[float, float, float, float],
    path_cm: Floats,
    title: str,
) -> None:
    """Draw moments of a motion side by side (Figs. 6, 8, 12 and 14).

    Args:
        path_png: the file.
        frames: the moments, in order.
        extent_cm: left, right, bottom, top of the map.
        path_cm: the whole path, shape (n, 2).
        title: above the picture.
    """
    columns = min(4, len(frames))
    rows = -(-len(frames) // columns)
    figure = new_figure(3.0 * columns, 2.1 * rows + 0.6)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(frames) :]:
        axes.set_axis_off()
    for axes, frame in zip(panels, frames, strict=False):
        _draw_free(axes, frame.free, extent_cm, "#E3F0E8")
        _draw_shapes(axes, frame.obstacles)
        axes.plot(*path_cm.T, color=QUIET, linewidth=0.8)
        axes.plot(*frame.trail_cm.T, color=BLUE, linewidth=1.6)
        axes.plot(*frame.joints_cm.T, color=INK, linewidth=2.6, solid_capstyle="round")
        axes.plot(*frame.joints_cm[1], "o", color="white", markeredgecolor=INK, markersize=3.5)
        axes.plot(*path_cm[0], "o", color=GREEN, markersize=5, markeredgecolor="white")
        axes.plot(*path_cm[-1], "*", color=ORANGE, markersize=9, markeredgecolor=INK, markeredgewidth=0.5)
        axes.set_title(frame.title, fontsize=TEXT_SIZE, color=VERMILION if frame.alarm else INK)
        axes.set_ylim(max(extent_cm[2], -12.0), extent_cm[3] + 8.0)
        axes.set_xticks([])
        axes.set_yticks([])
    figure.suptitle(title, x=0.01, ha="left", fontsize=TITLE_SIZE, fontweight="bold", color=INK)
    save(figure, path_png)


def draw_costs(path_png: Path | str, curves_cm: Mapping[str, Sequence[float]], title: str, subtitle: str = "") -> None:
    """Draw the best length over a swarm's iterations (Figs. 7b and 13b), one line a swarm."""
    figure = new_figure(7.0, 4.0)
    axes = figure.add_subplot()
    for (name, curve), colour in zip(curves_cm.items(), JOINT_COLOURS, strict=False):
        axes.step(range(len(curve)), curve, where="post", color=colour, linewidth=1.8, label=f"{name}: {curve[-1]:.4f}")
    dress(axes)
    axes.set_xlabel("iteration", fontsize=TEXT_SIZE, color=INK)
    axes.set_ylabel("length of the best (cm)", fontsize=TEXT_SIZE, color=INK)
    axes.legend(fontsize=TEXT_SIZE, frameon=False)
    set_title(axes, title, subtitle)
    save(figure, path_png)


def draw_paths(
    path_png: Path | str,
    curves_cm: Mapping[str, Floats],
    title: str,
    subtitle: str = "",
) -> None:
    """Draw paths of the tip over each other (Figs. 7a and 13a)."""
    figure = new_figure(7.0, 3.6)
    axes = figure.add_subplot()
    for (name, curve), colour in zip(curves_cm.items(), (BLUE, INK, VERMILION, GREEN), strict=False):
        axes.plot(*curve.T, color=colour, linewidth=1.8, label=name)
    first = next(iter(curves_cm.values()))
    axes.plot(*first[0], "o", color=GREEN, markersize=8, markeredgecolor="white")
    axes.plot(*first[-1], "*", color=ORANGE, markersize=14, markeredgecolor=INK)
    dress(axes)
    axes.set_aspect("equal")
    axes.set_xlabel("x (cm)", fontsize=TEXT_SIZE, color=INK)
    axes.set_ylabel("y (cm)", fontsize=TEXT_SIZE, color=INK)
    figure.legend(loc="outside lower center", ncols=2, fontsize=TEXT_SIZE, frameon=False)
    set_title(axes, title, subtitle)
    save(figure, path_png)


def draw_angle_changes(path_png: Path | str, changes_rad: Floats, title: str, subtitle: str = "") -> None:
    """Draw how far each joint turns in each sample, in degrees (Figs. 10 and 16), for shape (samples, joints)."""
    figure = new_figure(7.0, 4.2)
    panels = figure.subplots(changes_rad.shape[1], 1, sharex=True, squeeze=False)[:, 0]
    for joint, axes in enumerate(panels):
        samples = np.arange(1, len(changes_rad) + 1)
        axes.bar(samples, np.degrees(changes_rad[:, joint]), width=1.0, color=JOINT_COLOURS[joint])
        dress(axes)
        axes.set_ylabel(f"change of joint {joint + 1} (°)", fontsize=TEXT_SIZE, color=INK)
    panels[-1].set_xlabel("motion sample", fontsize=TEXT_SIZE, color=INK)
    set_title(panels[0], title, subtitle)
    save(figure, path_png)


def _draw_free(axes: Axes, free: Nodes, extent_cm: tuple[float, float, float, float], colour: str) -> None:
    from matplotlib.colors import ListedColormap

    axes.imshow(
        free.astype(float),
        origin="lower",
        extent=extent_cm,
        interpolation="nearest",
        cmap=ListedColormap(["white", colour]),
        vmin=0.0,
        vmax=1.0,
        zorder=0,
    )
    axes.set_aspect("equal")
    axes.tick_params(labelsize=TEXT_SIZE - 2, colors=QUIET)


def _draw_shapes(axes: Axes, obstacles: Sequence[Outline]) -> None:
    from matplotlib import patches

    for obstacle in obstacles:
        vertices = getattr(obstacle, "vertices_cm", None)
        if vertices is not None:
            axes.add_patch(patches.Polygon(np.asarray(vertices), closed=True, color=OBSTACLE_COLOUR, zorder=3))
        else:
            center, radius = obstacle.center_cm, obstacle.radius_cm  # type: ignore[union-attr]  # a circle
            axes.add_patch(patches.Circle(center, radius, color=OBSTACLE_COLOUR, zorder=3))
