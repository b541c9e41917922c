"""From a scene with moving obstacles to a motion in time that is proved free; or the error that says why not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from planarm.errors import NoPathError, SceneError
from planarm.model.arm import Arm
from planarm.scene import Point, Scene
from planarm.search.moving.space_time import MovingStatus, SpaceTimeResult, search_space_time
from planarm.search.moving.timed_path import TimedPath
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.swarm import SwarmResult, SwarmSettings, fly
from planarm.smoothing.timed_spline import delay_margin_s, from_nodes, judge, tip_length_cm
from planarm.workspace.check_task import pose_problem
from planarm.workspace.moving_map import MovingMap, build_moving_map, moving_spec
from planarm.workspace.world import build_world, elbow_sides


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
            start, goal = (_cell(scene, moving_map, key) for key in ("start_cm", "goal_cm"))
        except SceneError as error:  # on this side; told below when it is so on all sides
            problems.append(error)
            continue
        map_s = perf_counter() - began_s
        result = search_space_time(moving_map, start, goal)
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
    )


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
