"""Neighbourhood stencils, drawn as in paper C, Figs. 2, 4, 6 and 8: the moves from a node to its neighbours."""

# ruff: noqa: PLC0415 - matplotlib takes its time to load, so only those who draw import it

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from planarm.report.style import BLUE, GRID, INK, NOTE_SIZE, QUIET, TEXT_SIZE, TITLE_SIZE, VERMILION, new_figure, save

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

PANEL_IN: Final = 2.5
"""Width and height of a panel in inches."""


@dataclass(frozen=True, slots=True, eq=False)
class StencilPanel:
    """One stencil.

    Attributes:
        title: above the panel.
        offsets: (dx, dy) of the neighbours in cells, shape (n, 2).
        used: which of them are moves, shape (n,); None for all. The others are drawn hollow.
        radius: of a circle around the node in cells, if the stencil is defined by one.
    """

    title: str
    offsets: ArrayLike
    used: ArrayLike | None = None
    radius: float | None = None


def draw_stencils(path_png: Path | str, rows: Sequence[Sequence[StencilPanel]], *, title: str) -> None:
    """Draw rows of stencils, all panels of a row to one scale.

    Raises:
        ValueError: there is no panel, or `used` does not go with `offsets`.
    """
    if not rows or not all(rows):
        raise ValueError("there is no stencil to draw")
    columns = max(map(len, rows))
    figure = new_figure(PANEL_IN * columns, PANEL_IN * 1.08 * len(rows) + 0.4)
    figure.suptitle(title, x=0.01, ha="left", fontsize=TITLE_SIZE, fontweight="bold", color=INK)
    figure.legend(handles=_legend(rows), loc="upper right", fontsize=TEXT_SIZE, frameon=False)
    grid = figure.add_gridspec(len(rows), columns)
    for row, panels in enumerate(rows):
        reach = max(int(np.abs(np.asarray(panel.offsets)).max()) for panel in panels)
        for column, panel in enumerate(panels):
            _draw_panel(figure.add_subplot(grid[row, column]), panel, reach)
    save(figure, path_png)


def _legend(rows: Sequence[Sequence[StencilPanel]]) -> list[Artist]:
    from matplotlib.lines import Line2D

    panels = [panel for row in rows for panel in row]
    hollow = {"color": "none", "marker": "o", "markerfacecolor": "white", "markeredgecolor": QUIET}
    handles = [
        Line2D([], [], color="none", marker="s", markerfacecolor=VERMILION, markeredgecolor="white", label="the node"),
        Line2D([], [], color=BLUE, marker="o", markeredgecolor="white", linewidth=0.8, label="a move to a neighbour"),
    ]
    if any(panel.used is not None for panel in panels):
        handles.append(Line2D([], [], **hollow, label="a neighbour that was not drawn"))  # type: ignore[arg-type]
    if any(panel.radius is not None for panel in panels):
        handles.append(Line2D([], [], color=QUIET, linewidth=0.8, linestyle="--", label="the circle that holds them"))
    return list(handles)


def _draw_panel(axes: Axes, panel: StencilPanel, reach: int) -> None:
    from matplotlib.patches import Circle

    offsets = np.asarray(panel.offsets, dtype=np.float64)
    used = np.ones(len(offsets), bool) if panel.used is None else np.asarray(panel.used, dtype=bool)
    if offsets.shape != (len(offsets), 2) or used.shape != (len(offsets),):
        raise ValueError(f"{panel.title}: offsets {offsets.shape} and used {used.shape} are not (n, 2) and (n,)")
    span = np.arange(-reach, reach + 1)
    axes.plot(*(side.ravel() for side in np.meshgrid(span, span)), ".", color=GRID, markersize=3.5, zorder=1)
    if panel.radius is not None:
        axes.add_patch(Circle((0.0, 0.0), panel.radius, fill=False, edgecolor=QUIET, linewidth=0.8, linestyle="--"))
    for dx, dy in offsets[used]:
        axes.plot((0.0, dx), (0.0, dy), color=BLUE, linewidth=0.8, alpha=0.55, zorder=2)
    size = 5.5 if reach < 4 else 4.2
    axes.plot(
        *offsets[used].T, "o", color=BLUE, markersize=size, markeredgecolor="white", markeredgewidth=0.5, zorder=3
    )
    if not used.all():
        left = offsets[~used].T
        axes.plot(
            *left, "o", color="white", markersize=size - 0.8, markeredgecolor=QUIET, markeredgewidth=0.9, zorder=3
        )
    axes.plot(0.0, 0.0, "s", color=VERMILION, markersize=size + 1.5, markeredgecolor="white", zorder=4)
    axes.set_title(panel.title, fontsize=TEXT_SIZE, color=INK)
    axes.set_aspect("equal")
    axes.set_xlim(-reach - 0.7, reach + 0.7)
    axes.set_ylim(-reach - 0.7, reach + 0.7)
    axes.set_xticks(span)
    axes.set_yticks(span)
    axes.tick_params(length=0, labelsize=NOTE_SIZE - 2, colors=QUIET)
    for spine in axes.spines.values():
        spine.set_visible(False)
