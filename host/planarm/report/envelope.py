"""Pictures of maps of the workspace: a value for each cell, white where there is none."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from planarm.report.style import INK, QUIET, TEXT_SIZE, dress, new_figure, save, set_title

Floats = NDArray[np.float64]

COLOURS: Final = "cividis"
"""Even steps of lightness, and the same for those who do not tell red from green."""


WIDTH_IN: Final = 11.0


class CellMap(NamedTuple):
    """One map to draw."""

    title: str
    unit: str
    values: Floats
    most: float
    """Values from here on have the last colour: they grow without bound near singular poses."""


class Maps(Protocol):
    """The maps of a workspace, each of shape (rows, columns)."""

    @property
    def x_cm(self) -> Floats:
        """The columns."""

    @property
    def y_cm(self) -> Floats:
        """The rows."""

    @property
    def tip_error_mm(self) -> Floats:
        """Largest error of the tip."""

    @property
    def hz_per_cm_s(self) -> Floats:
        """Step rate for a speed of the tip."""

    @property
    def largest_cm_s(self) -> Floats:
        """Largest speed of the tip."""

    @property
    def manipulability_cm2(self) -> Floats:
        """|det J|."""


def draw_envelope(path_png: Path, maps: Maps, title: str, base_cm: tuple[float, float]) -> None:
    """Draw the four maps of an arm's envelope."""
    steps_most = 4.0 * float(np.nanmedian(maps.hz_per_cm_s))
    drawn = [
        CellMap("Tip error: half a micro-step, half the play", "mm", maps.tip_error_mm, inf),
        CellMap("Steps for 1 cm of the tip, worst direction", "1/cm", maps.hz_per_cm_s, steps_most),
        CellMap("Largest speed of the tip, worst direction", "cm/s", maps.largest_cm_s, inf),
        CellMap("Manipulability |det J|", "cm²", maps.manipulability_cm2, inf),
    ]
    draw_cell_maps(path_png, maps.x_cm, maps.y_cm, drawn, title, base_cm)


def draw_cell_maps(
    path_png: Path, x_cm: Floats, y_cm: Floats, maps: Sequence[CellMap], title: str, base_cm: tuple[float, float]
) -> None:
    """Draw maps over one workspace side by side, two in a row."""
    rows = (len(maps) + 1) // 2
    # A map takes three quarters of its half of the width; its title, numbers and names are 1 inch high.
    map_in = 0.75 * 0.5 * WIDTH_IN * float(np.ptp(y_cm) / np.ptp(x_cm))
    figure = new_figure(WIDTH_IN, 0.5 + rows * (1.0 + map_in))
    figure.suptitle(title, x=0.01, ha="left", fontsize=13, fontweight="bold", color=INK)
    half = 0.5 * float(x_cm[1] - x_cm[0])
    extent = (x_cm[0] - half, x_cm[-1] + half, y_cm[0] - half, y_cm[-1] + half)
    for number, one in enumerate(maps, start=1):
        axes = figure.add_subplot(rows, 2, number)
        shown = np.minimum(one.values, one.most)
        image = axes.imshow(shown, origin="lower", extent=extent, cmap=COLOURS, aspect="equal", interpolation="nearest")
        axes.plot(*base_cm, marker="o", markersize=5, color=INK, clip_on=False)
        dress(axes)
        axes.grid(visible=False)
        set_title(axes, one.title)
        axes.set_xlabel("x (cm)", fontsize=TEXT_SIZE, color=QUIET)
        axes.set_ylabel("y (cm)", fontsize=TEXT_SIZE, color=QUIET)
        beyond = bool(np.nanmax(one.values) > one.most)
        beside = axes.inset_axes((1.03, 0.0, 0.035, 1.0))  # as high as the map
        bar = figure.colorbar(image, cax=beside, extend="max" if beyond else "neither")
        bar.set_label(one.unit, fontsize=TEXT_SIZE, color=QUIET)
        bar.ax.tick_params(labelsize=TEXT_SIZE, colors=QUIET, labelcolor=INK)
    save(figure, path_png)
