"""What all pictures share: colours, letters, and how a figure becomes a file.

Figures are made as objects with the Agg canvas; pyplot and its global state are never touched. Colours are those of
Okabe and Ito, "Color Universal Design" (2008), and tints of them, so that people who do not tell red from green still
tell the regions apart.
"""

# ruff: noqa: PLC0415 - matplotlib takes its time to load, so only those who draw import it

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK: Final = "#1F2933"
QUIET: Final = "#66727F"
GRID: Final = "#DDE2E7"
BLUE: Final = "#0072B2"
VERMILION: Final = "#D55E00"
GREEN: Final = "#009E73"
ORANGE: Final = "#E69F00"
JOINT_COLOURS: Final = (BLUE, VERMILION, GREEN, ORANGE)

TITLE_SIZE: Final = 12
TEXT_SIZE: Final = 9
NOTE_SIZE: Final = 8
DPI: Final = 160


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure with the Agg canvas."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def dress(axes: Axes) -> None:
    """Give axes thin frames, quiet ticks and a light grid."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(QUIET)
    axes.tick_params(labelsize=TEXT_SIZE, colors=QUIET, labelcolor=INK)
    axes.grid(color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)


def set_title(axes: Axes, title: str, subtitle: str = "") -> None:
    """Write a bold title above the axes, flush left, and a quiet line below it."""
    axes.set_title(title, loc="left", fontsize=TITLE_SIZE, fontweight="bold", color=INK, pad=24 if subtitle else 10)
    if subtitle:
        axes.annotate(
            subtitle,
            (0.0, 1.0),
            (0.0, 8.0),
            xycoords="axes fraction",
            textcoords="offset points",
            fontsize=TEXT_SIZE,
            color=QUIET,
        )


def save(figure: Figure, path_png: Path | str) -> None:
    """Write the figure as a PNG; folders that are missing are made. The same data give the same bytes."""
    path = Path(path_png)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, format="png", dpi=DPI, metadata={"Software": None})
