"""From a scene with moving obstacles to a motion in time that is proved free; or the error that says why not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import Final

import numpy as np

from planarm.errors import NoPathError, SceneError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.moving import moving_set
from planarm.scene import Point, Scene
from planarm.search.moving.rules import Rule, RuleRun, run_rule
from planarm.search.moving.space_time import MovingStatus, SpaceTimeResult, search_space_time, world_of
from planarm.search.moving.timed_path import TimedPath
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.swarm import SwarmResult, SwarmSettings, fly
from planarm.smoothing.timed_spline import delay_margin_s, from_nodes, judge, tip_length_cm
from planarm.workspace.cell_poses import most_turn_rad
from planarm.workspace.check_task import pose_problem
from planarm.workspace.moving_map import MovingMap, build_moving_map, moving_spec
from planarm.workspace.moving_proof import MovingWorld, prove_cell_move, prove_moving_piece
from planarm.workspace.proof import PROVED
from planarm.workspace.world import build_world, elbow_sides

LOOK_S = 0.05
"""To this the time is told at which a resting arm is touched."""

RULES: Final[tuple[Rule, ...]] = ("plain", "modified")
"""What a plan tells beside the exact search."""

NEAR_CELLS = 1.6
"""A pose that is no node is joined to nodes this near."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingRoute:
    """A motion among moving obstacles and how it was found."""

    moving_map: MovingMap
    """Of the path's elbow side."""
    path: TimedPath
    """The exact search's."""
    spline: JointSpline
    """The motion; its parameter is time in seconds."""
    length_cm: float
    """Of the tip's curve."""
    delay_margin_s: float
    """The largest delay for which each pose stays free."""
    swarm: SwarmResult | None
    map_s: float
    search_s: float
    proofs: int
    rules: tuple[RuleRun, ...] = ()
    """What plain D* and paper B's rule would have done, simulated to the end; none from a pose that is no node."""


def find_moving_route(scene: Scene, margin_cm: float) -> MovingRoute:
    """Search in space and time on each allowed elbow side and take the earliest arrival; smooth as the scene says.

    Args:
        scene: a scene with a table [moving].
        margin_cm: least distance of a link's centre line to an obstacle.

    Raises:
        SceneError: start or goal is no node of the grid, or cannot be taken on any allowed side.
        NoPathError: there is no motion on this grid within the horizon.
    """
    found: list[tuple[MovingMap, TimedPath, SpaceTimeResult, float]] = []
    problems: list[SceneError | NoPathError] = []
    for side in elbow_sides(scene.arm):
        began_s = perf_counter()
        try:
            moving_map = build_moving_map(scene, side, margin_cm)
            goal = _cell(scene, moving_map, "goal_cm")
            search = _from_pose if scene.task.start_rad else _from_node
            result = search(scene, moving_map, goal)
        except SceneError as error:  # on this side; told below when it is so on all sides
            problems.append(error)
            continue
        map_s = perf_counter() - began_s - result.search_s
        if result.path is None:
            problems.append(_no_motion(scene, moving_map, result))
        else:
            found.append((moving_map, result.path, result, map_s))
    if not found:
        raise next((error for error in problems if isinstance(error, NoPathError)), problems[0])
    moving_map, path, result, map_s = min(found, key=lambda one: (one[1].arrival, one[1].length_cm))
    return _smoothed(scene, moving_map, path, result, map_s)


def _smoothed(
    scene: Scene, moving_map: MovingMap, path: TimedPath, result: SpaceTimeResult, map_s: float
) -> MovingRoute:
    """Return the motion along a path, with a swarm where the scene says so, judged once more as it is."""
    swarm = None
    spline = from_nodes(Arm.from_spec(scene.arm), path, moving_map.clock.sample_s)
    spec = moving_spec(scene)
    if spec.smoothing == "pso":
        settings = SwarmSettings(via_points=spec.via_points)
        swarm = fly(scene, moving_map, path, np.random.default_rng(scene.planner.seed), settings)
        spline = swarm.spline or spline
    verdict = judge(scene, moving_map, spline)
    if verdict.problem:
        raise NoPathError(f"{scene.source}: {verdict.problem} at {verdict.time_s:.3f} s of the motion that was found")
    return MovingRoute(
        moving_map,
        path,
        spline,
        tip_length_cm(spline),
        delay_margin_s(moving_map, spline),
        swarm,
        map_s,
        result.search_s,
        result.proofs,
        () if scene.task.start_rad else by_rules(scene, moving_map),
    )


def by_rules(scene: Scene, moving_map: MovingMap) -> tuple[RuleRun, ...]:
    """Simulate plain D* and paper B's modified D* to their ends; a contact is a failure of the rule."""
    start, goal = (moving_map.cell_at(point) for point in (scene.task.start_cm, scene.task.goal_cm))
    return tuple(run_rule(rule, moving_map, start, goal) for rule in RULES)


def _from_node(scene: Scene, moving_map: MovingMap, goal: int) -> SpaceTimeResult:
    """Search from the task's start, a node."""
    return search_space_time(moving_map, _cell(scene, moving_map, "start_cm"), goal)


def _from_pose(scene: Scene, moving_map: MovingMap, goal: int) -> SpaceTimeResult:
    """Search from a pose that is no node: in the first sample to a node near by, then as ever; the earliest arrival.

    Raises:
        SceneError: the pose is on the other elbow side.
    """
    q_rad, poses, clock = np.array(scene.task.start_rad), moving_map.poses, moving_map.clock
    if q_rad[1] * moving_map.arm.side > 0.0:
        raise SceneError(scene.source, "task.start_rad", f"is no pose with its elbow {moving_map.elbow!r}")
    tip = forward(Arm.from_spec(scene.arm), q_rad)[-1] - scene.arm.base_cm
    near = np.flatnonzero(np.hypot(*(poses.tip_cm - tip).T) <= NEAR_CELLS * moving_map.cell_cm)
    most, world, piece = most_turn_rad(scene, clock.sample_s), world_of(moving_map), np.empty((4, 2))
    best = SpaceTimeResult(MovingStatus.START_TAKEN, None, 0, 0, 0.0)
    spent_s, proofs = 0.0, 0
    for n in near:
        if (np.abs(poses.q_rad[n] - q_rad) > most).any():
            continue
        proofs += 1
        if not prove_cell_move(world, q_rad, poses.q_rad[n], 0.0, clock.sample_s, clock.delay_s, piece):
            continue
        result = search_space_time(moving_map, int(poses.cell[n]), goal, since=1)
        spent_s, proofs = spent_s + result.search_s, proofs + result.proofs
        if result.path is None:
            best = best if best.path else result
        elif best.path is None or result.path.arrival + 1 < best.path.arrival:
            best = replace(result, path=result.path.after(q_rad, tip + scene.arm.base_cm))
    return replace(best, search_s=spent_s, proofs=proofs)


def _cell(scene: Scene, moving_map: MovingMap, key: str) -> int:
    """Return the cell of start or goal.

    Raises:
        SceneError: it is no node, or no pose is there, or, at the start, an obstacle.
    """
    point: Point = getattr(scene.task, key)
    cell, cell_cm = moving_map.cell_at(point), moving_map.cell_cm
    name = f"task.{key}"
    if cell < 0:
        problem = f"is no node of the grid; give multiples of workspace.cell_cm = {cell_cm:g}"
        raise SceneError(scene.source, name, f"[{point[0]:g}, {point[1]:g}] {problem}")
    now = scene if key == "start_cm" else replace(scene, obstacles=())
    problem = pose_problem(now, build_world(now, moving_map.arm.margin_cm, moving_map.elbow), point)
    if problem:
        raise SceneError(scene.source, name, f"[{point[0]:g}, {point[1]:g}] {problem}")
    return cell


def _no_motion(scene: Scene, moving_map: MovingMap, result: SpaceTimeResult) -> NoPathError:
    """Return the error that tells why there is no motion on one side and what would help."""
    side, clock = moving_map.elbow, moving_map.clock
    horizon = f"{clock.samples} samples ({clock.samples * clock.sample_s:g} s)"
    advice: tuple[str, ...]
    if result.status is MovingStatus.GOAL_TAKEN:
        reason = f"an obstacle takes the goal at the end of the horizon of {horizon}"
        advice = ("move task.goal_cm out of the obstacles' way", "change moving.samples")
    elif result.trapped_at >= 0:
        at = result.trapped_at
        reason = f"every pose that the arm can be in is taken at sample {at} ({at * clock.sample_s:g} s): it is trapped"
        advice = ("move task.start_cm", "raise moving.sample_s, so that the arm gets farther in a sample")
    else:
        reason = f"no motion on this grid reaches the goal within {horizon}: every one was ruled out"
        advice = ("raise moving.samples", "lower workspace.cell_cm", "lower moving.delay_margin_s")
    error = NoPathError(f"{scene.source}: elbow {side!r}: {reason}")
    error.advice, error.fields = advice, {"elbow": side, "cause": result.status.value}
    return error


@dataclass(frozen=True, slots=True)
class RestTouch:
    """What touches an arm that rests."""

    obstacle: int
    """Counted from 1."""
    after_s: float
    """To LOOK_S, rounded down."""

    def words(self) -> str:
        """Say it."""
        return f"obstacles[{self.obstacle}] touches the resting arm after {self.after_s:.2f} s"


def rest_touch(scene: Scene, for_s: float) -> RestTouch | None:
    """Return what first touches the arm in its task's start pose; None when nothing does.

    Args:
        scene: with joint angles at its task's start; time 0 is now.
        for_s: how long the arm rests; beyond the horizon nothing is said.
    """
    spec, arm = moving_spec(scene), scene.arm
    until_s = min(for_s, spec.horizon_s)
    (l1, l2), (x, y) = arm.link_lengths_cm, arm.base_cm
    world = MovingWorld(l1, l2, x, y, scene.margin_cm, moving_set(scene, until_s))
    for begin_s in np.arange(0.0, until_s, LOOK_S):
        piece = np.zeros((4, 2))
        piece[0] = scene.task.start_rad
        verdict, _, obstacle = prove_moving_piece(world, piece, begin_s, min(LOOK_S, until_s - begin_s), 0.0)
        if verdict != PROVED:
            return RestTouch(int(obstacle) + 1, float(begin_s))
    return None
