"""Curves over time, one panel a joint: angles (as in paper C, Fig. 12) and step rates."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planarm.report.style import INK, JOINT_COLOURS, NOTE_SIZE, QUIET, TEXT_SIZE, dress, new_figure, save, set_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_joint_angles(
    path_png: Path | str,
    t_s: ArrayLike,
    q_rad: ArrayLike,
    *,
    title: str,
    subtitle: str = "",
    limits_rad: Sequence[tuple[float, float]] | None = None,
) -> None:
    """Draw each joint's angle in degrees over seconds, with its first and last value and its limits.

    Limits are told in words above each panel, and drawn as a line where the curve comes near.

    Args:
        path_png: the file to write.
        t_s: times, ascending, shape (m,), m >= 1.
        q_rad: joint angles, shape (m, joints).
        title: above the picture.
        subtitle: a quiet line below the title.
        limits_rad: least and greatest angle of each joint.

    Raises:
        ValueError: the arrays do not have these shapes.
    """
    times, angles = np.asarray(t_s, dtype=np.float64), np.degrees(np.asarray(q_rad, dtype=np.float64))
    if times.ndim != 1 or angles.ndim != 2 or len(times) != len(angles) or not len(times):
        raise ValueError(f"t_s has the shape {times.shape} and q_rad {angles.shape}, expected (m,) and (m, joints)")
    figure, panels = _panels(angles.shape[1])
    for joint, axes in enumerate(panels):
        colour = JOINT_COLOURS[joint % len(JOINT_COLOURS)]
        axes.plot(times, angles[:, joint], color=colour, linewidth=2.0)
        for index in (0, -1):
            _mark(axes, times[index], angles[index, joint], colour, last=index == -1)
        axes.margins(x=0.08, y=0.16)
        axes.set_ylabel(f"θ{_subscript(joint + 1)} (°)", fontsize=TEXT_SIZE + 1, color=INK)
        if limits_rad is not None:
            low, high = (float(limit) for limit in np.degrees(limits_rad[joint]))
            _note(axes, f"limits {_degrees(low)} and {_degrees(high)}")
            _draw_limits(axes, (low, high))
    _finish(figure, panels, title, subtitle, path_png)


def draw_step_rates(
    path_png: Path | str,
    step_ticks: Sequence[ArrayLike],
    *,
    ticks_hz: float,
    title: str,
    subtitle: str = "",
    limit_hz: float | None = None,
    directions: Sequence[ArrayLike] | None = None,
) -> None:
    """Draw how fast each joint steps: one over the time between two steps, over seconds.

    Args:
        path_png: the file to write.
        step_ticks: each joint's moments of steps in ticks, ascending, shape (n,); n may be 0.
        ticks_hz: ticks a second.
        title: above the picture.
        subtitle: a quiet line below the title.
        limit_hz: the highest rate allowed, in steps a second.
        directions: +1 or -1 for each step; with them, a joint that turns back is drawn below zero.

    Raises:
        ValueError: a joint's ticks are not ascending, or its directions are not as many.
    """
    figure, panels = _panels(len(step_ticks))
    end_s = max((float(np.max(ticks)) / ticks_hz for ticks in map(np.asarray, step_ticks) if ticks.size), default=0.0)
    for joint, axes in enumerate(panels):
        ticks = np.asarray(step_ticks[joint], dtype=np.int64)
        signs = np.ones(len(ticks)) if directions is None else np.asarray(directions[joint], dtype=np.float64)
        times_s, rates_hz = _step_rates(ticks, signs, ticks_hz, joint)
        colour = JOINT_COLOURS[joint % len(JOINT_COLOURS)]
        axes.fill_between(times_s, rates_hz, step="post", color=colour, alpha=0.16, linewidth=0)
        axes.plot(times_s, rates_hz, color=colour, linewidth=1.4, drawstyle="steps-post")
        axes.axhline(0.0, color=QUIET, linewidth=0.8)
        axes.set_ylabel(f"joint {joint + 1} (steps/s)", fontsize=TEXT_SIZE, color=INK)
        axes.set_xlim(-0.02 * end_s, 1.02 * end_s if end_s else 1.0)
        axes.margins(y=0.12)
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:,.0f}".replace("-", "−"))
        allowed = "" if limit_hz is None else f", limit {limit_hz:,.0f}"
        if rates_hz.size:
            _note(axes, f"{len(ticks):,} steps, fastest {np.abs(rates_hz).max():,.0f} steps/s{allowed}")
        else:
            _note(axes, f"{len(ticks)} steps, so no rate")
            axes.set_ylim(0.0, 1.0 if limit_hz is None else limit_hz)
        if limit_hz is not None:
            _draw_limits(axes, (-limit_hz, limit_hz))
    _finish(figure, panels, title, subtitle, path_png)


def draw_tip_error(
    path_png: Path | str, t_s: ArrayLike, error_mm: ArrayLike, *, title: str, subtitle: str = ""
) -> None:
    """Draw how far the end effector was from where the plan has it, over seconds, with its largest value.

    Args:
        path_png: the file to write.
        t_s: times, ascending, shape (m,), m >= 1.
        error_mm: distances, shape (m,).
        title: above the picture.
        subtitle: a quiet line below the title.
    """
    times, errors = np.asarray(t_s, dtype=np.float64), np.asarray(error_mm, dtype=np.float64)
    figure, panels = _panels(1)
    axes, worst = panels[0], int(np.argmax(errors))
    axes.fill_between(times, errors, color=JOINT_COLOURS[0], alpha=0.16, linewidth=0)
    axes.plot(times, errors, color=JOINT_COLOURS[0], linewidth=1.2)
    axes.plot(times[worst], errors[worst], "o", color=JOINT_COLOURS[0], markeredgecolor="white", markersize=7)
    axes.set_ylabel("tip error (mm)", fontsize=TEXT_SIZE, color=INK)
    axes.set_ylim(0.0, max(1.15 * float(errors[worst]), 1e-3))
    _note(axes, f"largest {errors[worst]:.3f} mm at {times[worst]:.3f} s")
    _finish(figure, panels, title, subtitle, path_png)


def _step_rates(
    ticks: NDArray[np.int64], signs: NDArray[np.float64], ticks_hz: float, joint: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times in s and signed rates in steps/s, the last one repeated so that it is drawn to its end."""
    if len(signs) != len(ticks):
        raise ValueError(f"joint {joint + 1}: {len(signs)} directions for {len(ticks)} steps")
    gaps = np.diff(ticks)
    if np.any(gaps <= 0):
        at = int(np.argmax(gaps <= 0)) + 1
        raise ValueError(f"joint {joint + 1}: step {at} at tick {ticks[at]} does not come after step {at - 1}")
    if len(gaps) == 0:
        return np.empty(0), np.empty(0)
    rates_hz = signs[1:] * ticks_hz / gaps
    return ticks / ticks_hz, np.append(rates_hz, rates_hz[-1])


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    if count < 1:
        raise ValueError("there is no joint to draw")
    figure = new_figure(9.0, 1.3 + 2.1 * count)
    panels = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    for axes in panels:
        dress(axes)
    return figure, panels


def _finish(figure: Figure, panels: list[Axes], title: str, subtitle: str, path_png: Path | str) -> None:
    set_title(panels[0], title, subtitle)
    panels[-1].set_xlabel("time (s)", fontsize=TEXT_SIZE, color=INK)
    figure.align_ylabels(panels)
    save(figure, path_png)


def _mark(axes: Axes, t_s: float, angle_deg: float, colour: str, *, last: bool) -> None:
    axes.plot(t_s, angle_deg, "o", color=colour, markeredgecolor="white", markersize=7, zorder=5)
    axes.annotate(
        _degrees(angle_deg),
        (t_s, angle_deg),
        (7 if last else -7, 0),
        textcoords="offset points",
        ha="left" if last else "right",
        va="center",
        fontsize=NOTE_SIZE,
        color=INK,
    )


def _note(axes: Axes, text: str) -> None:
    """Write a quiet line above the panel, flush right."""
    axes.annotate(text, (1.0, 1.01), xycoords="axes fraction", ha="right", va="bottom", fontsize=NOTE_SIZE, color=QUIET)


def _draw_limits(axes: Axes, limits: tuple[float, float]) -> None:
    """Draw each limit that the curve comes near to; one far away would squeeze the curve."""
    bottom, top = axes.get_ylim()
    near = 0.3 * (top - bottom)
    for limit in limits:
        if bottom - near <= limit <= top + near:
            axes.axhline(limit, color=INK, linewidth=1.3, linestyle=(0, (5, 3)))
            bottom, top = min(bottom, limit - 0.2 * near), max(top, limit + 0.2 * near)
    axes.set_ylim(bottom, top)


def _degrees(angle_deg: float) -> str:
    return f"{angle_deg:.1f}°".replace("-", "−")


def _subscript(number: int) -> str:
    return "".join("₀₁₂₃₄₅₆₇₈₉"[int(digit)] for digit in str(number))
