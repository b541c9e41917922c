"""Ways that leave a path: from one of its next corners, or along its tangent, into a way on the roadmap."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.model.arm import Arm
from planarm.roadmap.planning import RoadmapTask, ways_on
from planarm.scene import Scene
from planarm.smoothing.joint_blend import blend_poses
from planarm.smoothing.joint_spline import JointSpline, part_of, run_on, scaled
from planarm.workspace.joint_proof import JointWorld, prove_joint_line, prove_pieces
from planarm.workspace.proof import PROVED

Floats = NDArray[np.float64]

MOST_CORNERS = 6
"""Corners of the old way up to which it may be left."""
BETWEEN_RAD = 0.15
"""Between corners it may be left about so often."""
PLACES_RAD = (0.15, 0.3, 0.45, 0.65, 0.9, 1.2, 1.6, 2.1, 2.8)
"""So far along it a curve may be left, too: each place costs a question to the search."""
ROUNDING_RAD = 1e-9
REACHES_RAD = (0.2, 0.45, 0.8)
"""How far a path's tangent is followed."""
MOST_TAILS = 6
"""Of the ways along tangents that lead on and can be begun at the speed, the first ones."""
PLACE_SAMPLES = 200
SHOWN_POSES = 8
"""By which what is past of a curve is told in reports."""


@dataclass(frozen=True, slots=True, eq=False)
class Tail:
    """A way from where a motion is left on."""

    path: JointSpline
    poses_rad: Floats
    """Of the whole way, the old part included."""
    cost: float


def tails(
    scene: Scene, task: RoadmapTask, path: JointSpline, poses_rad: Floats, at_s: float, world: JointWorld
) -> Iterator[Tail]:
    """Yield ways that leave a path from a parameter on, among all obstacles of a scene.

    Args:
        scene: with all obstacles.
        task: the roadmap with all of them, and its planner.
        path: the path.
        poses_rad: the way that it was made of, shape (m, n).
        at_s: the path parameter from which on it may be left.
        world: the arm among all obstacles.
    """
    if is_rounded(path, poses_rad):
        return tails_at_corners(scene, task, path, poses_rad, at_s, world)
    return tails_along_tangents(scene, task, path, at_s, world)


def is_rounded(path: JointSpline, poses_rad: Floats) -> bool:
    """Tell whether a path is a polyline with its corners rounded, its parameter the way along that."""
    legs = np.linalg.norm(np.diff(poses_rad, axis=0), axis=1)
    ends_s = np.cumsum(legs)
    if not len(legs) or abs(ends_s[-1] - path.borders_s[-1]) > ROUNDING_RAD:
        return False
    middles = 0.5 * (poses_rad[:-1] + poses_rad[1:])
    return bool(np.abs(path.evaluate(ends_s - 0.5 * legs).q_rad - middles).max() < ROUNDING_RAD)


def tails_at_corners(
    scene: Scene, task: RoadmapTask, path: JointSpline, poses_rad: Floats, at_s: float, world: JointWorld
) -> Iterator[Tail]:
    """Yield ways that leave a rounded polyline at one of its next corners or between them, the cheapest first."""
    ahead = _ahead(path, poses_rad, at_s, world)
    ways = ways_on(task, world, np.array(ahead.poses_rad)) if ahead.poses_rad else []
    for cost, k, way in ways:
        straight_s = _straight_from(path, max(at_s, ahead.leg_s[k]))
        if straight_s < ahead.s[k]:
            turned = _turned(path.evaluate(np.array([straight_s])).q_rad[0], way, scene, world)
            rest = turned if straight_s == at_s else run_on([part_of(path, at_s, straight_s), turned])
            yield Tail(rest, np.concatenate([poses_rad[: ahead.corner[k]], way]), cost)


def tails_along_tangents(
    scene: Scene, task: RoadmapTask, path: JointSpline, at_s: float, world: JointWorld
) -> Iterator[Tail]:
    """Yield ways that leave any path along its tangent, from some places on it, and turn into a way from there."""
    end_s = float(path.borders_s[-1])
    old = np.linspace(0.0, at_s, SHOWN_POSES)
    for left_s in _places(path, at_s, end_s):
        if left_s > at_s and _is_touched(path, at_s, left_s, world):
            return
        state = path.evaluate(np.array([left_s]))
        pose, rate = state.q_rad[0], float(np.linalg.norm(state.dq_rad[0]))
        for reach_rad in REACHES_RAD:
            there = pose + reach_rad / rate * state.dq_rad[0]
            if prove_joint_line(world, pose, there)[0] != PROVED:
                break
            for cost, _, way in ways_on(task, world, there[None]):
                turned = scaled(_turned(pose, way, scene, world), rate)
                rest = turned if left_s == at_s else run_on([part_of(path, at_s, left_s), turned])
                yield Tail(rest, np.concatenate([path.evaluate(old).q_rad, pose[None], way]), cost)


def _places(path: JointSpline, at_s: float, end_s: float) -> list[float]:
    """Return where a path may be left: at once, and after some of its travel."""
    s = np.linspace(at_s, end_s, PLACE_SAMPLES)
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path.evaluate(s).q_rad, axis=0), axis=1))])
    wanted = np.array((0.0, *PLACES_RAD))
    return [float(one) for one in np.interp(wanted[wanted < travel[-1]], travel, s)]


def _is_touched(path: JointSpline, from_s: float, to_s: float, world: JointWorld) -> bool:
    part = part_of(path, from_s, to_s)
    return prove_pieces(world, part.borders_s, part.coefficients)[0] != PROVED


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


def _turned(start: Floats, way: Floats, scene: Scene, world: JointWorld) -> JointSpline:
    """Return a path that runs straight from a pose to where `way` begins, and along it."""
    # All of what is left of the leg may be used for the corner: as if the leg were twice as long.
    blended = blend_poses(
        np.concatenate([2.0 * start[None] - way[:1], way]),
        Arm.from_spec(scene.arm),
        world,
        _tolerance_cm(scene),
        proved=True,
    )
    return part_of(blended, float(np.linalg.norm(way[0] - start)), float(blended.borders_s[-1]))


def _straight_from(path: JointSpline, s: float) -> float:
    """Return the first parameter from s on at which the path runs straight."""
    piece = int(np.clip(np.searchsorted(path.borders_s, s, side="right") - 1, 0, len(path.coefficients) - 1))
    while piece + 1 < len(path.coefficients) and path.coefficients[piece, 2:].any():
        piece += 1
        s = float(path.borders_s[piece])
    return s


def _tolerance_cm(scene: Scene) -> float | None:
    return None if scene.motion.corners == "stop" else scene.motion.tolerance_cm
