"""Motions among moving obstacles: joint splines whose parameter is time itself, in seconds.

A path in space and time becomes one cubic piece a sample, from rest to rest (`planarm.workspace.cell_poses`); a curve
of the tip becomes a cubic spline of the joints with continuous accelerations. Both are judged as they are: the joints'
limits by the pieces' extremes, space by `planarm.workspace.moving_proof`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from planarm.model.arm import Arm
from planarm.model.kinematics import inverse_2r
from planarm.scene import Scene
from planarm.search.moving.space_time import world_of
from planarm.search.moving.timed_path import TimedPath
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.smooth_path import Floats
from planarm.workspace.joint_proof import joint_world, prove_pieces
from planarm.workspace.moving_map import MovingMap
from planarm.workspace.moving_proof import fill_move, prove_moving
from planarm.workspace.proof import PROVED

HEADROOM = 0.999
"""Share of the joints' limits that a motion uses."""

DELAY_STEP_S = 1e-3
"""To this a motion's delay margin is found, rounded down."""


class Verdict(NamedTuple):
    """What was found about a motion; `problem` is empty when it is free."""

    problem: str
    time_s: float
    obstacle: int
    """Counted from 1; 0 when it is none."""


def from_nodes(arm: Arm, path: TimedPath, sample_s: float) -> JointSpline:
    """Return the motion along a path in space and time, one piece a sample."""
    pieces = max(1, path.arrival)
    coefficients = np.zeros((pieces, 4, arm.links))
    coefficients[0, 0] = path.q_rad[0]
    for k in range(path.arrival):
        fill_move(path.q_rad[k], path.q_rad[k + 1], sample_s, coefficients[k])
    borders = sample_s * np.arange(path.arrival + 1.0)
    return JointSpline(arm, borders, coefficients, np.zeros(0))


def from_tips(arm: Arm, path: TimedPath, times_s: Floats, tips_cm: Floats) -> JointSpline | None:
    """Return the joint spline, at rest at both ends, through the poses at these tips; None when one is out of reach."""
    q_rad = inverse_2r(arm, tips_cm, path.elbow)
    if np.isnan(q_rad).any():
        return None
    spline = CubicSpline(times_s, q_rad, bc_type="clamped")
    return JointSpline(arm, times_s, np.ascontiguousarray(spline.c[::-1].transpose(1, 0, 2)), np.zeros(0))


def held(spline: JointSpline, until_s: float) -> tuple[Floats, Floats]:
    """Return the borders and coefficients of a motion that rests at its end up to a time."""
    end_s = float(spline.borders_s[-1])
    rest = np.zeros((1, 4, spline.arm.links))
    rest[0, 0] = spline.evaluate(np.array([end_s]), "left").q_rad[0]
    if len(spline.borders_s) == 1:
        return np.array([0.0, max(until_s, DELAY_STEP_S)]), rest
    if until_s <= end_s:
        return spline.borders_s, spline.coefficients
    return np.append(spline.borders_s, until_s), np.concatenate([spline.coefficients, rest])


def judge(scene: Scene, moving_map: MovingMap, spline: JointSpline, *, limited: bool = True) -> Verdict:
    """Judge a motion and the rest at its end up to the horizon: reach of the joints, their limits, and obstacles.

    Args:
        scene: the joints.
        moving_map: the obstacles, the margin and the delay margin.
        spline: the motion, from time 0.
        limited: judge speeds and accelerations, too.
    """
    if limited and _over_limits(scene, spline):
        return Verdict("a joint would be too fast", 0.0, 0)
    clock = moving_map.clock
    borders, coefficients = held(spline, clock.samples * clock.sample_s)
    alone = joint_world(replace(scene, obstacles=()), moving_map.arm.margin_cm)
    verdict, time_s = prove_pieces(alone, borders, coefficients)
    if verdict != PROVED:
        return Verdict("a joint would leave its limits, or a link come too near to the floor", float(time_s), 0)
    verdict, time_s, obstacle = prove_moving(world_of(moving_map), borders, coefficients, clock.delay_s)
    if verdict != PROVED:
        return Verdict(f"obstacles[{obstacle + 1}] would touch a link", float(time_s), int(obstacle) + 1)
    return Verdict("", float(borders[-1]), 0)


def _over_limits(scene: Scene, spline: JointSpline) -> bool:
    """Tell whether a joint's speed or acceleration is beyond what a plan may use.

    Each is extreme at a piece's border, or the speed where the acceleration passes zero.
    """
    share = HEADROOM * scene.motion.acceleration_share
    c, size = spline.coefficients, np.diff(spline.borders_s)[:, None]
    turns = np.divide(-c[:, 2], 3.0 * c[:, 3], out=np.zeros_like(c[:, 2]), where=c[:, 3] != 0.0)
    for at in (np.zeros_like(size), size, np.clip(turns, 0.0, size)):
        speeds = np.abs(c[:, 1] + at * (2.0 * c[:, 2] + 3.0 * at * c[:, 3])).max(axis=0)
        accelerations = np.abs(2.0 * c[:, 2] + 6.0 * at * c[:, 3]).max(axis=0)
        for joint, speed, acceleration in zip(scene.joints, speeds, accelerations, strict=True):
            if speed > HEADROOM * joint.max_speed_rad_s or acceleration > share * joint.max_acceleration_rad_s2:
                return True
    return False


def delay_margin_s(moving_map: MovingMap, spline: JointSpline) -> float:
    """Return the largest delay, to DELAY_STEP_S, for which every pose stays free from its time to that much later.

    The rest at the end is held to the horizon; no larger margin than the horizon's length is told.
    """
    clock, world = moving_map.clock, world_of(moving_map)
    borders, coefficients = held(spline, clock.samples * clock.sample_s)

    def free(steps: int) -> bool:
        return bool(prove_moving(world, borders, coefficients, steps * DELAY_STEP_S)[0] == PROVED)

    low, high = -1, round(clock.samples * clock.sample_s / DELAY_STEP_S)
    if free(high):
        return high * DELAY_STEP_S
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if free(middle) else (low, middle)
    return low * DELAY_STEP_S


def tip_length_cm(spline: JointSpline, per_piece: int = 8) -> float:
    """Return the length of the tip's curve, by points on it: never longer than the curve."""
    if len(spline.borders_s) == 1:
        return 0.0
    shares = np.arange(per_piece) / per_piece
    inner = spline.borders_s[:-1, None] + np.diff(spline.borders_s)[:, None] * shares
    tips = spline.tip_cm(np.append(inner.ravel(), spline.borders_s[-1]))
    return float(np.hypot(*np.diff(tips, axis=0).T).sum())
