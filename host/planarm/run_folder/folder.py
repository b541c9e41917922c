"""A run's folder: the plan, the trace, the summary, the record with its page, and the pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planarm.errors import UsageError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.shapes import shape_of
from planarm.output import writing
from planarm.plan_file import StoredPlan, save_plan
from planarm.record.run_record import FORMAT, run_record
from planarm.report import draw_joint_angles, draw_step_rates, draw_tip_error, draw_workspace
from planarm.report.page import run_page
from planarm.run_folder.moving_picture import animate
from planarm_wire.messages import TICKS_HZ

if TYPE_CHECKING:
    from planarm.plan import Plan
    from planarm.record.outcome import Outcome

SUMMARY, RECORD, PAGE = "summary.json", "record.json", "report.html"
POSES_SHOWN = 7
CURVE_POINTS = 600


def begin_run_folder(out: Path, stored: StoredPlan) -> None:
    """Make the folder, `out`, and put the plan in it, before anything moves; what an earlier run left is overwritten.

    Raises:
        OutputError: it cannot be made or written.
    """
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
    save_plan(stored, out / "run.plan")


def finish_run_folder(out: Path, outcome: Outcome) -> None:
    """Put everything else that a person or a program wants to keep of a run into the folder.

    Args:
        out: the folder, which `begin_run_folder` made.
        outcome: the run. Without pins there is no trace.vcd, without an emulated arm no tip_error.png.

    Raises:
        OutputError: a file cannot be written.
    """
    plan, seen = outcome.plan, outcome.seen
    record = run_record(outcome)
    with writing(out):
        (out / SUMMARY).write_text(json.dumps(_summary(outcome), indent=1) + "\n", encoding="utf-8")
        (out / RECORD).write_text(json.dumps(record, separators=(",", ":")) + "\n", encoding="utf-8")
        (out / PAGE).write_text(run_page(record), encoding="utf-8")
        _draw(plan, *(out / name for name in ("workspace.png", "joint_angles.png", "step_rates.png")))
        if plan.moving is not None:
            animate(out / "animation.svg", plan)
        if seen.pins is not None:
            seen.pins.write_vcd(out / "trace.vcd")
        if seen.arm is not None:
            draw_tip_error(out / "tip_error.png", seen.arm.t_s, seen.arm.tip_error_mm, title=plan.scene.name)


def read_record(folder: Path) -> dict[str, Any]:
    """Return the record of a run from its folder.

    Raises:
        UsageError: there is none, or none that this planarm reads.
    """
    path = folder / RECORD
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(
            f"{path}: cannot be read: {error.strerror}; 'planarm run SCENE --out DIR' makes one"
        ) from error
    except ValueError as error:
        raise UsageError(f"{path}: is no record of a run: {error}; run the scene anew") from error
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise UsageError(f"{path}: is no record of format {FORMAT}; run the scene anew")
    return record


def write_page(record: Mapping[str, Any], page: Path) -> None:
    """Write the page of a run.

    Raises:
        OutputError: it cannot be written.
    """
    with writing(page):
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(run_page(record), encoding="utf-8")


def _summary(outcome: Outcome) -> dict[str, Any]:
    """Return the figures, and the error of a run that failed."""
    return {**outcome.summary, **({"error": dict(outcome.error)} if outcome.error else {})}


def _draw(plan: Plan, workspace: Path, joint_angles: Path, step_rates: Path) -> None:
    scene, trajectory = plan.scene, plan.trajectory
    arm = Arm.from_spec(scene.arm)
    t_s = np.linspace(0.0, trajectory.duration_s, CURVE_POINTS)
    q_rad = trajectory.sample(t_s)[0]
    shown = np.linspace(0, len(t_s) - 1, POSES_SHOWN).round().astype(int)
    draw_workspace(
        workspace,
        x_cm=plan.free_map.x_cm,
        y_cm=plan.free_map.y_cm,
        region=plan.free_map.region,
        obstacles=[shape_of(obstacle) for obstacle in scene.obstacles],
        path_points_cm=plan.path.points_cm if plan.joint is None else forward(arm, plan.joint.poses_rad)[:, -1],
        poses_cm=forward(arm, q_rad[shown]),
        title=scene.name,
        subtitle=f"{_search_words(plan)}, {plan.path.length_cm:.4f} cm",
        tip_curve_cm=forward(arm, q_rad)[:, -1],
    )
    draw_joint_angles(joint_angles, t_s, q_rad, limits_rad=scene.arm.joint_limits_rad, title=scene.name)
    draw_step_rates(
        step_rates,
        [joint.ticks for joint in plan.train.steps],
        directions=[joint.directions for joint in plan.train.steps],
        ticks_hz=TICKS_HZ,
        limit_hz=TICKS_HZ / plan.segments.board.min_interval_ticks,
        title=scene.name,
    )


def _search_words(plan: Plan) -> str:
    """Say how the path was found."""
    planner, joint = plan.scene.planner, plan.joint
    if plan.moving is not None:
        path = plan.moving.path
        return (
            f"space and time, {path.arrival} samples of {plan.moving.moving_map.clock.sample_s:g} s, obstacles at 0 s"
        )
    if joint is None:
        return f"{planner.algorithm} ({planner.neighbours})"
    changes = len(joint.changes_cm)
    return f"joint space, least {joint.objective.replace('_', ' ')}, {changes} change{'s' * (changes != 1)} of elbow"
