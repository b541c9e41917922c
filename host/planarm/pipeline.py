"""The whole flow as one readable function: from a scene file to counted steps at the pins.

scene -> FreeMap -> Path -> SmoothPath -> Trajectory -> StepTrain -> SegmentPlan -> frames -> pins -> edges -> findings
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from planarm.analysis.step_count import Waveform, compare_steps, measure_steps, start_tick_of
from planarm.errors import (
    CertificateError,
    DeviceFault,
    HostKilledError,
    LinkError,
    StepsDifferError,
    TimingError,
)
from planarm.fastest.task import fastest_path
from planarm.link.arm_record import ArmSetup, ArmTrace
from planarm.link.clock import Clock
from planarm.link.exchange import StreamResult
from planarm.link.positions import Positions, default_path
from planarm.link.stream import Stream, StreamProgress
from planarm.link.transport import PinTrace, Transport, open_transport, require_board
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.plan import Findings, Plan
from planarm.plan_file import StoredPlan
from planarm.record.arm_findings import SETTLE_S, ArmFindings, judge_arm
from planarm.record.outcome import Outcome, Seen, StreamLog
from planarm.routes.gentle import ROOM_CM, gentle_motion, jerk_limits
from planarm.routes.moving_route import find_moving_route
from planarm.routes.route import Route, find_route
from planarm.run_folder.folder import begin_run_folder, finish_run_folder
from planarm.run_folder.summary import planned_figures, seen_figures, summarise
from planarm.scene import Scene
from planarm.search.path import Path as TipPath
from planarm.stepping.certify import certify
from planarm.stepping.quantise import quantisation_bound_cm
from planarm.stepping.schedule import encode, schedule
from planarm.stepping.segments import SegmentPlan, expand
from planarm.stepping.slowing import SpeedLimit, road_ticks
from planarm.streaming.moving_run import KeptTime, Timekeeper, stream_on_time
from planarm.streaming.plan_stream import options_for, record, stream, telling, warn_of_release
from planarm.streaming.standing import settle_start
from planarm.trajectory.binding import TimingReport, report_timing
from planarm.trajectory.limits import Limits
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.free_map import build_free_map
from planarm_wire.messages import TICKS_HZ

Notice = Callable[[str, float], None]
"""Told the stage and the share of it that is done."""


class Onlooker(Protocol):
    """Who watches a run while it goes on, and may hold, resume and stop it."""

    def begin(self, plan: Plan, clock: Clock, *, emulated: bool) -> None:
        """Take the plan; the motion begins when this comes back. `emulated`: the clock is an emulator's."""
        ...

    def note(self, told: StreamProgress) -> None:
        """Take what the device tells."""
        ...

    def steer(self, stream: Stream) -> None:
        """Called again and again while the motion goes on; may call the stream's hold, resume, override and stop."""
        ...


CURVE_POINTS = 400
"""Positions by which the curve of a motion is told in reports."""

SETTLE_AFTER_FAILURE_S = 1.0
"""Emulated time after a stream that failed: what the board has queued is executed, and the arm comes to rest."""

LONGEST_MOTION_S = 600.0
"""The certificate looks at a motion every 0.1 ms; beyond ten minutes that takes gigabytes."""


def plan_scene(scene: Scene, notice: Notice, route: Route | None = None) -> Plan:
    """Plan, time, quantise, compress and certify; a route that is known is not searched.

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
    notice("plan", 0.4)
    motion = motion_along(scene, route, margin_cm, notice)
    notice("plan", 0.6)
    trajectory, train, segments = schedule(scene, motion.under)
    notice("plan", 0.8)
    certificate = certify(scene, trajectory, train, segments)
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
        note=route.note,
    )


@dataclass(frozen=True, slots=True)
class Motion:
    """The fastest motion along a route, before it is made steps.

    Attributes:
        trajectory: it.
        under: the same under a further limit of its speed, or as it is.
        timing: what holds it back.
        path: the tip's, and `bound_cm` what none is shorter than; an optimised path has another tip and no bound.
    """

    trajectory: Trajectory
    under: Callable[[SpeedLimit | None], Trajectory]
    timing: TimingReport
    path: TipPath
    bound_cm: float | None


def motion_along(scene: Scene, route: Route, margin_cm: float, notice: Notice) -> Motion:
    """Time a route, optimise its path for duration where that is asked for, and keep the limits of jerk."""
    limits = Limits.of(scene)
    trajectory, path, bound_cm = fastest_motion(route.smooth, limits), route.path, route.bound_cm
    if scene.planner.objective == "time":
        trajectory = optimised(scene, margin_cm, trajectory, limits, notice)
        path, bound_cm = TipPath.through(tip_curve_cm(trajectory, Arm.from_spec(scene.arm)), path.elbow), None
    timing, jerks = report_timing(trajectory, limits), jerk_limits(scene)
    if jerks is None:
        return Motion(trajectory, lambda limit: timed(scene, trajectory, limits, limit), timing, path, bound_cm)
    # Not timed anew: where a stop lacks road, the device slows down by itself.
    gentle = gentle_motion(scene, margin_cm - ROOM_CM, trajectory, limits, jerks)
    timing = replace(timing, duration_s=gentle.duration_s, executed_s=gentle.duration_s)
    return Motion(gentle, lambda _limit: timed(scene, gentle, limits, None), timing, path, bound_cm)


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


def timed(scene: Scene, fastest: Trajectory, limits: Limits, limit: SpeedLimit | None) -> Trajectory:
    """Return the motion along a path timed before, under a further limit of its speed.

    Raises:
        TimingError: It takes too long to be looked at.
    """
    trajectory = fastest if limit is None else fastest_motion(fastest.path, limits, limit)
    if trajectory.duration_s > LONGEST_MOTION_S:
        raise TimingError(
            f"{scene.source}: the motion would take {trajectory.duration_s:.6g} s, {LONGEST_MOTION_S:g} s are the "
            "most; raise joints.max_speed_deg_s or joints.max_acceleration_deg_s2, or move task.goal_cm nearer"
        )
    return trajectory


def optimised(scene: Scene, margin_cm: float, known: Trajectory, limits: Limits, notice: Notice) -> Trajectory:
    """Optimise the path itself for duration; return the known motion when no faster one is found within the budget.

    Both are compared as they will be executed, slowed down where a stop does not fit (docs/decisions/0107).
    """
    road_s = road_ticks(encode(scene, known)[1]) / TICKS_HZ
    spline = fastest_path(
        scene, margin_cm, known.path, limits, road_s, time.perf_counter, lambda share, _s: notice("optimise", share)
    )
    notice("optimise", 1.0)
    if spline is None:
        return known
    motions = known, fastest_motion(spline, limits)
    return min(motions, key=lambda motion: _executed_s(scene, motion, limits))


def _executed_s(scene: Scene, motion: Trajectory, limits: Limits) -> float:
    """Return how long a motion lasts as it will be executed; for ever, where no timing of it can be."""
    try:
        return schedule(scene, partial(timed, scene, motion, limits))[0].duration_s
    except TimingError:
        return np.inf


def tip_curve_cm(trajectory: Trajectory, arm: Arm) -> NDArray[np.float64]:
    """Return positions of the tip along a motion, shape (m, 2), for reports."""
    s = np.linspace(trajectory.s[0], trajectory.s[-1], CURVE_POINTS)
    return np.asarray(forward(arm, trajectory.path.evaluate(s).q_rad)[:, -1])


def planning_margin_cm(scene: Scene) -> float:
    """Return the margin that plans keep: the scene's, and half a micro-step in every joint (docs/decisions/0005).

    With a limit of jerk there is room for what the motion then cuts (docs/decisions/0087).
    """
    steps_cm = quantisation_bound_cm(Arm.from_spec(scene.arm), scene.joints, scene.coupling)
    return scene.margin_cm + steps_cm + (0.0 if jerk_limits(scene) is None else ROOM_CM)


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
    require_board(port, scene.board)
    plan = plan_scene(scene, notice)
    begin_run_folder(out, stored(plan))
    setup = ArmSetup(scene, plan.segments.start_usteps, faults, fault_seed)
    with closing(open_transport(port, scene.link.baud, setup)) as transport:
        recorded = record(transport, out, port, scene)
        positions = Positions(default_path())
        settle_start(recorded, port, scene, plan.segments.start_usteps, positions, vouched=at_start)
        if warn is not None:
            warn_of_release(scene, plan.segments, warn)
        log = StreamLog()
        watchers, steer = [log.note, *([watch] if watch else [])], None
        if onlooker is not None:
            onlooker.begin(plan, transport.clock, emulated=transport.pins is not None)
            watchers, steer = [*watchers, onlooker.note], onlooker.steer
        try:
            plan, streamed, kept = carry_out(plan, recorded, notice, watchers, steer, warn)
        except (LinkError, DeviceFault, HostKilledError, CertificateError, StepsDifferError) as error:
            seen = look_at(plan, transport, SETTLE_AFTER_FAILURE_S)
            for line in seen.notes() if log.samples else ():
                error.add_note(line)
            figures = {**planned_figures(plan), **seen_figures(seen.findings, seen.arm)}
            finish_run_folder(out, Outcome(plan, figures, tuple(log.samples), seen, error.told(), log.resent))
            raise
        seen = look_at(plan, transport, 0.0, kept)
    summary = summarise(plan, streamed, seen.findings, seen.arm) | (kept.figures() if kept else {})
    finish_run_folder(out, Outcome(plan, summary, tuple(log.samples), seen, resent=log.resent))
    if seen.findings and not seen.findings.comparison.agrees:
        raise StepsDifferError(f"{scene.source}: {seen.findings.comparison.explain()}; see {out}")
    if seen.arm and not seen.arm.clean:
        raise StepsDifferError(f"{scene.source}: {seen.arm.explain()}; see {out}")
    return summary


def carry_out(
    plan: Plan,
    transport: Transport,
    notice: Notice,
    watch: Sequence[Callable[[StreamProgress], None]],
    steer: Callable[[Stream], None] | None,
    warn: Callable[[str], None] | None = None,
) -> tuple[Plan, StreamResult, KeptTime | None]:
    """Stream a plan; one among moving obstacles by its clock, planned again where it falls behind.

    Returns:
        (the plan that arrived, its stream, how time was kept).
    """
    if plan.moving is None:
        options = options_for(plan.scene, plan.segments)
        tell = telling(notice, *watch)
        return plan, stream(plan.segments, plan.certificate, transport, tell, options, steer=steer, warn=warn), None

    def on_time(now: Plan, keeper: Timekeeper) -> StreamResult:
        def steered(running: Stream) -> None:
            keeper.steer(running)
            if steer is not None:
                steer(running)

        options = replace(options_for(now.scene, now.segments), start_at_s=keeper.start_at_s)
        tell = telling(notice, keeper.watch, *watch)
        return stream(now.segments, now.certificate, transport, tell, options, steer=steered, limits=keeper.limits)

    kept = stream_on_time(plan, transport.clock, on_time, lambda scene: plan_scene(scene, notice))
    return kept.plan, kept.streamed, kept


def judge_pins(plan: SegmentPlan, trace: PinTrace) -> Findings:
    """Count the steps from the pins' edges and hold them against the plan."""
    measured = tuple(
        measure_steps(_waveform(trace, step), _waveform(trace, direction))
        for step, direction in plan.board.joint_pins[: len(plan.start_usteps)]
    )
    planned = [(joint.ticks, joint.directions) for joint in expand(plan).steps]
    return Findings(measured, compare_steps(planned, measured))


def look_at(plan: Plan, transport: Transport, settle_s: float, kept: KeptTime | None = None) -> Seen:
    """Hold pins and emulated arm against the plan, after a while in which the board executes what it has queued.

    With `kept` the arm is held against the obstacles' own clock; after a new plan on the way the pins show more than
    the last plan, so they are not held against it.
    """
    if transport.pins is None:
        return Seen()
    if transport.arm:
        transport.arm.settle(settle_s)
    if kept and kept.replans:
        arm = judge_on_time(kept, transport.arm) if transport.arm else None
        return Seen(transport.pins, None, arm, kept.start_tick)
    findings = judge_pins(plan.segments, transport.pins)
    arm = judge_emulated_arm(plan, findings, transport.arm, kept) if transport.arm else None
    planned = [joint.ticks for joint in expand(plan.segments).steps]
    return Seen(transport.pins, findings, arm, start_tick_of(planned, [joint.ticks for joint in findings.measured]))


def judge_on_time(kept: KeptTime, trace: ArmTrace) -> ArmFindings:
    """Let the emulated arm come to rest, and hold it against the last plan and against the obstacles all along."""
    trace.settle(SETTLE_S)
    return judge_arm(kept.plan, trace.record(), kept.start_tick, (kept.scene, kept.zero_tick))


def judge_emulated_arm(plan: Plan, findings: Findings, trace: ArmTrace, kept: KeptTime | None = None) -> ArmFindings:
    """Let the emulated arm come to rest, and hold what it did against the plan."""
    trace.settle(SETTLE_S)
    planned = [joint.ticks for joint in expand(plan.segments).steps]
    start_tick = start_tick_of(planned, [joint.ticks for joint in findings.measured])
    return judge_arm(plan, trace.record(), start_tick, (kept.scene, kept.zero_tick) if kept else None)


def _waveform(trace: PinTrace, pin: str) -> Waveform:
    edges = trace.edges(pin)
    return Waveform(edges["cycle"], edges["level"])
