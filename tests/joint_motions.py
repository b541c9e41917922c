"""Motions of arms with any number of links through given poses, without a search; steps and segments of them."""

from dataclasses import replace
from functools import partial

import numpy as np

from board_scenes import scene_of
from planarm.model.arm import Arm
from planarm.motions.motion import timed
from planarm.routes.gentle import gentle_motion, jerk_limits
from planarm.smoothing.joint_blend import blend_poses
from planarm.stepping.schedule import schedule
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import joint_world

MARGIN_CM = 0.1


def laden(joints, end_masses_kg=(0.15, 0.15, 0.1, 0.1), **joint):
    """An arm with masses at its links' ends and nothing around it."""
    scene = scene_of(joints, **joint)
    masses = tuple(end_masses_kg[:joints])
    return replace(scene, obstacles=(), mechanics=replace(scene.mechanics, end_masses_kg=masses))


def through(scene, poses_rad, tolerance_cm=0.5):
    """(trajectory, train, segments) of the fastest motion through poses, as the pipeline makes them.

    The scene's task is not asked for: use `on_its_way` to certify.
    """
    world = joint_world(replace(scene, obstacles=()), MARGIN_CM)
    path = blend_poses(np.array(poses_rad), Arm.from_spec(scene.arm), world, tolerance_cm, proved=True)
    limits = Limits.of(scene)
    motion, jerks = fastest_motion(path, limits), jerk_limits(scene)
    if jerks is None:
        return schedule(scene, partial(timed, scene, motion, limits))
    gentle = gentle_motion(scene, MARGIN_CM, motion, limits, jerks)
    return schedule(scene, lambda _limit: gentle)


def on_its_way(scene, poses_rad):
    """The scene with the first and the last pose as its task."""
    start, goal = (tuple(float(q) for q in pose) for pose in (poses_rad[0], poses_rad[-1]))
    return replace(scene, task=replace(scene.task, start_rad=start, goal_rad=goal))
