"""The whole record of a run: one JSON object, which `report/page` turns into a page."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

import planarm
from planarm.explain import check_code
from planarm.model.moving import offset_cm
from planarm.model.shapes import Circle, shape_of
from planarm.plan import Plan
from planarm.record.curves import columns, pin_curves, planned_curves, real_curves, rounded
from planarm.record.events import events_of
from planarm.record.histograms import error_histogram, interval_histogram, pin_names, width_histogram
from planarm.record.outcome import Outcome
from planarm.scene import Obstacle
from planarm.workspace.free_map import RegionMap
from planarm_wire.messages import SPEC_HASH, TICKS_HZ

FORMAT = 1
MOST_CELLS = 160_000
"""Cells of a map that are told; a finer one is thinned out."""
MOVES_TOLD, AFTER_S = 300, 1.0
"""Moments at which a moving obstacle is told, and how long after the motion's end."""
REGIONS = ("free", "beyond reach", "inner hole", "blocked by an obstacle", "joint limit or floor")


def run_record(outcome: Outcome) -> dict[str, Any]:
    """Return everything that a page shows of a run, in units that the keys name; times count from the plan's zero."""
    plan, scene = outcome.plan, outcome.plan.scene
    return {
        "format": FORMAT,
        "kind": "run",
        **plan_record(plan),
        "held_back": plan.timing.words(),
        "verdict": _verdict(outcome),
        "error": outcome.error,
        "summary": dict(outcome.summary),
        "limits": _limits(plan),
        "joints": [pin_names(pins) for pins in scene.board.joint_pins[: len(scene.joints)]],
        "real": None if outcome.seen.arm is None else real_curves(outcome.seen.arm, scene),
        "pins": _pins(outcome),
        "timing": _timing(outcome),
        "stream": _stream(outcome),
        "events": events_of(outcome),
        "certificate": [{"code": check_code(check.name), **asdict(check)} for check in plan.certificate.checks],
    }


def plan_record(plan: Plan) -> dict[str, Any]:
    """Return what a page shows of a plan before it is executed: the workspace, the path, the motion."""
    scene = plan.scene
    return {
        "planarm": planarm.__version__,
        "wire": f"{SPEC_HASH:08x}",
        "title": scene.name,
        "source": scene.source,
        "planner": _planner_words(plan),
        "total_s": plan.segments.duration_ticks / TICKS_HZ,
        "arm": {
            "link_lengths_cm": list(scene.arm.link_lengths_cm),
            "link_width_cm": scene.arm.link_width_cm,
            "base_cm": list(scene.arm.base_cm),
        },
        "map": _map(plan.free_map),
        "obstacles": [_outline(obstacle, plan.trajectory.duration_s) for obstacle in scene.obstacles],
        "start_cm": list(scene.task.start_cm),
        "goal_cm": list(scene.task.goal_cm),
        "path_cm": columns(np.asarray(plan.path.points_cm), 4),
        "planned": planned_curves(plan),
    }


def _verdict(outcome: Outcome) -> dict[str, str]:
    """Return the run's colour, and why, in a word and a sentence."""
    plan, findings, arm = outcome.plan, outcome.seen.findings, outcome.seen.arm
    if outcome.error is not None:
        return {"state": "red", "word": "failed", "why": str(outcome.error["message"])}
    if findings is not None and not findings.comparison.agrees:
        return {"state": "red", "word": "steps differ", "why": findings.comparison.explain()}
    if arm is not None and not arm.clean:
        return {"state": "red", "word": "arm off plan", "why": arm.explain()}
    amber = [check.name for check in plan.certificate.checks if check.verdict == "amber"]
    seen = "by the device's ledger" if findings is None else findings.comparison.explain()
    if amber:
        return {"state": "amber", "word": "executed, look at", "why": f"{', '.join(amber)}; {seen}"}
    return {"state": "green", "word": "executed exactly", "why": seen}


def _planner_words(plan: Plan) -> str:
    """Say how the path was found."""
    planner = plan.scene.planner
    if plan.joint is not None:
        return f"joint space, least {plan.joint.objective.replace('_', ' ')}"
    if plan.moving is not None:
        return f"in space and time, moves {planner.moves}"
    return f"{planner.algorithm} ({planner.neighbours}), moves {planner.moves}"


def _limits(plan: Plan) -> dict[str, Any]:
    joints, arm = plan.scene.joints, plan.scene.arm
    return {
        "q_deg": [[round(float(np.degrees(limit)), 4) for limit in pair] for pair in arm.joint_limits_rad],
        "speed_deg_s": rounded(np.degrees([joint.max_speed_rad_s for joint in joints]), 4),
        "acceleration_deg_s2": rounded(np.degrees([joint.max_acceleration_rad_s2 for joint in joints]), 4),
        "acceleration_share": plan.scene.motion.acceleration_share,
        "torque_percent": 100.0 * plan.scene.motion.torque_share,
        "step_rate_hz": round(TICKS_HZ / plan.segments.board.min_interval_ticks, 1),
    }


def _map(free_map: RegionMap) -> dict[str, Any]:
    """Return the map's regions as runs along its rows: for each region a flat list of row, first column, columns."""
    region = free_map.region
    stride = max(1, int(np.ceil(np.sqrt(region.size / MOST_CELLS))))
    region = region[::stride, ::stride]
    return {
        "x0_cm": float(free_map.x_cm[0]),
        "y0_cm": float(free_map.y_cm[0]),
        "cell_cm": free_map.cell_cm * stride,
        "rows": region.shape[0],
        "columns": region.shape[1],
        "names": list(REGIONS),
        "runs": _runs(region),
    }


def _runs(region: NDArray[np.uint8]) -> list[list[int]]:
    flat = np.concatenate([region, np.full((len(region), 1), 255, np.uint8)], axis=1).ravel()
    first = np.concatenate([[0], np.flatnonzero(np.diff(flat)) + 1])
    lengths = np.diff(np.concatenate([first, [len(flat)]]))
    rows, column = np.divmod(first, region.shape[1] + 1)
    table = np.stack([rows, column, lengths], axis=1)
    return [table[flat[first] == code].ravel().tolist() for code in range(len(REGIONS))]


def _outline(obstacle: Obstacle, duration_s: float) -> dict[str, Any]:
    """Return an obstacle where it stands at time 0, and how far it has moved from there at even times, if it moves."""
    shape = shape_of(obstacle)
    if isinstance(shape, Circle):
        told: dict[str, Any] = {"center_cm": list(shape.center_cm), "radius_cm": shape.radius_cm}
    else:
        told = {"vertices_cm": [list(vertex) for vertex in shape.vertices_cm]}
    if obstacle.motion is None:
        return told
    t_s = np.linspace(0.0, duration_s + AFTER_S, MOVES_TOLD)
    offsets = np.array([offset_cm(obstacle.motion, float(t)) for t in t_s])
    return {**told, "motion": {"t_s": rounded(t_s, 5), "offset_cm": columns(offsets, 4)}}


def _pins(outcome: Outcome) -> dict[str, Any] | None:
    findings = outcome.seen.findings
    if findings is None or not any(len(joint.ticks) for joint in findings.measured):
        return None
    times = [(joint.ticks - outcome.seen.start_tick) / TICKS_HZ for joint in findings.measured]
    end_s = max(float(t[-1]) for t in times if len(t))
    return pin_curves(times, [joint.directions for joint in findings.measured], end_s)


def _timing(outcome: Outcome) -> dict[str, Any]:
    findings, pins, plan = outcome.seen.findings, outcome.seen.pins, outcome.plan
    if findings is None or pins is None:
        planned = [joint.ticks for joint in plan.train.steps]
        return {"errors": None, "intervals": interval_histogram(planned), "widths": None}
    edges = [pins.edges(pin) for pin in plan.segments.board.step_pins[: len(findings.measured)]]
    pulses = [(e["cycle"][e["level"] == 1], e["cycle"][e["level"] == 0]) for e in edges]
    return {
        "errors": error_histogram(plan.segments, findings, outcome.seen.start_tick),
        "intervals": interval_histogram([joint.ticks for joint in findings.measured]),
        "widths": width_histogram(pulses),
    }


def _stream(outcome: Outcome) -> dict[str, Any] | None:
    """Return the device's queue and path time over time."""
    start_s = outcome.start_s
    if start_s is None or not outcome.samples:
        return None
    return {
        "t_s": [round(sample.at_s - start_s, 6) for sample in outcome.samples],
        "path_s": [round(sample.path_s, 6) for sample in outcome.samples],
        "buffered_ms": [round(1e3 * buffered_s, 3) for buffered_s in outcome.buffered_s()],
    }
