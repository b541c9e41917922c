"""Why there is no path, and what would help: the answer of a search that failed, in words and in fields."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from math import hypot
from typing import Any, Final, Literal

import numpy as np

from planarm.errors import SceneError
from planarm.model.arm import Arm
from planarm.model.kinematics import ElbowSide, inverse_2r
from planarm.scene import ElbowChoice, JointSpaceSpec, Point, Scene
from planarm.search.grid_search import find_path
from planarm.search.joint_space import SIDES, JointSearchResult, find_joint_route
from planarm.search.passage import closing_obstacles, passes, widest_margin_cm
from planarm.search.result import SearchStatus
from planarm.workspace.check_task import pose_problem
from planarm.workspace.free_map import FreeMap, build_free_map
from planarm.workspace.world import (
    BEYOND_REACH,
    FREE,
    INNER_HOLE,
    TwoLinkArm,
    build_world,
    clearances_cm,
    elbow_sides,
    region_at,
)

Cause = Literal["beyond_reach", "inner_hole", "obstacle", "limit", "join", "passage", "elbow", "draw"]
End = Literal["start", "goal"]

JOINT_SPACE: Final = "a table [joint_space] in the scene, or --space joint"


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Why there is no path. Obstacles are counted from 1, as in messages; lengths are centimetres."""

    status: SearchStatus
    cause: Cause
    reason: str
    """A sentence."""
    advice: tuple[str, ...]
    """What would help, a sentence each; the first is the smallest change."""
    elbow: ElbowSide
    """The side that this is about."""
    blocking: tuple[int, ...] = ()
    """Obstacles nearer to the pose than the margin."""
    opening: tuple[tuple[int, ...], ...] = ()
    """Sets of obstacles each of which opens the way when taken away."""
    margin_cm: float = 0.0
    """What is to be kept between a link's centre line and an obstacle."""
    room_cm: float | None = None
    """What there is instead: at the pose, or at the narrowest place of the widest way; None when there is none."""
    nearest_cm: Point | None = None
    """The free node nearest to the start or goal in question."""
    reachable_cm: Point | None = None
    """The point within reach nearest to the start or goal in question."""

    @property
    def short_cm(self) -> float | None:
        """How much room is missing."""
        return None if self.room_cm is None else self.margin_cm - self.room_cm

    def fields(self) -> dict[str, Any]:
        """Return everything for JSON."""
        return {**asdict(self), "status": self.status.value, "short_cm": self.short_cm}


def diagnose(scene: Scene, margin_cm: float) -> Diagnosis:
    """Say why a scene has no path at a margin.

    Args:
        scene: a scene for which no allowed elbow side has a path.
        margin_cm: least distance of a link's centre line to an obstacle.

    Raises:
        SceneError: the limits of joint 2 leave no pose on any allowed side.
    """
    maps = dict(_maps(scene, margin_cm))
    ends: tuple[tuple[End, Point], ...] = (("start", scene.task.start_cm), ("goal", scene.task.goal_cm))
    sides = {
        name: [side for side, free_map in maps.items() if not pose_problem(scene, free_map.world, point)]
        for name, point in ends
    }
    for name, point in ends:
        if not sides[name]:
            side = next(iter(maps))
            return _diagnose_end(scene, maps[side], name, point, _other_sides(scene, margin_cm, maps, point))
    common = [side for side in maps if side in sides["start"] and side in sides["goal"]]
    if not common:
        return _elbow_would_have_to_change(scene, margin_cm, sides["start"][0], sides["goal"][0])
    return _diagnose_way(scene, maps[common[0]])


def diagnose_joints(scene: Scene, margin_cm: float, result: JointSearchResult) -> Diagnosis:
    """Say why a scene has no way in joint space.

    Args:
        scene: the scene.
        margin_cm: least distance of a link's centre line to an obstacle.
        result: what the search answered.
    """
    spec = scene.joint_space or JointSpaceSpec()
    sides: dict[ElbowChoice, ElbowSide] = {"up": "up", "down": "down", "either": "up"}
    if result.status in (SearchStatus.START_BLOCKED, SearchStatus.GOAL_BLOCKED):
        name: End = "start" if result.status is SearchStatus.START_BLOCKED else "goal"
        point = scene.task.start_cm if name == "start" else scene.task.goal_cm
        side = sides[spec.start_elbow if name == "start" else spec.goal_elbow]
        found = _diagnose_end(scene, build_free_map(scene, margin_cm, side), name, point, [])
        return replace(found, reason=f"[{point[0]:g}, {point[1]:g}]: {result.reason}")
    opening = tuple(
        (k + 1,)
        for k in range(len(scene.obstacles))
        if find_joint_route(_without(scene, k), margin_cm, spec).route is not None
    )
    advice = [f"taking away {' or '.join(_list(one) for one in opening)} opens the way"] if opening else []
    advice.append(f"joint_space.cell_deg below {np.degrees(spec.cell_rad):g}")
    side = sides[spec.start_elbow]
    return Diagnosis(result.status, "passage", result.reason, tuple(advice), side, opening=opening, margin_cm=margin_cm)


def _without(scene: Scene, k: int) -> Scene:
    return replace(scene, obstacles=scene.obstacles[:k] + scene.obstacles[k + 1 :])


def _maps(scene: Scene, margin_cm: float) -> Iterator[tuple[ElbowSide, FreeMap]]:
    """Yield the map of each allowed side that the limits of joint 2 leave."""
    problem: SceneError | None = None
    none = True
    for side in elbow_sides(scene.arm):
        try:
            yield side, build_free_map(scene, margin_cm, side)
            none = False
        except SceneError as error:
            problem = error
    if none and problem:
        raise problem


def _diagnose_end(
    scene: Scene, free_map: FreeMap, name: End, point_cm: Point, other_sides: list[ElbowSide]
) -> Diagnosis:
    """Say why the pose at a start or goal is not free, and where the nearest free one is."""
    world = free_map.world
    cause = _cause(world.arm, point_cm)
    nearest = _nearest_free_cm(free_map, point_cm)
    reachable = _nearest_reachable_cm(world.arm, point_cm) if cause in ("beyond_reach", "inner_hole", "limit") else None
    near = _clearances_cm(scene, free_map, point_cm) if reachable is None or cause == "limit" else {}
    blocking = tuple(k for k, clearance in near.items() if clearance <= free_map.margin_cm)
    if blocking:
        cause = "obstacle"
    advice = []
    if nearest:
        away_cm = hypot(nearest[0] - point_cm[0], nearest[1] - point_cm[1])
        advice.append(
            f"the nearest free cell is ({nearest[0]:g}, {nearest[1]:g}) cm, {away_cm:.2f} cm away: task.{name}_cm"
        )
    advice += [f'the pose is free on the other elbow side: arm.elbow = "{side}"' for side in other_sides]
    if other_sides and name == "goal":
        advice.append(f"in joint space the elbow may change its side on the way: {JOINT_SPACE}")
    if blocking:
        least = min(near[k] for k in blocking)
        advice.append(
            f"{_list(blocking)} would have to be {free_map.margin_cm - least:.3f} cm farther away, or be taken away"
        )
    return Diagnosis(
        SearchStatus.START_BLOCKED if name == "start" else SearchStatus.GOAL_BLOCKED,
        cause,
        f"[{point_cm[0]:g}, {point_cm[1]:g}] {pose_problem(scene, world, point_cm)}",
        tuple(advice),
        free_map.elbow,
        blocking=blocking,
        margin_cm=free_map.margin_cm,
        room_cm=min(near.values()) if near else None,
        nearest_cm=nearest,
        reachable_cm=reachable,
    )


def _diagnose_way(scene: Scene, free_map: FreeMap) -> Diagnosis:
    """Say why two free poses on one side are not joined."""
    result = find_path(free_map, scene.task.start_cm, scene.task.goal_cm, scene.planner)
    side, margin_cm = free_map.elbow, free_map.margin_cm
    if result.status in (SearchStatus.START_BLOCKED, SearchStatus.GOAL_BLOCKED):
        smaller = f"workspace.cell_cm below {free_map.cell_cm:g}"
        return Diagnosis(result.status, "join", result.reason, (smaller,), side, margin_cm=margin_cm)
    if scene.planner.algorithm == "chaos_a_star" and passes(scene, margin_cm, side):
        others = ("another planner.seed, or planner.subset", 'planner.algorithm = "chs", which finds a path')
        return Diagnosis(SearchStatus.NO_PATH, "draw", result.reason, others, side, margin_cm=margin_cm)
    opening = tuple(tuple(k + 1 for k in one) for one in closing_obstacles(scene, margin_cm, side))
    room_cm = widest_margin_cm(scene, margin_cm, side)
    advice = tuple(_advice_on_way(scene, margin_cm, side, opening, room_cm))
    return Diagnosis(
        SearchStatus.NO_PATH,
        "passage",
        result.reason,
        advice,
        side,
        opening=opening,
        margin_cm=margin_cm,
        room_cm=room_cm,
    )


def _advice_on_way(
    scene: Scene, margin_cm: float, side: ElbowSide, opening: tuple[tuple[int, ...], ...], room_cm: float | None
) -> Iterator[str]:
    """Yield what would open the way."""
    if room_cm is not None:
        short_cm = margin_cm - room_cm
        yield f"the widest way has room for a margin of {room_cm:.3f} cm where {margin_cm:.3f} cm are to be kept"
        if short_cm <= scene.workspace.clearance_cm:
            yield f"workspace.clearance_cm = {_below(scene.workspace.clearance_cm - short_cm):g} instead of " + (
                f"{scene.workspace.clearance_cm:g}"
            )
        elif 2.0 * short_cm < scene.arm.link_width_cm:
            yield f"arm.link_width_cm = {_below(scene.arm.link_width_cm - 2.0 * short_cm):g} instead of " + (
                f"{scene.arm.link_width_cm:g}"
            )
    if opening:
        yield f"taking away {' or '.join(_list(one) for one in opening)} opens the way"
    for other in SIDES:
        if other not in elbow_sides(scene.arm) and _passes_on(scene, margin_cm, other):
            yield f'with arm.elbow = "{other}" there is a path'
    if room_cm is None and not opening:
        yield f"workspace.cell_cm below {scene.workspace.cell_cm:g}, or a larger workspace"
    if find_joint_route(scene, margin_cm).route is not None:
        yield f"in joint space there is a way, with changes of the elbow's side: {JOINT_SPACE}"


def _elbow_would_have_to_change(scene: Scene, margin_cm: float, start: ElbowSide, goal: ElbowSide) -> Diagnosis:
    reason = (
        f'the start can be held with the elbow "{start}" only, the goal with the elbow "{goal}" only, and the elbow '
        "cannot change its side in tip space"
    )
    advice = (f"{JOINT_SPACE}: there the elbow changes its side through the straight pose",)
    return Diagnosis(SearchStatus.ELBOW, "elbow", reason, advice, start, margin_cm=margin_cm)


def _cause(arm: TwoLinkArm, point_cm: Point) -> Cause:
    region = region_at(arm, hypot(point_cm[0] - arm.base_x_cm, point_cm[1] - arm.base_y_cm))
    return {BEYOND_REACH: "beyond_reach", INNER_HOLE: "inner_hole"}.get(region, "limit")  # type: ignore[return-value]


def _clearances_cm(scene: Scene, free_map: FreeMap, point_cm: Point) -> dict[int, float]:
    """Return how near the arm comes to each obstacle, counted from 1, with its tip at a point within reach."""
    q_rad = inverse_2r(Arm.from_spec(scene.arm), np.array([point_cm]), free_map.elbow)
    if not np.isfinite(q_rad).all():
        return {}
    worlds = (
        build_world(replace(scene, obstacles=(obstacle,)), free_map.margin_cm, free_map.elbow)
        for obstacle in scene.obstacles
    )
    return {k: float(clearances_cm(world, q_rad)[0]) for k, world in enumerate(worlds, start=1)}


def _nearest_free_cm(free_map: FreeMap, point_cm: Point) -> Point | None:
    rows, columns = np.nonzero(free_map.region == FREE)
    if not len(rows):
        return None
    x, y = free_map.x_cm[columns], free_map.y_cm[rows]
    k = int(np.argmin(np.hypot(x - point_cm[0], y - point_cm[1])))
    return float(x[k]), float(y[k])


def _nearest_reachable_cm(arm: TwoLinkArm, point_cm: Point) -> Point:
    """Return the nearest point whose distance from the base the links and the limits of joint 2 allow."""
    dx, dy = point_cm[0] - arm.base_x_cm, point_cm[1] - arm.base_y_cm
    r = hypot(dx, dy)
    to = min(max(r, arm.r_min_cm), arm.r_max_cm)
    ux, uy = (dx / r, dy / r) if r > 0.0 else (1.0, 0.0)
    return arm.base_x_cm + to * ux, arm.base_y_cm + to * uy


def _other_sides(scene: Scene, margin_cm: float, maps: dict[ElbowSide, FreeMap], point_cm: Point) -> list[ElbowSide]:
    """Return the sides that the scene does not allow and on which the pose would be free."""
    found: list[ElbowSide] = []
    for side in SIDES:
        if side in maps:
            continue
        try:
            world = build_world(scene, margin_cm, side)
        except SceneError:  # joint 2's limits leave nothing on that side: it is no help
            continue
        if not pose_problem(scene, world, point_cm):
            found.append(side)
    return found


def _passes_on(scene: Scene, margin_cm: float, side: ElbowSide) -> bool:
    try:
        return passes(scene, margin_cm, side)
    except SceneError:  # joint 2's limits leave nothing on that side
        return False


def _below(value_cm: float) -> float:
    """Return a value a little lower, to the hundredth of a millimetre, so that it is on the safe side of the answer."""
    return float(np.floor(value_cm * 1e3) / 1e3)


def _list(numbers: tuple[int, ...]) -> str:
    return " and ".join(f"obstacles[{number}]" for number in numbers)
