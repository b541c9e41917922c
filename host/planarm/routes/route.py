"""From a scene to a smooth path, in tip space or in joint space; or the error that tells why there is none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from planarm.errors import NoPathError, SceneError
from planarm.model.arm import Arm
from planarm.notice import Notice
from planarm.roadmap.planning import OBJECTIVES, RoadmapTask, joint_route_of
from planarm.scene import JointSpaceSpec, Scene
from planarm.search.costed import JOINT_TRAVEL, Price, time_price
from planarm.search.diagnosis import Diagnosis, diagnose, diagnose_joints
from planarm.search.grid_search import find_path
from planarm.search.joint_space import SIDES, JointRoute, find_joint_route, made_route, tip_points_cm
from planarm.search.optimum import Told
from planarm.search.path import Path
from planarm.search.result import SearchResult, SearchStatus
from planarm.smoothing.joint_blend import blend_poses
from planarm.smoothing.smooth import smooth_path
from planarm.smoothing.smooth_path import Floats, SmoothPath
from planarm.workspace.check_task import check_task
from planarm.workspace.free_map import FreeMap, RegionMap, build_free_map, tip_map
from planarm.workspace.joint_proof import joint_world
from planarm.workspace.world import FREE, elbow_sides

OPTIMUM = "optimum"
"""The stage in which the any-angle optimum is looked for, where that takes long."""
SEARCHED = 0.4
"""The share of the stage "plan" that is done when a route is known."""


@dataclass(frozen=True, slots=True)
class Route:
    """A path and the smooth path made of it."""

    free_map: RegionMap
    """Of the path's elbow side; of a route in joint space, of both sides together, or of the tip alone."""
    path: Path
    """In tip space the way-points; of a route in joint space the tip's curve, densely."""
    smooth: SmoothPath
    search_s: float
    joint: JointRoute | None = None
    """The way-points of a route in joint space."""
    bound_cm: float | None = None
    """No path of the tip on the allowed sides' maps is shorter (docs/planners.md); None in joint space."""
    note: str = ""
    """In what the path is less than was asked for; empty when in nothing."""


def find_route(scene: Scene, margin_cm: float, notice: Notice | None = None) -> Route:
    """Search as the scene says, and smooth.

    Args:
        scene: what to do; with a planner on a roadmap there, with a table [joint_space] in joint space, else in tip
            space on each allowed elbow side.
        margin_cm: least distance of a link's centre line to an obstacle.
        notice: told how far a roadmap, or a search for the any-angle optimum, is.

    Raises:
        SceneError, NoPathError: there is no path; the message, `advice` and `fields` say why and what would help.
        TimingError: the path meets full stretch or fold, and no motion near it can be proved free.
    """
    if scene.planner.on_roadmap:
        return roadmap_route(scene, margin_cm, notice=notice)
    if scene.joint_space:
        return joint_route(scene, margin_cm, scene.joint_space)
    return tip_route(scene, margin_cm, notice)


def tip_route(scene: Scene, margin_cm: float, notice: Notice | None = None) -> Route:
    """Return the route along the shortest path of the tip on any allowed elbow side; errors as `find_route`."""
    found: list[tuple[FreeMap, Path, SearchResult, float]] = []
    bounds_cm = []
    price, sides = search_price(scene), elbow_sides(scene.arm)
    for k, side in enumerate(sides):
        try:
            free_map = build_free_map(scene, margin_cm, side, whole_cells=scene.planner.moves == "proved")
            check_task(scene, free_map)
        except SceneError:  # on this side; told below when it is so on all sides
            continue
        result = find_path(
            free_map, scene.task.start_cm, scene.task.goal_cm, scene.planner, price, _told(notice, k, len(sides))
        )
        if result.path is not None:
            cost = result.path.length_cm if result.cost is None else result.cost
            found.append((free_map, result.path, result, cost))
            bounds_cm.append(result.bound_cm)
    if not found:
        raise no_path(scene, diagnose(scene, margin_cm))
    free_map, path, result, _ = min(found, key=lambda one: one[3])
    smooth = smoothed(scene, free_map, path)
    return Route(free_map, path, smooth, result.plan_s, bound_cm=min(bounds_cm), note=result.note)


def _told(notice: Notice | None, number: int, of: int) -> Told | None:
    """Return what a search of so many takes to tell how far it is."""
    return None if notice is None else lambda share: notice(OPTIMUM, (number + share) / of)


def search_price(scene: Scene) -> Price | None:
    """Return what a scene's objective makes a way cost; None for its length."""
    if scene.planner.objective == "length":
        return None
    first, second = (joint.max_speed_rad_s for joint in scene.joints)
    return JOINT_TRAVEL if scene.planner.objective == "joint_travel" else time_price((first, second))


def joint_route(scene: Scene, margin_cm: float, spec: JointSpaceSpec) -> Route:
    """Return the route along the cheapest way in joint space; errors as `find_route`."""
    result = find_joint_route(scene, margin_cm, spec)
    if result.route is None:
        raise no_path(scene, diagnose_joints(scene, margin_cm, result))
    return smoothed_joint_route(scene, margin_cm, result.route, result.plan_s)


def roadmap_route(
    scene: Scene, margin_cm: float, task: RoadmapTask | None = None, notice: Notice | None = None
) -> Route:
    """Return the route along the cheapest way on the scene's roadmap, or on a known one; errors as `find_route`."""
    task = task or RoadmapTask.of(scene, margin_cm, roadmap_told(notice))
    began_s = perf_counter()
    answer = task.planner.solve()
    search_s = perf_counter() - began_s
    if answer.status is not SearchStatus.FOUND:
        raise task.no_way(scene)
    return smoothed_joint_route(scene, margin_cm, joint_route_of(scene, task.roadmap, answer), search_s)


def roadmap_told(notice: Notice | None) -> Told | None:
    """Return what a roadmap that is built for a plan takes to tell how far it is."""
    return None if notice is None else lambda share: notice("plan", SEARCHED * share)


def route_through(scene: Scene, margin_cm: float, poses_rad: Floats, cost: float) -> Route:
    """Return the route through configurations, shape (m, joints), joined by free moves that cost `cost`."""
    found = made_route(scene, poses_rad, OBJECTIVES[scene.roadmap.cost], cost, 0.0)
    return smoothed_joint_route(scene, margin_cm, found, 0.0)


def smoothed_joint_route(scene: Scene, margin_cm: float, found: JointRoute, search_s: float) -> Route:
    """Return a way in joint space, which is proved free, with its corners rounded or as stops."""
    poses_rad = found.poses_rad
    tolerance_cm = None if scene.motion.corners == "stop" else scene.motion.tolerance_cm
    world = joint_world(scene, margin_cm)
    smooth = blend_poses(poses_rad, Arm.from_spec(scene.arm), world, tolerance_cm, proved=True)
    path = Path.through(tip_points_cm(scene, poses_rad), found.sides[0])
    return Route(seen_map(scene, margin_cm), path, smooth, search_s, found)


def smoothed(scene: Scene, free_map: FreeMap, path: Path) -> SmoothPath:
    """Round the path's corners, or stop at them, as the scene says.

    Raises:
        TimingError: the path meets full stretch or fold, and no motion near it can be proved free.
    """
    world = joint_world(scene, free_map.margin_cm)
    motion = scene.motion
    return smooth_path(
        path, free_map, Arm.from_spec(scene.arm), world, motion.tolerance_cm, stop=motion.corners == "stop"
    )


def seen_map(scene: Scene, margin_cm: float) -> RegionMap:
    """Return a map to look at, not to search: where an arm has few poses at a point, of these, else of the tip alone.

    Raises:
        SceneError: the limits of joint 2 leave no pose at all.
    """
    return both_sides(scene, margin_cm) if len(scene.joints) == 2 else tip_map(scene, margin_cm)


def both_sides(scene: Scene, margin_cm: float) -> RegionMap:
    """Return a map of two links on which a node is free when either elbow side is.

    Raises:
        SceneError: the limits of joint 2 leave no pose at all.
    """
    maps: list[FreeMap] = []
    problem: SceneError | None = None
    for side in SIDES:
        try:
            maps.append(build_free_map(scene, margin_cm, side))
        except SceneError as error:  # joint 2's limits leave nothing on this side
            problem = error
    if problem and not maps:
        raise problem
    first, last = maps[0], maps[-1]
    return replace(first, region=np.where(first.region == FREE, FREE, last.region).astype(np.uint8))


def no_path(scene: Scene, found: Diagnosis) -> SceneError | NoPathError:
    """Return the error that tells why a scene has no path and what would help."""
    ends = {SearchStatus.START_BLOCKED: "task.start_cm", SearchStatus.GOAL_BLOCKED: "task.goal_cm"}
    error: SceneError | NoPathError
    if found.status in ends and found.cause != "join":
        error = SceneError(scene.source, ends[found.status], found.reason)
    else:
        error = NoPathError(f"{scene.source}: {found.reason}")
    error.advice, error.fields = found.advice, found.fields()
    return error
