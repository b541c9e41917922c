"""Pictures of planning on roadmaps: ways of arms, energy over time, work over nodes, and a distribution of savings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.report.style import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    QUIET,
    TEXT_SIZE,
    VERMILION,
    dress,
    new_figure,
    save,
    set_title,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
TINT = 0.18
"""Of a colour, over white, where distance is kept."""
COLOURS = (BLUE, VERMILION, GREEN, ORANGE, "#CC79A7", "#56B4E9", "#8C6D31")
"""Okabe and Ito's, for up to seven joints."""


CURVE_STYLES = (("o", "-", 4.0), ("s", "-", 5.0), ("D", ":", 8.0))
"""Marker, line and size: hollow and dotted, so that one below another is seen."""
FEW_DECADES = 20.0
"""A logarithmic axis that spans less has its ticks where the values are."""


def draw_way(
    path_png: Path | str,
    poses_cm: ArrayLike,
    tip_cm: ArrayLike,
    obstacles: Sequence[Any],
    *,
    title: str,
    subtitle: str = "",
    before_cm: ArrayLike | None = None,
    added: Sequence[Any] = (),
    tolerance_cm: float = 0.0,
) -> None:
    """Draw an arm at every configuration of a way, fading in towards the goal, and its tip's path.

    Args:
        path_png: the file to write.
        poses_cm: the joints' positions, base to tip, shape (m, joints + 1, 2).
        tip_cm: the tip's way between them, shape (k, 2).
        obstacles: circles and polygons of `planarm.model.shapes`.
        title: above the picture.
        subtitle: a quiet line below the title.
        before_cm: the tip's way that was planned before something came, drawn dashed.
        added: what came.
        tolerance_cm: distance kept from that, drawn around it.
    """
    poses = np.asarray(poses_cm, np.float64)
    figure = new_figure(6.4, 6.6)
    axes = figure.subplots()
    for shape in obstacles:
        _fill(axes, shape, QUIET)
    for shape in added:
        _fill(axes, shape, VERMILION, tolerance_cm)
    if added:
        keeps = f", {tolerance_cm:g} cm kept from it" if tolerance_cm else ""
        axes.plot([], [], marker="s", color=VERMILION, markersize=9, linestyle="", label=f"what came{keeps}")
    for k, pose in enumerate(poses):
        share = k / max(1, len(poses) - 1)
        last = k in (0, len(poses) - 1)
        axes.plot(*pose.T, color=INK, alpha=0.9 if last else 0.12 + 0.3 * share, linewidth=2.6 if last else 1.4)
    if before_cm is not None:
        axes.plot(
            *np.asarray(before_cm, np.float64).T, color=ORANGE, linewidth=2.0, linestyle="--", label="tip's way before"
        )
    axes.plot(*np.asarray(tip_cm, np.float64).T, color=BLUE, linewidth=2.0, label="tip's way")
    axes.plot(*poses[:, -1].T, color=BLUE, marker="o", markersize=3.5, linestyle="")
    axes.plot(*poses[0, -1], marker="o", color=GREEN, markersize=9, linestyle="", label="start")
    axes.plot(*poses[-1, -1], marker="*", color=ORANGE, markeredgecolor=INK, markersize=14, linestyle="", label="goal")
    axes.plot(*poses[0, 0], marker="s", color=INK, markersize=8)
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.set_xlabel("x (cm)", fontsize=TEXT_SIZE)
    axes.set_ylabel("y (cm)", fontsize=TEXT_SIZE)
    dress(axes)
    set_title(axes, title, subtitle)
    axes.legend(fontsize=TEXT_SIZE, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3)
    save(figure, path_png)


def draw_energies(path_png: Path | str, t_s: ArrayLike, energy_j: ArrayLike, *, title: str, subtitle: str = "") -> None:
    """Draw the energy that each joint has consumed, shape (m, joints), over time, as the paper's figures do."""
    figure = new_figure(6.4, 3.6)
    axes = figure.subplots()
    energies = np.asarray(energy_j, np.float64)
    for joint in range(energies.shape[1]):
        colour = COLOURS[joint % len(COLOURS)]
        name = f"joint {joint + 1}: {energies[-1, joint]:.3g} J"
        axes.plot(np.asarray(t_s), energies[:, joint], color=colour, linewidth=1.8, label=name)
    axes.set_xlabel("time (s)", fontsize=TEXT_SIZE)
    axes.set_ylabel("energy consumed (J)", fontsize=TEXT_SIZE)
    dress(axes)
    set_title(axes, title, subtitle)
    axes.legend(fontsize=TEXT_SIZE, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=4)
    save(figure, path_png)


def draw_growth(
    path_png: Path | str, panels: Sequence[tuple[str, str, Mapping[str, tuple[ArrayLike, ArrayLike]]]], *, title: str
) -> None:
    """Draw curves, both axes logarithmic, one panel for each (title, what x is, name -> (x, y))."""
    figure = new_figure(4.2 * len(panels), 4.0)
    for axes, (label, x_label, curves) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels, strict=True):
        for (name, (x, y)), colour, style in zip(curves.items(), COLOURS, CURVE_STYLES, strict=False):
            marker, line, size = style
            axes.loglog(x, np.maximum(y, 1e-3), line, color=colour, marker=marker, label=name, markersize=size)
            axes.lines[-1].set(markerfacecolor="none", linewidth=1.8)
            values = np.unique(np.asarray(x, np.float64))
        if values[-1] < FEW_DECADES * values[0]:
            axes.set_xticks(values, [f"{value:g}" for value in values])
            axes.minorticks_off()
        axes.set_xlabel(x_label, fontsize=TEXT_SIZE)
        dress(axes)
        set_title(axes, label)
        axes.legend(fontsize=TEXT_SIZE, frameon=False)
    figure.suptitle(title, x=0.01, ha="left", fontsize=TEXT_SIZE + 4, color=INK)
    save(figure, path_png)


def draw_savings(path_png: Path | str, shares: ArrayLike, *, title: str, subtitle: str = "") -> None:
    """Draw the distribution of what least energy saves against least travel, as shares."""
    percent = 100.0 * np.asarray(shares, np.float64)
    figure = new_figure(6.4, 3.4)
    axes = figure.subplots()
    edges = range(min(0, 5 * int(percent.min() // 5)), 5 * int(percent.max() // 5) + 6, 5)
    axes.hist(percent, bins=[float(edge) for edge in edges], color=BLUE, edgecolor="white")
    middle = float(np.median(percent))
    axes.axvline(middle, color=VERMILION, linewidth=2.0)
    axes.annotate(
        f"median {middle:.1f} %",
        (middle, axes.get_ylim()[1]),
        (6, -12),
        textcoords="offset points",
        fontsize=TEXT_SIZE,
        color=VERMILION,
    )
    axes.set_xlabel("energy saved (%)", fontsize=TEXT_SIZE)
    axes.set_ylabel("scenes", fontsize=TEXT_SIZE)
    dress(axes)
    set_title(axes, title, subtitle)
    save(figure, path_png)


def _fill(axes: Axes, shape: Any, colour: str, around_cm: float = 0.0) -> None:  # noqa: ANN401 - a circle or a polygon
    from matplotlib.patches import Circle, Polygon  # noqa: PLC0415 - loads with matplotlib

    if hasattr(shape, "radius_cm"):
        patch: Any = Circle(shape.center_cm, shape.radius_cm, facecolor=colour, edgecolor=INK)
    else:
        patch = Polygon(np.array(shape.vertices_cm), facecolor=colour, edgecolor=INK)
    axes.add_patch(patch)
    if around_cm > 0.0:
        _tint_around(axes, shape, colour, around_cm)


def _tint_around(axes: Axes, shape: Any, colour: str, around_cm: float) -> None:  # noqa: ANN401 - as `_fill`
    """Tint what is nearer to a shape than that: circles around its corners, strips along its sides, all alike."""
    from matplotlib.colors import to_rgb  # noqa: PLC0415 - loads with matplotlib
    from matplotlib.patches import Circle, Polygon  # noqa: PLC0415

    light = 1.0 - TINT * (1.0 - np.array(to_rgb(colour)))
    tint: dict[str, Any] = {"facecolor": light, "edgecolor": "none", "zorder": 0.5}
    if hasattr(shape, "radius_cm"):
        axes.add_patch(Circle(shape.center_cm, shape.radius_cm + around_cm, **tint))
        return
    corners = np.array(shape.vertices_cm)
    for corner, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (other - corner) / np.linalg.norm(other - corner)
        aside = around_cm * np.array([-along[1], along[0]])
        axes.add_patch(Circle(corner, around_cm, **tint))
        axes.add_patch(Polygon(np.array([corner + aside, other + aside, other - aside, corner - aside]), **tint))
