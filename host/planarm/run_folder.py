"""A run's folder: the plan, the trace, the summary and the pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.shapes import shape_of
from planarm.output import writing
from planarm.plan_file import StoredPlan, save_plan
from planarm.report import draw_joint_angles, draw_step_rates, draw_tip_error, draw_workspace
from planarm_wire.messages import MIN_INTERVAL_TICKS, TICKS_HZ

if TYPE_CHECKING:
    from planarm.arm_findings import ArmFindings
    from planarm.link.transport import PinTrace
    from planarm.plan import Plan

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


def finish_run_folder(
    out: Path, plan: Plan, summary: Mapping[str, Any], trace: PinTrace | None, arm: ArmFindings | None = None
) -> None:
    """Put everything else that a person or a program wants to keep of a run into the folder.

    Args:
        out: the folder, which `begin_run_folder` made.
        plan: the plan with its stages.
        summary: the run's figures.
        trace: the emulated board's pins; None leaves out trace.vcd.
        arm: what the emulated arm did; None leaves out tip_error.png.

    Raises:
        OutputError: a file cannot be written.
    """
    with writing(out):
        (out / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
        _draw(plan, *(out / name for name in ("workspace.png", "joint_angles.png", "step_rates.png")))
        if trace is not None:
            trace.write_vcd(out / "trace.vcd")
        if arm is not None:
            draw_tip_error(out / "tip_error.png", arm.t_s, arm.tip_error_mm, title=plan.scene.name)


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
        limit_hz=TICKS_HZ / MIN_INTERVAL_TICKS,
        title=scene.name,
    )


def _search_words(plan: Plan) -> str:
    """Say how the path was found."""
    planner, joint = plan.scene.planner, plan.joint
    if joint is None:
        return f"{planner.algorithm} ({planner.neighbours})"
    changes = len(joint.changes_cm)
    return f"joint space, least {joint.objective.replace('_', ' ')}, {changes} change{'s' * (changes != 1)} of elbow"
