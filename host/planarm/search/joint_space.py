"""Path planning in joint space: both elbow sides, with a change of side as a costed move through the straight pose.

The lattice lies over (theta1, theta2) within the limits of the joints; theta2 = 0 is a row: there the arm is straight
and the elbow changes its side. A pose that the limits allow in several turns is several poses. Every move is proved
free for the whole arm by a bound on its motion (`planarm.workspace.joint_proof`); the way that is found is then pulled
straight.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, floor, pi
from time import perf_counter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planarm.model.arm import Arm
from planarm.model.kinematics import ElbowSide, forward, inverse_2r
from planarm.scene import JointObjective, JointSpaceSpec, Point, Scene
from planarm.search.joint_lattice import (
    JOINT_TRAVEL,
    TIME,
    TIP_LENGTH,
    Costs,
    JointLattice,
    fill_spare,
    least_cost,
    move_cost,
    pull,
    search_joints,
)
from planarm.search.result import SearchStatus
from planarm.search.stencils import primitive, stencil
from planarm.workspace.joint_proof import JointWorld, joint_world

Floats = NDArray[np.float64]

OBJECTIVES: Final[dict[JointObjective, int]] = {"joint_travel": JOINT_TRAVEL, "time": TIME, "tip_length": TIP_LENGTH}
SIDES: Final[tuple[ElbowSide, ...]] = ("up", "down")
STEP_CM: Final = 0.25
"""The tip's way is told by points about this far apart."""


@dataclass(frozen=True, slots=True, eq=False)
class JointRoute:
    """A way in joint space."""

    poses_rad: Floats
    """Shape (m, joints), m >= 1, from start to goal; straight moves between them are proved free."""
    objective: str
    """What is least, in words."""
    cost: float
    """Sum over the moves in the objective's unit (rad, s, cm or J), changes of the elbow's side included."""
    bound: float
    """What any way between these two poses costs at least: the straight move's cost, or the tip's straight line."""
    joint_travel_rad: float
    time_s: float
    """What the joints' speeds alone ask for; acceleration comes on top."""
    tip_length_cm: float
    changes_cm: tuple[Point, ...]
    """Where the tip is each time an elbow changes its side."""
    sides: tuple[ElbowSide, ElbowSide]
    """The first elbow's side at start and goal."""


@dataclass(frozen=True, slots=True)
class JointSearchResult:
    """The answer of a search in joint space."""

    status: SearchStatus
    reason: str
    route: JointRoute | None
    expanded: int
    generated: int
    plan_s: float
    """Wall time in seconds, without compiling or loading kernels."""


def find_joint_route(
    scene: Scene, margin_cm: float, spec: JointSpaceSpec | None = None, closed: Sequence[tuple[float, float]] = ()
) -> JointSearchResult:
    """Search a cheapest way between start and goal in joint space.

    Args:
        scene: a scene with a two-link arm.
        margin_cm: least distance of a link's centre line to an obstacle.
        spec: how to search; None takes the scene's, or the defaults.
        closed: half lines in joint space that no move may cross: theta1 in radians, and the sign of theta2.
    """
    spec = spec or scene.joint_space or JointSpaceSpec()
    world = joint_world(scene, margin_cm)
    costs = _costs(scene, spec, closed)
    _load_kernels(world, costs)
    began_s = perf_counter()
    starts = _poses(scene, scene.task.start_cm, spec.start_elbow)
    goals = _poses(scene, scene.task.goal_cm, spec.goal_elbow)
    lattice = _lattice(world, spec.cell_rad, goals, starts)
    problem = _ends_problem(scene, world, lattice, spec, len(goals))
    if problem:
        return JointSearchResult(*problem, None, 0, 0, perf_counter() - began_s)
    dx, dy = np.ascontiguousarray(primitive(stencil("chs", 28)).T, dtype=np.int64)
    nodes, expanded, made = search_joints(world, lattice, costs, dx, dy)
    if not len(nodes):
        reason = (
            f"No way in joint space from {_point(scene.task.start_cm)} to {_point(scene.task.goal_cm)}: {expanded} "
            f"poses are reached and none further, at cells of {np.degrees(spec.cell_rad):g} degrees and a margin of "
            f"{margin_cm:g} cm."
        )
        return JointSearchResult(SearchStatus.NO_PATH, reason, None, expanded, made, perf_counter() - began_s)
    poses = np.array([_pose(lattice, int(node)) for node in nodes])
    kept = pull(world, costs, poses, lattice.spare_cm[nodes])
    route = _route(scene, world, costs, spec, poses[kept])
    return JointSearchResult(SearchStatus.FOUND, "", route, expanded, made, perf_counter() - began_s)


def tip_points_cm(scene: Scene, poses_rad: Floats) -> Floats:
    """Return the tip's way along straight moves in joint space as points about STEP_CM apart, shape (m, 2)."""
    arm = Arm.from_spec(scene.arm)
    levers_cm = np.cumsum(arm.link_lengths_cm[::-1])[::-1]
    parts = [poses_rad[:1]]
    for a, b in pairwise(poses_rad):
        count = max(1, ceil(float(np.abs(b - a) @ levers_cm) / STEP_CM))
        parts.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    tips: Floats = forward(arm, np.concatenate(parts))[:, -1]
    return tips


def _costs(scene: Scene, spec: JointSpaceSpec, closed: Sequence[tuple[float, float]]) -> Costs:
    return Costs(
        OBJECTIVES[spec.objective],
        np.array([joint.max_speed_rad_s for joint in scene.joints]),
        spec.elbow_change_cost,
        np.array([sum(scene.arm.link_lengths_cm), scene.arm.link_lengths_cm[1]]),
        np.array(closed, np.float64).reshape(-1, 2),
    )


def _poses(scene: Scene, point_cm: Point, elbow: str) -> Floats:
    """Return all poses with the tip at a point, within the joints' limits, in every turn: shape (n, 2)."""
    arm = Arm.from_spec(scene.arm)
    found = []
    for side in SIDES if elbow == "either" else (elbow,):
        theta1, theta2 = inverse_2r(arm, point_cm, side)  # type: ignore[arg-type] # a side, not "either"
        (low1, high1), (low2, high2) = arm.joint_limits_rad
        if not (np.isfinite(theta1) and low2 <= theta2 <= high2):
            continue
        first, last = ceil((low1 - theta1) / (2 * pi) - 1e-9), floor((high1 - theta1) / (2 * pi) + 1e-9)
        found += [(theta1 + 2 * pi * turn, theta2) for turn in range(first, last + 1)]
    return np.array(found).reshape(-1, 2)


def _lattice(world: JointWorld, cell_rad: float, goals: Floats, starts: Floats) -> JointLattice:
    firsts = [ceil(low / cell_rad - 1e-9) for low in world.low_rad]
    lasts = [floor(high / cell_rad + 1e-9) for high in world.high_rad]
    columns, rows = (max(0, last - first + 1) for first, last in zip(firsts, lasts, strict=True))
    given = np.concatenate([goals, starts])
    lattice = JointLattice(
        firsts[0], firsts[1], columns, rows, cell_rad, given, len(goals), np.empty(columns * rows + len(given))
    )
    fill_spare(world, lattice)
    return lattice


def _ends_problem(
    scene: Scene, world: JointWorld, lattice: JointLattice, spec: JointSpaceSpec, goals: int
) -> tuple[SearchStatus, str] | None:
    """Return what forbids all poses at the start, or at the goal."""
    spare = lattice.spare_cm[lattice.columns * lattice.rows :]
    ends = (
        (SearchStatus.START_BLOCKED, "start", scene.task.start_cm, spec.start_elbow, spare[goals:]),
        (SearchStatus.GOAL_BLOCKED, "goal", scene.task.goal_cm, spec.goal_elbow, spare[:goals]),
    )
    for status, name, point, elbow, room in ends:
        if not len(room):
            return status, f"The {name} {_point(point)} is out of reach or of arm.joint_limits_deg, elbow {elbow}."
        if not (room > 0.0).any():
            return status, (
                f"At the {name} {_point(point)}, elbow {elbow}, a link's centre line is nearer than "
                f"{world.margin_cm:.4g} cm to an obstacle or the floor, by {-float(room.max()):.3f} cm at the least."
            )
    return None


def _route(scene: Scene, world: JointWorld, costs: Costs, spec: JointSpaceSpec, poses: Floats) -> JointRoute:
    cost = sum(move_cost(world, costs, *a, *b) for a, b in pairwise(poses))
    return made_route(scene, poses, spec.objective, cost, least_cost(world, costs, *poses[0], *poses[-1]))


def made_route(scene: Scene, poses: Floats, objective: str, cost: float, bound: float) -> JointRoute:
    """Return a way through poses of shape (m, joints), and what is told of it."""
    speeds = np.array([joint.max_speed_rad_s for joint in scene.joints])
    tips = tip_points_cm(scene, poses)
    changes = []
    for a, b in pairwise(poses):
        changing = np.flatnonzero((a[1:] < 0.0) != (b[1:] < 0.0)) + 1
        for share in np.sort(a[changing] / (a[changing] - b[changing])):
            x, y = forward(Arm.from_spec(scene.arm), a + share * (b - a))[-1]
            changes.append((float(x), float(y)))
    poses.flags.writeable = False
    turns = np.abs(np.diff(poses, axis=0))
    return JointRoute(
        poses_rad=poses,
        objective=objective,
        cost=cost,
        bound=bound,
        joint_travel_rad=float(np.linalg.norm(turns, axis=1).sum()),
        time_s=float((turns / speeds).max(axis=1, initial=0.0).sum()),
        tip_length_cm=float(np.hypot(*np.diff(tips, axis=0).T).sum()),
        changes_cm=tuple(changes),
        sides=(_first_side(poses[0]), _first_side(poses[-1])),
    )


def _first_side(pose_rad: Floats) -> ElbowSide:
    """Return the side of a pose's first elbow; an arm of one link has none, and counts as "down"."""
    return "up" if len(pose_rad) > 1 and pose_rad[1] < 0.0 else "down"


def _pose(lattice: JointLattice, node: int) -> tuple[float, float]:
    size = lattice.columns * lattice.rows
    if node >= size:
        theta1, theta2 = lattice.given_rad[node - size]
        return float(theta1), float(theta2)
    column, row = node % lattice.columns, node // lattice.columns
    return (lattice.column + column) * lattice.cell_rad, (lattice.row + row) * lattice.cell_rad


def _load_kernels(world: JointWorld, costs: Costs) -> None:
    """Compile the search, or load it from the cache, by a search from a pose to itself."""
    pose = np.array([[0.5 * (low + high) for low, high in zip(world.low_rad, world.high_rad, strict=True)]] * 2)
    lattice = JointLattice(0, 0, 0, 0, 1.0, pose, 1, np.ones(2))
    none = np.empty(0, np.int64)
    search_joints(world, lattice, costs, none, none)
    pull(world, costs, pose, np.ones(2))


def _point(point_cm: Point) -> str:
    return f"({point_cm[0]:g}, {point_cm[1]:g}) cm"
