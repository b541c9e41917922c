"""An animated picture of an arm among moving obstacles: one self-contained SVG file, in real time, over and over.

Browsers and README pages play it; no script is in it. Every value is linear between the given times, which are even.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from planarm.report.style import BLUE, GREEN, INK, ORANGE, QUIET
from planarm.report.workspace import OBSTACLE_COLOUR, CircleOutline, PolygonOutline

WIDTH_PX = 640
EDGE_CM = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class MovingShape:
    """An obstacle and its displacement over the animation's times, shape (n, 2)."""

    shape: CircleOutline | PolygonOutline
    offsets_cm: NDArray[np.float64]


def write_animation(
    path_svg: Path | str,
    *,
    step_s: float,
    joints_cm: NDArray[np.float64],
    obstacles: Sequence[MovingShape],
    path_cm: NDArray[np.float64],
    view_cm: tuple[float, float, float, float],
    title: str,
) -> None:
    """Write the animation; folders that are missing are made.

    Args:
        path_svg: the file.
        step_s: time from each pose to the next.
        joints_cm: base, joints and end effector over time, shape (n, joints + 1, 2), n >= 2.
        obstacles: with displacements at the same times.
        path_cm: the end effector's curve, shape (m, 2).
        view_cm: left, bottom, right and top of what is shown.
        title: what it shows.
    """
    left, bottom, right, top = view_cm
    width, height = right - left + 2.0 * EDGE_CM, top - bottom + 2.0 * EDGE_CM
    dur = f'dur="{step_s * (len(joints_cm) - 1):.3f}s" repeatCount="indefinite"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH_PX}" height="{WIDTH_PX * height / width:.0f}" '
        f'viewBox="{left - EDGE_CM:.2f} {-top - EDGE_CM:.2f} {width:.2f} {height:.2f}">',
        f"<title>{escape(title)}</title>",
        f'<rect x="{left - EDGE_CM:.2f}" y="{-top - EDGE_CM:.2f}" width="{width:.2f}" height="{height:.2f}" '
        'fill="white"/>',
        '<g transform="scale(1,-1)" stroke-linecap="round" stroke-linejoin="round">',
        *(_obstacle(obstacle, dur) for obstacle in obstacles),
        f'<polyline points="{_points(path_cm)}" fill="none" stroke="{BLUE}" stroke-width="0.8"/>',
        _dot(path_cm[0], 1.8, GREEN),
        _dot(path_cm[-1], 2.2, ORANGE),
        _arm(joints_cm, dur),
        "</g>",
        f'<rect x="{left:.2f}" y="{-bottom + 0.4 * EDGE_CM:.2f}" height="1" width="0" fill="{QUIET}">'
        f'<animate attributeName="width" values="0;{right - left:.2f}" {dur}/></rect>',
        "</svg>",
    ]
    path = Path(path_svg)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(parts) + "\n", encoding="utf-8")


def _points(points_cm: NDArray[np.float64]) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points_cm)


def _dot(center_cm: NDArray[np.float64], radius_cm: float, colour: str) -> str:
    return f'<circle cx="{center_cm[0]:.2f}" cy="{center_cm[1]:.2f}" r="{radius_cm}" fill="{colour}" stroke="white"/>'


def _obstacle(obstacle: MovingShape, dur: str) -> str:
    """Draw an obstacle that moves; one that rests has no animation."""
    look = f'fill="{OBSTACLE_COLOUR}" stroke="{INK}" stroke-width="0.4"'
    vertices = getattr(obstacle.shape, "vertices_cm", None)
    if vertices is not None:
        outline = f'<polygon points="{_points(np.asarray(vertices))}" {look}>', "</polygon>"
    else:
        x, y = obstacle.shape.center_cm  # type: ignore[union-attr]  # no vertices: a circle
        radius = obstacle.shape.radius_cm  # type: ignore[union-attr]  # the same
        outline = f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{radius:.2f}" {look}>', "</circle>"
    if not np.ptp(obstacle.offsets_cm, axis=0).any():
        return "".join(outline)
    values = ";".join(f"{x:.2f},{y:.2f}" for x, y in obstacle.offsets_cm)
    moves = f'<animateTransform attributeName="transform" type="translate" values="{values}" {dur}/>'
    return outline[0] + moves + outline[1]


def _arm(joints_cm: NDArray[np.float64], dur: str) -> str:
    """Draw the links as one line through all joints, and the base."""
    values = ";".join(_points(joints) for joints in joints_cm)
    base = joints_cm[0, 0]
    return (
        f'<polyline points="{_points(joints_cm[0])}" fill="none" stroke="{INK}" stroke-width="2">'
        f'<animate attributeName="points" values="{values}" {dur}/></polyline>'
        f'<rect x="{base[0] - 2.5:.2f}" y="{base[1] - 2.5:.2f}" width="5" height="5" fill="{INK}"/>'
    )
