"""Small moves of a real arm: jogging, and going to a point on a certified path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from planarm.errors import LinkError, SceneError
from planarm.link.exchange import StreamResult
from planarm.link.stream import StreamProgress
from planarm.link.transport import Transport
from planarm.model.arm import Arm
from planarm.model.transmission import Transmission
from planarm.pipeline import plan_scene, planning_margin_cm, timed
from planarm.scene import Scene
from planarm.smoothing.joint_blend import blend_poses
from planarm.stepping.certify import certify
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.schedule import schedule
from planarm.streaming.plan_stream import options_for, stream
from planarm.streaming.standing import Standing, pose_of
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import joint_world

Progress = Callable[[StreamProgress], None]


def goto(
    transport: Transport, scene: Scene, standing: Standing, target_cm: tuple[float, float], on_progress: Progress
) -> tuple[SegmentPlan, StreamResult]:
    """Plan a certified path from where the arm stands to a point, and execute it.

    Raises:
        LinkError: the arm's place is not known.
        PlanarmError: as in planning and streaming.
    """
    if standing.how is None:
        raise LinkError("where the arm stands is not known: 'planarm home SCENE' or 'planarm zero SCENE' first")
    here_cm = pose_of(scene, standing.usteps)[1]
    there = replace(scene, task=replace(scene.task, start_cm=here_cm, goal_cm=target_cm))
    plan = plan_scene(there, lambda _stage, _share: None)
    if plan.segments.start_usteps != standing.usteps:
        raise SceneError(
            scene.source,
            "arm.elbow",
            f"the arm stands on the other elbow side, {standing.usteps} instead of {plan.segments.start_usteps} usteps;"
            " plan in joint space ([joint_space]), or jog it to this side",
        )
    result = stream(plan.segments, plan.certificate, transport, on_progress, options_for(there, plan.segments))
    return plan.segments, result


def jog(
    transport: Transport, scene: Scene, standing: Standing, joint: int, by_rad: float, on_progress: Progress
) -> tuple[SegmentPlan, StreamResult]:
    """Turn one joint, from 0, by an angle, straight; among the obstacles where the arm's place is known.

    Raises:
        NoPathError: it would touch one.
        PlanarmError: as in timing and streaming.
    """
    known = standing.how is not None
    anywhere = replace(scene.arm, floor=False, joint_limits_rad=tuple((-1e3, 1e3) for _ in scene.joints))
    free = scene if known else replace(scene, obstacles=(), arm=anywhere)
    begin = Transmission.of(scene).q_rad(np.array(standing.usteps))
    end = begin.copy()
    end[joint] += by_rad
    world = joint_world(free, planning_margin_cm(free))
    spline = blend_poses(np.array([begin, end]), Arm.from_spec(scene.arm), world, None)
    speed_limits = Limits.of(scene)
    fastest = fastest_motion(spline, speed_limits)
    trajectory, train, segments = schedule(scene, lambda limit: timed(scene, fastest, speed_limits, limit))
    goal_cm = pose_of(scene, train.end_usteps)[1]
    start_cm = pose_of(scene, standing.usteps)[1]
    here = replace(free, task=replace(scene.task, start_cm=start_cm, goal_cm=goal_cm))
    certificate = certify(here, trajectory, train, segments)
    return segments, stream(segments, certificate, transport, on_progress, options_for(scene, segments))
