"""Distributions of a campaign's figures: for each figure one picture, a panel a scene, a curve a group of settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from planarm.report.campaign import group_names
from planarm.report.style import BLUE, GREEN, ORANGE, QUIET, TEXT_SIZE, VERMILION, dress, new_figure, save, set_title

CURVES = (BLUE, VERMILION, GREEN, ORANGE, "#CC79A7", "#56B4E9", "#000000", "#F0E442")
STYLES = ("-", "--", "-.", ":")
MOST_CURVES = 12
WIDE = 3.0
"""Largest over smallest figure from which the axis is logarithmic."""


def _by_size(group: tuple[Any, ...]) -> tuple[tuple[bool, float, str], ...]:
    """Sort numbers by value, before words."""
    return tuple((isinstance(v, str), 0.0 if isinstance(v, str) or v is None else float(v), str(v)) for v in group)


def draw_distribution(rows: Sequence[Mapping[str, Any]], figure: str, path_png: Path) -> None:
    """Draw the share of runs whose figure is at most x; runs without it keep a curve below 1."""
    from matplotlib.ticker import LogLocator, NullLocator  # noqa: PLC0415 - takes its time to load

    names = group_names(rows)
    scenes = sorted({str(row["scene"]) for row in rows})
    drawing = new_figure(4.8 * len(scenes) + 0.4, 4.0)
    panels = drawing.subplots(1, len(scenes), sharex=True, sharey=True, squeeze=False)[0]
    others = [name for name in names if name != "scene"]
    drawn = [float(row[figure]) for row in rows if row[figure] is not None]
    wide = min(drawn) > 0.0 and max(drawn) > WIDE * min(drawn)
    for axes, scene in zip(panels, scenes, strict=True):
        dress(axes)
        mine = [row for row in rows if str(row["scene"]) == scene]
        groups = sorted({tuple(row.get(name) for name in others) for row in mine}, key=_by_size)
        for place, group in enumerate(groups[:MOST_CURVES]):
            members = [row for row in mine if tuple(row.get(name) for name in others) == group]
            values = np.sort([float(row[figure]) for row in members if row[figure] is not None])
            share = np.arange(1, len(values) + 1) / len(members)
            label = ", ".join(f"{name.split('.')[-1]} {value}" for name, value in zip(others, group, strict=True))
            axes.step(
                values,
                share,
                where="post",
                color=CURVES[place % len(CURVES)],
                linestyle=STYLES[place // len(CURVES)],
                linewidth=1.4,
                label=f"{label or 'all'} ({len(members):,} runs)",
            )
        set_title(axes, Path(scene).stem, f"share of the runs with {figure} at most x")
        axes.set_ylim(0.0, 1.02)
        if wide:
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.xaxis.set_major_formatter("{x:g}")
        axes.set_xlabel(figure, fontsize=TEXT_SIZE, color=QUIET)
        axes.legend(fontsize=TEXT_SIZE - 1, frameon=False, loc="lower right")
    save(drawing, path_png)
