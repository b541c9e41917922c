"""Certificate: the arm among moving obstacles, every pose of the expanded segments at its time and a delay later.

The geometry is the certificate's own (`planarm.stepping.clearance`), and so is the obstacles' clockwork here. A pose in
the middle of a change stands for the time from the change before to the change after. Within it time advances by no
more than the obstacle needs to come from where it is to the margin, so that nothing is passed over, however short.
"""

from math import inf

import numpy as np

from planarm.model.moving import moving_set
from planarm.model.shapes import ObstacleSet
from planarm.scene import MovingSpec, Scene
from planarm.stepping.certificate import Check, at_least
from planarm.stepping.clearance import point_distance, polygon_distance
from planarm.stepping.poses import Poses
from planarm.stepping.train import Floats
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import TICKS_HZ

LONGEST_STEP_S = 2e-3
"""Time advances by no more than this, so that the least clearance told is near the true one."""

TOUCH_CM = 1e-9


def check_moving(scene: Scene, moving: MovingSpec, poses: Poses) -> Check:
    """Check the least distance of any link's centre line from any obstacle where it is at that time.

    Args:
        scene: arm and obstacles.
        moving: the delay margin and the horizon, to which the arm rests at the end.
        poses: every pose of the motion, in the order of time.
    """
    ticks = poses.ticks / TICKS_HZ
    since = np.concatenate([ticks[:1], ticks[:-1]])
    until = np.concatenate([ticks[1:], [max(float(ticks[-1]), moving.horizon_s)]]) + moving.delay_margin_s
    obstacles = moving_set(scene, float(until.max()))
    least, pose, at_s, obstacle = _least_clearance(
        poses.positions_cm,
        poses.reach_cm,
        since,
        until,
        obstacles.obstacles,
        obstacles.first_knot,
        obstacles.knot_s,
        obstacles.knot_cm,
        obstacles.speeds_cm_s,
        scene.margin_cm,
    )
    late = f", up to {moving.delay_margin_s:g} s late" if moving.delay_margin_s > 0.0 else ""
    where = f"{poses.place(pose)}, obstacles[{obstacle + 1}] at {at_s:.6f} s"
    setting = "workspace.clearance_cm or moving.delay_margin_s"
    return at_least(f"clearance of the links' centre lines{late}", least, scene.margin_cm, "cm", where, setting)


@kernel
def _least_clearance(
    positions: Floats,
    reach: Floats,
    since: Floats,
    until: Floats,
    shapes: ObstacleSet,
    first_knot: np.ndarray,
    knot_s: Floats,
    knot_cm: Floats,
    speeds: Floats,
    margin: float,
) -> tuple[float, int, float, int]:
    """Return (least clearance, pose, time, obstacle)."""
    best, at_pose, at_time, at_obstacle = inf, 0, 0.0, -1
    for i in range(positions.shape[0]):
        for k in range(speeds.shape[0]):
            t = since[i]
            while True:
                dx, dy = _offset(first_knot[k], first_knot[k + 1], knot_s, knot_cm, t)
                clear = _distance(positions[i], shapes, k, dx, dy) - reach[i]
                if clear < best:
                    best, at_pose, at_time, at_obstacle = clear, i, t, k
                if t >= until[i] or clear - speeds[k] * (until[i] - t) >= best or clear <= margin + TOUCH_CM:
                    break
                step = LONGEST_STEP_S if speeds[k] <= 0.0 else min(LONGEST_STEP_S, (clear - margin) / speeds[k])
                t = min(until[i], t + step)
    return best, at_pose, at_time, at_obstacle


@kernel
def _offset(begin: int, end: int, knot_s: Floats, knot_cm: Floats, t: float) -> tuple[float, float]:
    """Return an obstacle's displacement at a time: by bisection of its knots."""
    if t <= knot_s[begin]:
        return knot_cm[begin, 0], knot_cm[begin, 1]
    if t >= knot_s[end - 1]:
        return knot_cm[end - 1, 0], knot_cm[end - 1, 1]
    low, high = begin, end - 1
    while high - low > 1:
        middle = (low + high) // 2
        if knot_s[middle] <= t:
            low = middle
        else:
            high = middle
    share = (t - knot_s[low]) / (knot_s[high] - knot_s[low])
    return (
        (1.0 - share) * knot_cm[low, 0] + share * knot_cm[high, 0],
        (1.0 - share) * knot_cm[low, 1] + share * knot_cm[high, 1],
    )


@kernel
def _distance(joints: Floats, shapes: ObstacleSet, k: int, dx: float, dy: float) -> float:
    """Return the distance of an arm's links to an obstacle that is displaced: the arm is displaced back instead."""
    first, end = shapes.first_vertex[k], shapes.first_vertex[k + 1]
    least = inf
    for j in range(joints.shape[0] - 1):
        ax, ay, bx, by = joints[j, 0] - dx, joints[j, 1] - dy, joints[j + 1, 0] - dx, joints[j + 1, 1] - dy
        apart = point_distance(shapes.centers_cm[k, 0], shapes.centers_cm[k, 1], ax, ay, bx, by) - shapes.radii_cm[k]
        if end > first and apart < least:
            apart = polygon_distance(shapes.vertices_cm[first:end], ax, ay, bx, by)
        least = min(least, apart)
    return least
