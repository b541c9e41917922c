"""Distinct routes of a scene, each timed, so that one can be chosen: by elbow side and by what is passed how."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from planarm.errors import NoPathError, TimingError
from planarm.model.kinematics import ElbowSide
from planarm.routes.route import Route, no_path, smoothed_joint_route, tip_route
from planarm.scene import JointSpaceSpec, Scene
from planarm.search.alternatives import Way, ways
from planarm.search.diagnosis import diagnose
from planarm.search.joint_space import tip_points_cm
from planarm.search.path import Path
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import joint_world, pose_spare_cm

SAMPLES = 4_000
"""Poses along a motion at which its clearance is looked at."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """A way and its figures."""

    path: Path
    elbow: tuple[ElbowSide, ElbowSide]
    """At start and goal."""
    passes: tuple[str, ...]
    """Obstacles whose direction is passed, each with the elbow's side there, in words."""
    elbow_changes: int
    """With any, only planning in joint space can follow it."""
    motion_s: float | None
    """Duration of the motion; None when it cannot be timed."""
    clearance_cm: float | None
    """Least distance between an obstacle, or the floor, and a link's edge during the motion."""
    problem: str = ""
    """Why it cannot be timed."""

    def fields(self) -> dict[str, object]:
        """Return the figures for JSON."""
        return {
            "elbow": list(self.elbow),
            "passes": list(self.passes),
            "elbow_changes": self.elbow_changes,
            "length_cm": self.path.length_cm,
            "motion_s": self.motion_s,
            "clearance_cm": self.clearance_cm,
            "problem": self.problem,
        }


def alternatives(
    scene: Scene, margin_cm: float, count: int, told: Callable[[float], None] = lambda _share: None
) -> list[Alternative]:
    """Return up to `count` distinct routes, the shortest tip's way first.

    Each is what planning would make of it: in tip space where the scene plans there and the elbow keeps its side, else
    in joint space.

    Args:
        scene: the scene.
        margin_cm: least distance of a link's centre line to an obstacle.
        count: how many are wanted.
        told: told the share that is done.

    Raises:
        SceneError, NoPathError: there is none at all.
    """
    spec = scene.joint_space or JointSpaceSpec(
        objective="tip_length", start_elbow=scene.arm.elbow, goal_elbow=scene.arm.elbow
    )
    found = []
    for way in islice(ways(scene, margin_cm, spec), count):
        found.append(_alternative(scene, margin_cm, way))
        told(len(found) / count)
    if not found:
        raise no_path(scene, diagnose(scene, margin_cm))
    return sorted(found, key=lambda one: one.path.length_cm)


def _alternative(scene: Scene, margin_cm: float, way: Way) -> Alternative:
    passes = tuple(f"obstacles[{number}] {side}" for number, side in way.passed)
    try:
        route = _route(scene, margin_cm, way)
    except TimingError as error:
        path = Path.through(tip_points_cm(scene, way.route.poses_rad), way.route.sides[0])
        return Alternative(path, way.route.sides, passes, len(way.route.changes_cm), None, None, str(error))
    trajectory = fastest_motion(route.smooth, Limits.of(scene))
    poses = trajectory.sample(np.linspace(0.0, trajectory.duration_s, SAMPLES))[0]
    bare = joint_world(scene, 0.5 * scene.arm.link_width_cm)
    least_cm = min(pose_spare_cm(bare, pose) for pose in poses)
    return Alternative(
        route.path,
        way.route.sides,
        passes,
        len(way.route.changes_cm),
        trajectory.duration_s,
        least_cm if np.isfinite(least_cm) else None,
    )


def _route(scene: Scene, margin_cm: float, way: Way) -> Route:
    """Return the way as planning would make it."""
    start, _ = way.route.sides
    if scene.joint_space is None and not way.route.changes_cm:
        one_side = replace(scene, arm=replace(scene.arm, elbow=start))
        try:
            return tip_route(one_side, margin_cm)
        except NoPathError:  # on the grid of tip space it is closed; the way in joint space is there all the same
            pass
    return smoothed_joint_route(scene, margin_cm, way.route, 0.0)
