"""What a run did, as one flat mapping: the object of `--json`, summary.json and the table on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from planarm.link.position import moved_usteps
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, tip_jacobian
from planarm.model.transmission import Transmission
from planarm_wire.messages import TICKS_HZ

if TYPE_CHECKING:
    from planarm.link.exchange import StreamResult
    from planarm.plan import Findings, Plan
    from planarm.record.arm_findings import ArmFindings


def summarise(
    plan: Plan, streamed: StreamResult, findings: Findings | None, arm: ArmFindings | None = None
) -> dict[str, Any]:
    """Return every figure of a run.

    Args:
        plan: what was planned.
        streamed: what the link and the device's ledger say.
        findings: what the pins showed; None when they cannot be seen (a port that is not in this process).
        arm: what the emulated arm did; None when there is none.
    """
    by_ledger_usteps = moved_usteps(streamed.ledger_before, streamed.ledger_after)[: len(plan.scene.joints)]
    net_usteps = by_ledger_usteps if findings is None else tuple(m.net_usteps for m in findings.measured)
    return {
        **planned_figures(plan),
        "bytes_sent": streamed.bytes_sent,
        "retransmissions": streamed.retransmissions,
        **_line_figures(streamed),
        **_clock_figures(streamed),
        "net_usteps_by_ledger": list(by_ledger_usteps),
        "net_usteps": list(net_usteps),
        **tip_figures(plan, net_usteps),
        **seen_figures(findings, arm),
    }


def _line_figures(streamed: StreamResult) -> dict[str, float]:
    """Return what the plan asked of the line and what that carried; nothing when all fitted into the queue."""
    margin = streamed.margin
    if margin is None or margin.seen.bytes_s is None:
        return {}
    return {
        "line_asked_bytes_s": round(margin.asked_bytes_s, 1),
        "line_seen_bytes_s": round(margin.seen.bytes_s, 1),
        "line_bandwidth_margin": round(margin.seen.bytes_s / max(margin.asked_bytes_s, 1.0), 2),
        "path_clock_percent": margin.percent,
    }


def _clock_figures(streamed: StreamResult) -> dict[str, float]:
    """Return what was learnt of the board's clock: its drift, how sure, and how surely moments and start are known."""
    clock, began_s = streamed.board_clock, streamed.began_s
    if clock is None or began_s is None:
        return {}
    return {
        "board_clock_drift_ppm": round(clock.drift_ppm.middle, 1),
        "board_clock_drift_plus_minus_ppm": round(clock.drift_ppm.plus_minus, 1),
        "board_clock_plus_minus_ms": round(1e3 * clock.moment_s, 3),
        "board_clock_restarts": clock.restarts,
        "start_plus_minus_ms": round(1e3 * began_s.plus_minus, 3),
    }


def planned_figures(plan: Plan) -> dict[str, Any]:
    """Return the figures that are known before anything moves."""
    scene = plan.scene
    return {
        "scene": scene.name,
        "planner": scene.planner.algorithm,
        "neighbours": scene.planner.neighbours,
        "seed": scene.planner.seed,
        "moves": scene.planner.moves,
        "space": "time" if plan.moving else "tip" if plan.joint is None else "joint",
        "elbow_changes": 0 if plan.joint is None else len(plan.joint.changes_cm),
        **plan.length_figures(),
        "search_ms": round(plan.search_ms, 3),
        "plan_ms": round(plan.plan_ms, 3),
        "objective": scene.planner.objective,
        **plan.timing.figures(),
        **_moving_figures(plan),
        "certificate_ok": plan.certificate.ok,
        "segments": len(plan.segments.segments),
        "steps_planned": [len(joint.ticks) for joint in plan.train.steps],
    }


def seen_figures(findings: Findings | None, arm: ArmFindings | None) -> dict[str, Any]:
    """Return the figures that pins and emulated arm give, whether or not the motion came to its end."""
    return {**_pin_figures(findings), **(arm.figures() if arm else {})}


def _moving_figures(plan: Plan) -> dict[str, Any]:
    """Return the figures of a plan among moving obstacles; none where obstacles rest."""
    route = plan.moving
    if route is None:
        return {}
    return {
        "planner": "space_time",
        "neighbours": 8,
        "sample_s": route.moving_map.clock.sample_s,
        "arrival_sample": route.path.arrival,
        "waits": len(route.path.waits),
        "delay_margin_s": round(route.delay_margin_s, 6),
        "node_path_length_cm": round(route.path.length_cm, 6),
        "moves_proved_one_by_one": route.proofs,
        "map_ms": round(1e3 * route.map_s, 3),
        "rules": [run.figures() for run in route.rules],
    }


def tip_figures(plan: Plan, net_usteps: tuple[int, ...]) -> dict[str, float]:
    """Return how far the end effector stands from the goal, and how far half a micro-step a joint can put it."""
    arm = Arm.from_spec(plan.scene.arm)
    transmission = Transmission.of(plan.scene)
    q_rad = transmission.q_rad(np.array(plan.segments.start_usteps) + np.array(net_usteps))
    goal_cm = np.array(plan.scene.task.goal_cm)
    half_steps_cm = np.hypot(*(tip_jacobian(arm, q_rad) @ (0.5 * transmission.rad_per_ustep)))
    return {
        "tip_error_mm": round(10.0 * float(np.hypot(*(forward(arm, q_rad)[-1] - goal_cm))), 6),
        "tip_bound_mm": round(10.0 * float(half_steps_cm.sum()), 6),
    }


def _pin_figures(findings: Findings | None) -> dict[str, Any]:
    """Return the figures that need the pins' edges; None each when the pins cannot be seen."""
    if findings is None:
        return dict.fromkeys(
            (
                "steps_at_pins",
                "max_step_timing_error_ticks",
                "min_pulse_high_us",
                "min_pulse_low_us",
                "min_dir_setup_us",
            )
        )
    comparison, measured = findings.comparison, findings.measured
    return {
        "steps_at_pins": list(comparison.steps_at_pins),
        "max_step_timing_error_ticks": comparison.max_timing_error_ticks,
        "min_pulse_high_us": _least_us([m.min_high_ticks for m in measured]),
        "min_pulse_low_us": _least_us([m.min_low_ticks for m in measured]),
        "min_dir_setup_us": _least_us([m.min_dir_setup_ticks for m in measured]),
    }


def _least_us(ticks: list[int | None]) -> float | None:
    known = [t for t in ticks if t is not None]
    return 1e6 * min(known) / TICKS_HZ if known else None
