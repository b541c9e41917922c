"""The whole flow as one readable function: from a scene file to counted steps at the pins.

scene -> FreeMap -> Path -> SmoothPath -> Trajectory -> StepTrain -> SegmentPlan -> frames -> pins -> edges -> findings
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from planarm.errors import (
    CertificateError,
    DeviceFault,
    HostKilledError,
    LinkError,
    OutputError,
    StepsDifferError,
)
from planarm.link.arm_record import ArmSetup
from planarm.link.positions import Positions, default_path
from planarm.link.stream import StreamProgress
from planarm.link.transport import open_transport, require_port
from planarm.model.arm import Arm
from planarm.motions.margin import planning_margin_cm
from planarm.motions.motion import motion_along, tip_curve_cm
from planarm.notice import Notice
from planarm.plan import Plan
from planarm.plan_file import StoredPlan
from planarm.record.look import look_at
from planarm.record.outcome import Outcome, StreamLog
from planarm.routes.moving_route import find_moving_route
from planarm.routes.route import SEARCHED, Route, find_route
from planarm.run_folder.folder import begin_run_folder, finish_run_folder
from planarm.run_folder.summary import planned_figures, seen_figures, summarise
from planarm.scene import Scene
from planarm.search.path import Path as TipPath
from planarm.stepping.calmer import with_advice
from planarm.stepping.certify import certify
from planarm.stepping.schedule import encode, schedule
from planarm.streaming.carry_out import carry_out
from planarm.streaming.onlooker import Onlooker
from planarm.streaming.plan_stream import record, warn_before
from planarm.streaming.standing import settle_start
from planarm.trajectory.binding import report_timing
from planarm.trajectory.limits import Limits
from planarm.trajectory.motion import Trajectory
from planarm.workspace.free_map import build_free_map

LEFT_BEHIND = (
    "the arm follows its path until the board's queue runs dry and rests there; the board knows where: 'planarm status'"
)
"""What becomes of a motion whose journal cannot be written any more."""

SETTLE_AFTER_FAILURE_S = 1.0
"""Emulated time after a stream that failed: what the board has queued is executed, and the arm comes to rest."""


def plan_scene(scene: Scene, notice: Notice, route: Route | None = None, *, advise: bool = False) -> Plan:
    """Plan, time, quantise, compress and certify; a route that is known is not searched.

    With `advise` a certificate that is red for swings names accelerations that pass: motions are timed to find them.

    Raises:
        SceneError: Start or goal cannot be taken.
        NoPathError: Nothing joins them; the message says why.
        TimingError: A joint would have to step faster than the firmware can, or the motion would take too long.
    """
    began_s = time.perf_counter()
    notice("plan", 0.0)
    _ = scene.board  # an arm that no board moves is refused before it is searched
    margin_cm = planning_margin_cm(scene)
    if scene.moving is not None:
        return plan_moving(scene, margin_cm, began_s, notice)
    route = route or find_route(scene, margin_cm, notice)
    notice("plan", SEARCHED)
    motion = motion_along(scene, route, margin_cm, notice)
    trajectory, train, segments = schedule(scene, motion.under, lambda share: notice("plan", 0.6 + 0.2 * share))
    notice("plan", 0.8)
    certificate = certify(scene, trajectory, train, segments)
    if advise and scene.planner.objective != "time":  # whose path would be another
        calmer = partial(motion_along, route=route, margin_cm=margin_cm, notice=notice)
        certificate = with_advice(scene, certificate, lambda changed: calmer(changed).trajectory)
    notice("plan", 1.0)
    return Plan(
        scene,
        route.free_map,
        motion.path,
        trajectory.path,
        trajectory,
        train,
        segments,
        certificate,
        plan_ms=1e3 * (time.perf_counter() - began_s),
        timing=replace(motion.timing, executed_s=trajectory.duration_s),
        search_ms=1e3 * route.search_s,
        joint=route.joint,
        bound_cm=motion.bound_cm,
        mean=motion.mean,
        note=route.note,
    )


def plan_moving(scene: Scene, margin_cm: float, began_s: float, notice: Notice) -> Plan:
    """Plan among moving obstacles: the motion's times are its appointments, so nothing times it again.

    Raises:
        SceneError, NoPathError, TimingError: As `plan_scene`.
    """
    route = find_moving_route(scene, margin_cm)
    notice("plan", 0.6)
    trajectory = Trajectory.in_own_time(route.spline)
    train, segments = encode(scene, trajectory)
    notice("plan", 0.8)
    certificate = certify(scene, trajectory, train, segments)
    notice("plan", 1.0)
    path = TipPath.through(tip_curve_cm(trajectory, Arm.from_spec(scene.arm)), route.path.elbow)
    return Plan(
        scene,
        build_free_map(scene, margin_cm, route.path.elbow),
        path,
        trajectory.path,
        trajectory,
        train,
        segments,
        certificate,
        plan_ms=1e3 * (time.perf_counter() - began_s),
        timing=report_timing(trajectory, Limits.of(scene), fixed=True),
        search_ms=1e3 * route.search_s,
        moving=route,
    )


def stored(plan: Plan) -> StoredPlan:
    """The plan in the form of a plan file."""
    return StoredPlan(
        scene=asdict(plan.scene),
        path_points_cm=tuple((float(x), float(y)) for x, y in plan.path.points_cm),
        motion_s=plan.trajectory.duration_s,
        segments=plan.segments,
        certificate=plan.certificate,
    )


def run_scene(
    scene: Scene,
    port: str,
    out: Path,
    notice: Notice,
    *,
    faults: Path | None = None,
    fault_seed: int | None = None,
    onlooker: Onlooker | None = None,
    watch: Callable[[StreamProgress], None] | None = None,
    warn: Callable[[str], None] | None = None,
    at_start: bool = False,
) -> dict[str, Any]:
    """Plan, stream, verify and report; return the summary.

    Args:
        scene: what to do.
        port: where the firmware is: sim://, a device or pty path, or a pyserial URL.
        out: folder for plan, trace, summary and pictures.
        notice: told the progress.
        faults: a schedule of what goes wrong around an emulated board (docs/faults.md).
        fault_seed: in place of the schedule's own.
        onlooker: watches and steers the run while it goes on.
        watch: told all that the device tells.
        warn: told what will be otherwise than planned, before it begins.
        at_start: somebody says that the arm stands where the plan begins.

    Raises:
        PlanarmError: the branch of the tree tells which stage failed. Differing steps are reported first, then raised.
            When the stream failed, its notes tell what the emulated arm did, and the folder is complete all the same.
    """
    require_port(port, scene.board)
    plan = plan_scene(scene, notice, advise=True)
    begin_run_folder(out, stored(plan))
    setup = ArmSetup(scene, plan.segments.start_usteps, faults, fault_seed)
    with closing(open_transport(port, scene.link.baud, setup)) as transport:
        recorded = record(transport, out, port, scene)
        positions = Positions(default_path())
        settle_start(recorded, port, scene, plan.segments.start_usteps, positions, vouched=at_start)
        if warn is not None:
            warn_before(scene, plan.segments, warn)
        log, plan_again = StreamLog(), partial(plan_scene, notice=notice)
        watchers, steer = [log.note, *([watch] if watch else [])], None
        if onlooker is not None:
            onlooker.begin(plan, transport.clock, emulated=transport.pins is not None)
            watchers, steer = [*watchers, onlooker.note], onlooker.steer
        try:
            plan, streamed, kept = carry_out(plan, recorded, notice, watchers, steer, warn, plan_again)
        except (LinkError, DeviceFault, HostKilledError, CertificateError, StepsDifferError) as error:
            seen = look_at(plan, transport, SETTLE_AFTER_FAILURE_S)
            for line in seen.notes() if log.samples else ():
                error.add_note(line)
            figures = {**planned_figures(plan), **seen_figures(seen.findings, seen.arm)}
            finish_run_folder(out, Outcome(plan, figures, tuple(log.samples), seen, error.told(), log.resent))
            raise
        except OutputError as error:
            if log.samples:
                error.add_note(LEFT_BEHIND)
            raise
        seen = look_at(plan, transport, 0.0, kept)
    summary = summarise(plan, streamed, seen.findings, seen.arm) | (kept.figures() if kept else {})
    finish_run_folder(out, Outcome(plan, summary, tuple(log.samples), seen, resent=log.resent))
    if seen.findings and not seen.findings.comparison.agrees:
        raise StepsDifferError(f"{scene.source}: {seen.findings.comparison.explain()}; see {out}")
    if seen.arm and not seen.arm.clean:
        raise StepsDifferError(f"{scene.source}: {seen.arm.explain()}; see {out}")
    return summary
