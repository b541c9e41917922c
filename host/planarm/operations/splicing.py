"""Leaving a motion for another while it runs: where, and along which path; the arm does not stop for it.

A motion is left at a border between two of its segments that were not sent yet. Up to there its segments stay as they
are. From there on the path runs straight on to one of the old way's next corners, or along its tangent where it is a
curve, and follows the repaired way from there, the corner rounded as any (`planarm.operations.tails`); the timing
begins with the speed that the old motion has at the border, and with limits of jerk with its acceleration. The result
is one motion from the first start to the goal, whose first segments are the old ones. It is certified as a whole, but
for the clearance of what is past.

What keeps the arm safe meanwhile is the device: nothing behind the border is sent, so it rests before it by itself,
and the border is chosen before the obstacle.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil

import numpy as np
from numpy.typing import NDArray

from planarm.errors import CertificateError, NoPathError, PlanarmError, TimingError
from planarm.operations.tails import MOST_TAILS, Tail, tails
from planarm.plan import Plan
from planarm.roadmap.planning import RoadmapTask
from planarm.routes.gentle import ROOM_CM, gentle_rest, jerk_limits
from planarm.routes.route import route_through
from planarm.scene import Scene
from planarm.smoothing.joint_spline import JointSpline, part_of, run_on
from planarm.stepping.certify import certify
from planarm.stepping.schedule import go_on
from planarm.stepping.slowing import SpeedLimit, link_margin_ticks
from planarm.trajectory.binding import report_timing
from planarm.trajectory.jerk import STEP_S
from planarm.trajectory.limits import Limits
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import JointWorld, joint_world
from planarm_wire.messages import NEED_UNIT_TICKS, SLICE_TICKS, STARVING_TICKS, TICKS_HZ
from planarm_wire.rates import MESSAGE_SEGMENTS
from planarm_wire.steps import duration_ticks

Floats = NDArray[np.float64]

HANDED_OVER_TICKS = 4 * SLICE_TICKS
"""The device decides this long ahead whether it has to slow down."""
MOST_BORDERS = 4
APART_S = 0.06
"""A motion that cannot be left at the first border is tried to be left later, so far apart."""
MOST_TRIES = 3
"""Of the ways that can be reached at the speed, the cheapest first, how many are encoded and certified."""


@dataclass(frozen=True, slots=True)
class Border:
    """Where a motion is left: before this segment."""

    segment: int
    tick: int

    @property
    def path_s(self) -> float:
        """The path time there."""
        return self.tick / TICKS_HZ


def why_not(plan: Plan) -> str:
    """Say why a motion of this kind is not left at speed; empty when it can be."""
    if not isinstance(plan.trajectory.path, JointSpline) or plan.joint is None:
        return "its path is no way in joint space"
    return ""


def _neighbours(values: list[float]) -> list[list[float]]:
    """Return for each value those that may be told in a message with it."""
    wide = MESSAGE_SEGMENTS - 1
    return [values[max(0, k - wide) : k + wide + 1] for k in range(len(values))]


def first_border(plan: Plan, sent: int, ready_s: float) -> Border | None:
    """Return the first border at which a motion can be left without slowing down; None when there is none.

    Args:
        plan: the motion.
        sent: segments that were sent.
        ready_s: the path time by which the other motion is there; until then the device must not miss what comes next.
    """
    ticks, ready_ticks, wanted = 0, ready_s * TICKS_HZ, 0.0
    # Beyond a stop's need, and with what the line may take.
    margin_ticks = STARVING_TICKS + link_margin_ticks(plan.segments.board)
    # A message tells the largest need of its segments, rounded up.
    needs = [max(near) for near in _neighbours([allowance.need_ticks for allowance in plan.segments.allowances])]
    for k, (segment, need_ticks) in enumerate(zip(plan.segments.segments, needs, strict=True)):
        if k >= max(sent, 1) and ticks >= wanted and ticks > ready_ticks:
            return Border(k, ticks)
        end = ticks + duration_ticks(segment)
        if ticks <= ready_ticks + HANDED_OVER_TICKS:
            last_slice = min(float(end), ready_ticks + HANDED_OVER_TICKS)
            wanted = max(wanted, last_slice + SLICE_TICKS + need_ticks + NEED_UNIT_TICKS + margin_ticks)
        ticks = end
    return None


def borders_from(plan: Plan, first: Border, before_s: float) -> list[Border]:
    """Return borders at which a motion may be left, from the first possible one on, before a path time."""
    found, ticks = [first], 0
    for k, segment in enumerate(plan.segments.segments):
        if k > first.segment and ticks >= found[-1].tick + APART_S * TICKS_HZ and ticks < before_s * TICKS_HZ:
            found.append(Border(k, ticks))
        ticks += duration_ticks(segment)
    return found[:MOST_BORDERS]


def plan_from_borders(
    scene: Scene, task: RoadmapTask, before: Plan, borders: Sequence[Border], from_s: float, margin_cm: float
) -> tuple[Plan, Border]:
    """Return a motion that leaves `before` at the first of some borders at which that is possible, and that border.

    Raises:
        NoPathError, TimingError, CertificateError: as `plan_from_border`, for the last of them.
    """
    for border in borders[:-1]:
        try:
            return plan_from_border(scene, task, before, border, from_s, margin_cm), border
        except (TimingError, CertificateError):
            continue  # the next one leaves more room to slow down
        except NoPathError:
            break
    return plan_from_border(scene, task, before, borders[-1], from_s, margin_cm), borders[-1]


def plan_from_border(
    scene: Scene, task: RoadmapTask, before: Plan, border: Border, from_s: float, margin_cm: float
) -> Plan:
    """Return a motion that is `before` up to a border and then goes to the goal among all of the scene's obstacles.

    Args:
        scene: with all obstacles.
        task: the roadmap with all of them, and its planner.
        before: the motion that runs.
        border: where it is left.
        from_s: the path time from which on clearance is looked at.
        margin_cm: to keep from the links' centre lines.

    Raises:
        NoPathError: nothing leads on.
        TimingError: no way that leads on can be reached at the speed.
        CertificateError: one can, but the motion is not certified.
    """
    began_s, tries = time.perf_counter(), 0
    problem: PlanarmError = NoPathError(f"{scene.source}: no way leads on from the corners ahead")
    left = _Left.of(before, border)
    for tail in _timed_tails(scene, task, before, left, joint_world(scene, margin_cm)):
        if isinstance(tail, TimingError):
            problem = tail
            continue
        tries += 1
        try:
            return _joined(scene, before, border, left, from_s, margin_cm, tail, began_s)
        except (TimingError, CertificateError) as error:
            problem = error
        if tries == MOST_TRIES:
            break
    raise problem


@dataclass(frozen=True, slots=True, eq=False)
class _Left:
    """What is left, and where: with limits of jerk not the motion that streams but what that is the mean of."""

    motion: Trajectory
    path: JointSpline
    t_s: float
    s: float
    rate: float
    """ds/dt there."""

    @classmethod
    def of(cls, plan: Plan, border: Border) -> _Left:
        motion = plan.trajectory if plan.mean is None else plan.mean.motion
        assert isinstance(motion.path, JointSpline), "`why_not` said so"
        t_s = border.path_s if plan.mean is None else STEP_S * _step_at(border)
        return cls(motion, motion.path, t_s, *motion.path_at(t_s))


def _step_at(border: Border) -> int:
    """Return the first step of a mean that is not before a border."""
    return ceil(border.path_s / STEP_S)


def _timed_tails(
    scene: Scene, task: RoadmapTask, before: Plan, left: _Left, world: JointWorld
) -> Iterator[Tail | TimingError]:
    """Yield the ways that lead on and can be begun at the speed, and why others cannot.

    The cheapest come first, or where time is the objective the quickest of all.
    """
    limits, route = Limits.of(scene), before.joint
    by_time = scene.planner.objective == "time"
    assert route is not None, "`why_not` said so"
    timed: list[tuple[float, Tail]] = []
    for tail in tails(scene, task, left.path, route.poses_rad, left.s, world):
        try:
            duration_s = fastest_motion(tail.path, limits, start_rate=left.rate).duration_s
        except TimingError as error:
            yield error
            continue
        if by_time:
            timed.append((duration_s, tail))
            if len(timed) == MOST_TAILS:
                break
        else:
            yield tail
    yield from (tail for _, tail in sorted(timed, key=lambda one: one[0]))


def _joined(
    scene: Scene, before: Plan, border: Border, left: _Left, from_s: float, margin_cm: float, tail: Tail, began_s: float
) -> Plan:
    """Return the whole motion along the old path and a tail.

    Raises:
        TimingError, CertificateError: as `plan_from_border`.
    """
    limits, mean = Limits.of(scene), None
    path = run_on([part_of(left.path, 0.0, left.s), tail.path])

    def timed(limit: SpeedLimit | None) -> Trajectory:
        cap = None if limit is None else partial(_from, limit, left.s)
        return left.motion.left_for(path, left.t_s, fastest_motion(tail.path, limits, cap, start_rate=left.rate))

    if before.mean is not None:
        jerks = jerk_limits(scene)
        assert jerks is not None, "a mean is made where jerk is limited"
        paths = path, tail.path
        gentle = gentle_rest(scene, margin_cm - ROOM_CM, before.mean, _step_at(border), paths, limits, jerks)
        mean = gentle.mean

    def under(limit: SpeedLimit | None) -> Trajectory:
        # A mean is not timed anew: where a stop lacks road, the device slows down by itself.
        return timed(limit) if mean is None else gentle.trajectory

    trajectory, train, segments = go_on(scene, under, (before.train, before.segments), border.segment)
    certificate = certify(scene, trajectory, train, segments, from_ticks=int(from_s * TICKS_HZ))
    if not certificate.ok:
        raise CertificateError(f"the new motion is not certified: {certificate.explain()}")
    route = route_through(scene, margin_cm, tail.poses_rad, tail.cost)
    return replace(
        before,
        scene=scene,
        free_map=route.free_map,
        path=route.path,
        smooth_path=trajectory.path,
        trajectory=trajectory,
        train=train,
        segments=segments,
        certificate=certificate,
        plan_ms=1e3 * (time.perf_counter() - began_s),
        timing=report_timing(trajectory, limits),
        search_ms=0.0,
        joint=route.joint,
        mean=mean,
    )


def _from(limit: SpeedLimit, start_s: float, s: Floats) -> Floats:
    """Return a limit of the speed along a path for a part of it that begins at `start_s`."""
    return limit(start_s + s)
