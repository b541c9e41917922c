"""Small moves of a real arm: jogging, and going to a point on a certified path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planarm.errors import LinkError, SceneError, UsageError
from planarm.link.exchange import StreamResult
from planarm.link.stream import StreamProgress
from planarm.link.transport import Transport
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.motions.margin import planning_margin_cm
from planarm.motions.motion import timed
from planarm.notice import silent
from planarm.pipeline import plan_scene
from planarm.scene import Scene, TaskSpec
from planarm.smoothing.joint_blend import blend_poses
from planarm.stepping.certify import certify
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.schedule import schedule
from planarm.streaming.plan_stream import options_for, stream, warn_before
from planarm.streaming.standing import Standing, pose_of, require_no_doubts
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import joint_world

Progress = Callable[[StreamProgress], None]
Warn = Callable[[str], None]


def goto(
    transport: Transport,
    scene: Scene,
    standing: Standing,
    target_cm: tuple[float, float] | None,
    on_progress: Progress,
    pose_rad: NDArray[np.float64] | None = None,
    warn: Warn | None = None,
) -> tuple[SegmentPlan, StreamResult]:
    """Plan a certified path from where the arm stands to a point, or to joint angles, and execute it.

    `warn` is told before it moves what may go wrong: an arm that would fall on release, a limit switch on its way.

    Raises:
        LinkError: the arm's place is not known, or its limit switches contradict it.
        UsageError: the scene's planner does not go from or to what is given.
        PlanarmError: as in planning and streaming.
    """
    if standing.how is None:
        raise LinkError("where the arm stands is not known: 'planarm home SCENE' or 'planarm zero SCENE' first")
    require_no_doubts(standing)
    there = replace(scene, task=_task(scene, standing, target_cm, pose_rad))
    plan = plan_scene(there, silent)
    if plan.segments.start_usteps != standing.usteps:
        raise SceneError(
            scene.source,
            "arm.elbow",
            f"the arm stands on the other elbow side, {standing.usteps} instead of {plan.segments.start_usteps} usteps;"
            " plan in joint space ([joint_space]), or jog it to this side",
        )
    if warn is not None:
        warn_before(there, plan.segments, warn)
    how = options_for(there, plan.segments)
    result = stream(plan.segments, plan.certificate, transport, on_progress, how, warn=warn)
    return plan.segments, result


def _task(
    scene: Scene, standing: Standing, target_cm: tuple[float, float] | None, pose_rad: NDArray[np.float64] | None
) -> TaskSpec:
    """Return the task from where the arm stands; a planner on a roadmap starts at its very pose."""
    here_rad, here_cm = pose_of(scene, standing.usteps)
    if not scene.planner.on_roadmap:
        if target_cm is None:
            raise UsageError(f"{scene.planner.algorithm!r} goes to points: give X Y, or plan on a roadmap")
        return TaskSpec(here_cm, target_cm)
    start = tuple(map(float, here_rad))
    if pose_rad is not None:
        x_cm, y_cm = forward(Arm.from_spec(scene.arm), pose_rad)[-1]
        return TaskSpec(here_cm, (float(x_cm), float(y_cm)), start, tuple(map(float, pose_rad)))
    if target_cm is None or len(scene.joints) != 2:
        raise UsageError(f"an arm with {len(scene.joints)} links has not one pose at a point; give --deg ANGLE ...")
    return TaskSpec(here_cm, target_cm, start)


def jog(
    transport: Transport,
    scene: Scene,
    standing: Standing,
    joint: int,
    by_rad: float,
    on_progress: Progress,
    warn: Warn | None = None,
) -> tuple[SegmentPlan, StreamResult]:
    """Turn one joint, from 0, by an angle, straight; among the obstacles where the arm's place is known.

    `warn` is told as in `goto`, where the place is known. A joint that stands outside its limits may turn as far as it
    is out, and inwards.

    Raises:
        NoPathError: it would touch one.
        PlanarmError: as in timing and streaming.
    """
    end_rad = pose_of(scene, standing.usteps)[0]
    end_rad[joint] += by_rad
    return move_straight(transport, scene, standing, end_rad, on_progress, warn)


def move_straight(
    transport: Transport,
    scene: Scene,
    standing: Standing,
    end_rad: NDArray[np.float64],
    on_progress: Progress,
    warn: Warn | None = None,
) -> tuple[SegmentPlan, StreamResult]:
    """Turn the joints straight to angles, shape (joints,); all else as `jog`."""
    known = standing.how is not None
    begin = pose_of(scene, standing.usteps)[0]
    scene = _with_limits_around(scene, begin)
    anywhere = replace(scene.arm, floor=False, joint_limits_rad=tuple((-1e3, 1e3) for _ in scene.joints))
    free = scene if known else replace(scene, obstacles=(), arm=anywhere)
    world = joint_world(free, planning_margin_cm(free))
    spline = blend_poses(np.array([begin, end_rad]), Arm.from_spec(scene.arm), world, None)
    speed_limits = Limits.of(scene)
    fastest = fastest_motion(spline, speed_limits)
    trajectory, train, segments = schedule(scene, lambda limit: timed(scene, fastest, speed_limits, limit))
    goal_cm = pose_of(scene, train.end_usteps)[1]
    start_cm = pose_of(scene, standing.usteps)[1]
    here = replace(free, task=replace(scene.task, start_cm=start_cm, goal_cm=goal_cm))
    certificate = certify(here, trajectory, train, segments)
    if standing.doubts and warn is not None:
        warn(standing.doubts)
    if known and warn is not None:
        warn_before(scene, segments, warn)
    options = options_for(scene, segments, known=known)
    return segments, stream(segments, certificate, transport, on_progress, options, warn=warn)


def _with_limits_around(scene: Scene, q_rad: NDArray[np.float64]) -> Scene:
    """Return the scene with joint limits that a pose is within; homing ends outside, where switches lie beyond them."""
    limits = zip(scene.arm.joint_limits_rad, map(float, q_rad), strict=True)
    hull = tuple((min(low, angle), max(high, angle)) for (low, high), angle in limits)
    return replace(scene, arm=replace(scene.arm, joint_limits_rad=hull))
