"""Small moves of a real arm: homing, jogging, and going to a point on a certified path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np

from planarm.errors import DeviceFault, LinkError, SceneError
from planarm.link.exchange import StreamResult, open_session, request
from planarm.link.positions import Positions
from planarm.link.session import Session, fault_words
from planarm.link.stream import StreamProgress, config_of
from planarm.link.transport import Transport
from planarm.model.arm import Arm
from planarm.model.transmission import Transmission, motor_axes
from planarm.pipeline import plan_scene, planning_margin_cm, timed
from planarm.plan_file import arm_hash
from planarm.scene import LimitSwitchSpec, Scene
from planarm.smoothing.joint_blend import blend_poses
from planarm.stepping.certify import certify
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.schedule import schedule
from planarm.stepping.windows import start_stop_ticks
from planarm.streaming.plan_stream import options_for, stream
from planarm.streaming.standing import Standing, pose_of
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import joint_world
from planarm_wire.messages import Clear, Enable, Fault, Home, Query, State, Stop

WATCH_SWITCHES = 1 << 3
"""CONFIG's option: limit switches are watched."""
HOMING_SLOWER = 4
BACK_RAD = np.radians(15.0)
HOMING_POLL_S = 0.05
HOMING_LIMIT_S = 120.0

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


def home(transport: Transport, port: str, scene: Scene, positions: Positions) -> tuple[int, ...]:
    """Move every joint that has a limit switch to it, in the order of the scene; return where the motors stand then.

    Raises:
        SceneError: a joint has no switch, or motors move several joints.
        DeviceFault: a switch was not found; the drivers hold.
        LinkError: the line failed.
    """
    axes = motor_axes(scene.joints, scene.coupling)
    homed = {switch.joint for switch in scene.limit_switches}
    missing = [number for number in range(1, len(scene.joints) + 1) if number not in homed]
    if missing or not np.array_equal(np.array(scene.coupling), np.eye(len(scene.joints))):
        raise SceneError(
            scene.source,
            "limit_switches",
            f"joints {missing} have none" if missing else "homing is for motors that each move one joint",
        )
    session = open_session(transport)
    status = request(transport, session, Query())
    if status.state is not State.IDLE:
        request(transport, session, Clear())
    told = config_of([start_stop_ticks(axis) for axis in axes])
    request(transport, session, replace(told, options=WATCH_SWITCHES))
    request(transport, session, Enable(1))
    for switch in scene.limit_switches:
        request(transport, session, _home_order(scene, switch))
        _wait_for_switch(transport, session, switch)
    assert session.welcome is not None and session.status is not None, "an open session has both"
    positions.remember(port, session.welcome.boot_nonce, arm_hash(asdict(scene)), "homed")
    return session.status.ledger.position_usteps[: len(scene.joints)]


def _home_order(scene: Scene, switch: LimitSwitchSpec) -> Home:
    """Go to the switch at the start-stop speed, where motors may stop dead, and at a quarter of it off and on again."""
    number = switch.joint - 1
    axis = scene.joints[number]
    low, high = scene.arm.joint_limits_rad[number]
    at = np.zeros(len(scene.joints))
    at[number] = switch.at_rad
    place = int(np.floor(Transmission.of(scene).usteps(at)[number] + 0.5))
    fast = max(start_stop_ticks(axis), 600)
    return Home(
        joint=number,
        positive=int(switch.above != axis.reversed),
        fast_ticks=fast,
        slow_ticks=HOMING_SLOWER * fast,
        most_usteps=int((min(high - low, 4.0 * np.pi) + 2.0 * BACK_RAD) * axis.usteps_per_rad),
        back_usteps=int(BACK_RAD * axis.usteps_per_rad),
        position_usteps=place,
    )


def _wait_for_switch(transport: Transport, session: Session, switch: LimitSwitchSpec) -> None:
    clock = transport.clock
    limit_s = clock.now_s() + HOMING_LIMIT_S
    while (status := request(transport, session, Query())).state is State.HOMING:
        if clock.now_s() > limit_s:
            request(transport, session, Stop(1))
            raise LinkError(f"joint {switch.joint}: no switch within {HOMING_LIMIT_S:g} s; it was stopped")
        clock.wait_until(clock.now_s() + HOMING_POLL_S)
    if status.fault is not Fault.NONE:
        raise DeviceFault(f"joint {switch.joint}: {fault_words(status.fault)}")
