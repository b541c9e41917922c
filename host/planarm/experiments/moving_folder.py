"""The folder of the comparison with paper B: moving.json, moving.md, and pictures like its figures 5 to 16."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planarm.experiments.moving import Environment, Moving
from planarm.experiments.moving_published import PUBLISHED
from planarm.experiments.moving_tables import as_json, as_markdown
from planarm.model.arm import Arm
from planarm.model.kinematics import ElbowSide, forward
from planarm.model.moving import offset_cm, shape_at
from planarm.model.shapes import Circle, Polygon, shape_of
from planarm.notice import Notice, silent
from planarm.report.animation import MovingShape, write_animation
from planarm.report.curves import draw_joint_angles
from planarm.report.moving import Frame, draw_angle_changes, draw_costs, draw_frames, draw_free_spaces, draw_paths
from planarm.search.moving.timed_path import TimedPath
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.timed_spline import from_nodes
from planarm.workspace.moving_map import build_moving_map

ANIMATION_STEPS = 4
"""Poses of an animation for each motion sample."""


def write_moving(result: Moving, out: Path, notice: Notice = silent) -> list[Path]:
    """Write everything and return the files; those of an earlier comparison are overwritten."""
    out.mkdir(parents=True, exist_ok=True)
    files = [out / "moving.json", out / "moving.md"]
    files[0].write_text(json.dumps(as_json(result), indent=1) + "\n", encoding="utf-8")
    files[1].write_text(as_markdown(result), encoding="utf-8")
    for done, one in enumerate(result.environments):
        notice("pictures", done / len(result.environments))
        files += _draw(one, out / f"env{one.number}")
    notice("pictures", 1.0)
    return files


def _draw(one: Environment, stem: Path) -> list[Path]:
    """Draw one environment; return the files."""
    name = one.scene.name
    files = [_named(stem, "free_space.png"), _named(stem, "costs.png")]
    draw_free_spaces(files[0], _free_spaces(one), _extent_cm(one), f"{name}: free Cartesian space (Figs. 5 and 11)")
    curves = {swarm.name: swarm.result.curve_cm for swarm in one.swarms}
    draw_costs(files[1], curves, f"{name}: cost (Figs. 7b and 13b)", f"D*'s path: {one.d_star_cm:.4f} cm")
    for column in one.columns:
        if column.path is not None and column.path.arrival:
            files.append(_named(stem, f"{column.way}.png"))
            words = f"{name}: {column.way}, {column.outcome}" + (f"; {column.contact}" if column.contact else "")
            draw_frames(files[-1], _frames(one, column.path), _extent_cm(one), column.path.points_cm, words)
    return files + _draw_motions(one, stem)


def _draw_motions(one: Environment, stem: Path) -> list[Path]:
    """Draw the swarm's motion within the joints' limits, or the path it kept, and animate it."""
    arm, sample_s = Arm.from_spec(one.scene.arm), one.moving_map.clock.sample_s
    swarm = one.swarms[-1].result
    spline = swarm.spline or from_nodes(arm, one.base, sample_s)
    t_s = np.linspace(0.0, float(spline.borders_s[-1]), ANIMATION_STEPS * one.base.arrival + 1)
    q_rad = spline.evaluate(t_s, "left").q_rad
    files = [_named(stem, part) for part in ("paths.png", "angles.png", "changes.png", "animation.svg")]
    tips = {f"D* run, {one.base.length_cm:.2f} cm walked": one.base.points_cm}
    for one_swarm in one.swarms:
        if one_swarm.result.spline is not None:
            tips[f"PSO {one_swarm.name}, {one_swarm.result.length_cm:.2f} cm"] = _tips(one_swarm.result.spline)
    draw_paths(files[0], tips, f"{one.scene.name}: paths (Figs. 7a and 13a)")
    subtitle = f"along the swarm's motion, {swarm.length_cm:.4f} cm"
    draw_joint_angles(files[1], t_s, q_rad, title=f"{one.scene.name}: joint angles", subtitle=subtitle)
    changes = np.diff(q_rad[::ANIMATION_STEPS], axis=0)
    draw_angle_changes(files[2], changes, f"{one.scene.name}: change in joint angles (Figs. 10 and 16)", subtitle)
    obstacles = [
        MovingShape(shape_of(o), np.array([offset_cm(o.motion, float(t)) for t in t_s])) for o in one.scene.obstacles
    ]
    workspace = one.scene.workspace
    write_animation(
        files[3],
        step_s=float(t_s[1]),
        joints_cm=forward(arm, q_rad),
        obstacles=obstacles,
        path_cm=_tips(spline),
        view_cm=(workspace.x_cm[0], -12.0, workspace.x_cm[1], workspace.y_cm[1] + 10.0),
        title=f"{one.scene.name}: the swarm's motion, {swarm.length_cm:.2f} cm in {t_s[-1]:.1f} s",
    )
    return files


def _tips(spline: JointSpline) -> NDArray[np.float64]:
    return spline.tip_cm(np.linspace(0.0, float(spline.borders_s[-1]), 400))


def _named(stem: Path, part: str) -> Path:
    return stem.with_name(f"{stem.name}_{part}")


def _extent_cm(one: Environment) -> tuple[float, float, float, float]:
    half, workspace = 0.5 * one.moving_map.cell_cm, one.scene.workspace
    (left, right), (bottom, top) = workspace.x_cm, workspace.y_cm
    return left - half, right + half, bottom - half, top + half


def _free_spaces(one: Environment) -> list[tuple[str, dict[str, NDArray[np.bool_]], list[Circle | Polygon]]]:
    """Return the free spaces at the published samples, for both sides."""
    sides: tuple[ElbowSide, ElbowSide] = ("down", "up")
    maps = {side: build_moving_map(one.scene, side, between=False) for side in sides}
    rows = []
    for sample in PUBLISHED[one.number].free_spaces:
        free: dict[str, NDArray[np.bool_]] = {side: maps[side].nodes(sample) for side in sides}
        free["both"] = free["down"] | free["up"]
        shapes = [shape_at(o, sample * one.moving_map.clock.sample_s) for o in one.scene.obstacles]
        rows.append((f"sample {sample}", free, shapes))
    return rows


def _frames(one: Environment, path: TimedPath) -> list[Frame]:
    """Return the published moments that a run has, its first steps backward, start and end."""
    published = PUBLISHED[one.number]
    backs = [b for b in path.backs if b - 1 not in path.backs][:4]
    wanted = sorted({0, *(f for f in published.frames if f < path.arrival), *backs, path.arrival})[:8]
    arm, frames = Arm.from_spec(one.scene.arm), []
    for sample in wanted:
        back = sample in path.backs
        frames.append(
            Frame(
                f"sample {sample}" + (": backward" if back else ""),
                one.moving_map.nodes(sample),
                [shape_at(o, sample * one.moving_map.clock.sample_s) for o in one.scene.obstacles],
                forward(arm, path.q_rad[sample]),
                path.points_cm[: sample + 1],
                back,
            )
        )
    return frames
