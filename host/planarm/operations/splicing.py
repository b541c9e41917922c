"""Leaving a motion for another while it runs: where, and along which path; the arm does not stop for it.

A motion is left at a border between two of its segments that were not sent yet. Up to there its segments stay as they
are. From there on the path runs straight on to one of the old way's next corners and follows the repaired way from that
one, the corner rounded as any; the timing begins with the speed that the old motion has at the border. The result is
one motion from the first start to the goal, whose first segments are the old ones. It is certified as a whole, but for
the clearance of what is past.

What keeps the arm safe meanwhile is the device: nothing behind the border is sent, so it rests before it by itself,
and the border is chosen before the obstacle.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.errors import CertificateError, NoPathError, PlanarmError, TimingError
from planarm.model.arm import Arm
from planarm.plan import Plan
from planarm.roadmap.planning import RoadmapTask, ways_on
from planarm.routes.route import route_through
from planarm.scene import Scene
from planarm.smoothing.joint_blend import blend_poses
from planarm.smoothing.joint_spline import JointSpline, part_of, run_on
from planarm.stepping.certify import certify
from planarm.stepping.schedule import go_on
from planarm.stepping.slowing import SpeedLimit, link_margin_ticks
from planarm.trajectory.binding import report_timing
from planarm.trajectory.limits import Limits
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import JointWorld, joint_world, prove_joint_line
from planarm.workspace.proof import PROVED
from planarm_wire.messages import NEED_UNIT_TICKS, SLICE_TICKS, STARVING_TICKS, TICKS_HZ
from planarm_wire.rates import MESSAGE_SEGMENTS
from planarm_wire.steps import duration_ticks

Floats = NDArray[np.float64]

HANDED_OVER_TICKS = 4 * SLICE_TICKS
"""The device decides this long ahead whether it has to slow down."""
MOST_CORNERS = 6
"""Corners of the old way up to which it may be left."""
BETWEEN_RAD = 0.15
"""Between corners it may be left about so often."""
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
    if plan.scene.planner.objective == "time":
        return "its path is optimised for time"
    if any(joint.max_jerk_rad_s3 is not None for joint in plan.scene.joints):
        return "joints.max_jerk_deg_s3 is set"
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
    for tail in _tails(scene, task, before, border, joint_world(scene, margin_cm)):
        try:
            fastest_motion(tail.path, Limits.of(scene), start_rate=before.trajectory.path_at(border.path_s)[1])
        except TimingError as error:
            problem = error
            continue
        tries += 1
        try:
            return _joined(scene, before, border, from_s, margin_cm, tail, began_s)
        except (TimingError, CertificateError) as error:
            problem = error
        if tries == MOST_TRIES:
            break
    raise problem


@dataclass(frozen=True, slots=True, eq=False)
class _Tail:
    """A way from the border on."""

    path: JointSpline
    poses_rad: Floats
    """Of the whole way, the old part included."""
    cost: float


def _tails(scene: Scene, task: RoadmapTask, before: Plan, border: Border, world: JointWorld) -> Iterator[_Tail]:
    """Yield ways that leave the old one, at one of its next corners or between them, the cheapest first."""
    path, route = before.trajectory.path, before.joint
    assert isinstance(path, JointSpline) and route is not None, "`why_not` said so"
    at_s, _ = before.trajectory.path_at(border.path_s)
    ahead = _ahead(path, route.poses_rad, at_s, world)
    ways = ways_on(task, world, np.array(ahead.poses_rad)) if ahead.poses_rad else []
    for cost, k, way in ways:
        straight_s = _straight_from(path, max(at_s, ahead.leg_s[k]))
        if straight_s < ahead.s[k]:
            turned = _turned(path, straight_s, way, scene, world)
            rest = turned if straight_s == at_s else run_on([part_of(path, at_s, straight_s), turned])
            yield _Tail(rest, np.concatenate([route.poses_rad[: ahead.corner[k]], way]), cost)


class _Ahead(NamedTuple):
    """Where an old way may be left: at corners, and between them."""

    poses_rad: list[Floats]
    s: list[float]
    """The path parameter of each."""
    leg_s: list[float]
    """That of the corner before it."""
    corner: list[int]
    """How many corners of the old way are before it."""


def _ahead(path: JointSpline, poses: Floats, at_s: float, world: JointWorld) -> _Ahead:
    """Return where an old way may be left, as far as its legs are still free."""
    corners_s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(poses, axis=0), axis=1))])
    first = int(np.searchsorted(corners_s, at_s))
    start = path.evaluate(np.array([at_s])).q_rad[0]
    found = _Ahead([], [], [], [])
    for k in range(first, min(first + MOST_CORNERS, len(poses))):
        leg = poses[k] - poses[k - 1]
        parts = max(1, ceil(float(np.linalg.norm(leg)) / BETWEEN_RAD))
        since = start if k == first else poses[k - 1]
        for part in range(1, parts + 1):
            pose = poses[k] if part == parts else poses[k - 1] + part / parts * leg
            s = float(corners_s[k - 1] + part / parts * (corners_s[k] - corners_s[k - 1]))
            if s <= at_s:
                continue
            if (k == len(poses) - 1 and part == parts) or prove_joint_line(world, since, pose)[0] != PROVED:
                return found
            since = pose
            found.poses_rad.append(pose)
            found.s.append(s)
            found.leg_s.append(float(corners_s[k - 1]))
            found.corner.append(k)
    return found


def _turned(path: JointSpline, straight_s: float, way: Floats, scene: Scene, world: JointWorld) -> JointSpline:
    """Return a path that runs straight on from there to where `way` begins, and along it."""
    start = path.evaluate(np.array([straight_s])).q_rad
    # All of what is left of the leg may be used for the corner: as if the leg were twice as long.
    blended = blend_poses(
        np.concatenate([2.0 * start - way[:1], way]), Arm.from_spec(scene.arm), world, _tolerance_cm(scene), proved=True
    )
    return part_of(blended, float(np.linalg.norm(way[0] - start[0])), float(blended.borders_s[-1]))


def _straight_from(path: JointSpline, s: float) -> float:
    """Return the first parameter from s on at which the path runs straight."""
    piece = int(np.clip(np.searchsorted(path.borders_s, s, side="right") - 1, 0, len(path.coefficients) - 1))
    while piece + 1 < len(path.coefficients) and path.coefficients[piece, 2:].any():
        piece += 1
        s = float(path.borders_s[piece])
    return s


def _joined(
    scene: Scene, before: Plan, border: Border, from_s: float, margin_cm: float, tail: _Tail, began_s: float
) -> Plan:
    """Return the whole motion along the old path and a tail.

    Raises:
        TimingError, CertificateError: as `plan_from_border`.
    """
    old, limits = before.trajectory, Limits.of(scene)
    assert isinstance(old.path, JointSpline), "`why_not` said so"
    at_s, rate = old.path_at(border.path_s)
    path = run_on([part_of(old.path, 0.0, at_s), tail.path])

    def timed(limit: SpeedLimit | None) -> Trajectory:
        cap = None if limit is None else partial(_from, limit, at_s)
        return old.left_for(path, border.path_s, fastest_motion(tail.path, limits, cap, start_rate=rate))

    trajectory, train, segments = go_on(scene, timed, (before.train, before.segments), border.segment)
    certificate = certify(scene, trajectory, train, segments, from_ticks=int(from_s * TICKS_HZ))
    if not certificate.ok:
        raise CertificateError(f"the new motion is not certified: {certificate.explain()}")
    route = route_through(scene, margin_cm, tail.poses_rad, tail.cost)
    return replace(
        before,
        scene=scene,
        free_map=route.free_map,
        path=route.path,
        smooth_path=path,
        trajectory=trajectory,
        train=train,
        segments=segments,
        certificate=certificate,
        plan_ms=1e3 * (time.perf_counter() - began_s),
        timing=report_timing(trajectory, limits),
        search_ms=0.0,
        joint=route.joint,
    )


def _from(limit: SpeedLimit, start_s: float, s: Floats) -> Floats:
    """Return a limit of the speed along a path for a part of it that begins at `start_s`."""
    return limit(start_s + s)


def _tolerance_cm(scene: Scene) -> float | None:
    return None if scene.motion.corners == "stop" else scene.motion.tolerance_cm
