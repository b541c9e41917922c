"""From a scene to the optimiser's task: its arm, its room, and the poses at start and goal."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planarm.fastest.search import Budget, Clock, Task, Told, find_fastest
from planarm.model.arm import Arm
from planarm.model.kinematics import inverse_2r
from planarm.scene import Scene
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.smooth_path import Floats, SmoothPath
from planarm.trajectory.limits import Limits
from planarm.workspace.joint_proof import JointWorld, joint_world
from planarm.workspace.world import elbow_sides

POSES_OF_A_PATH = 60


def scene_task(scene: Scene, margin_cm: float, limits: Limits) -> Task:
    """Return what a scene asks of the optimiser.

    Where a task gives points, of two links, joint 2 keeps its sign with one elbow side; with "either", both sides are
    tried at start and goal, and the arm may pass through full stretch. The tip stays in the workspace's rectangle.

    Args:
        scene: the scene.
        margin_cm: least distance of a link's centre line to an obstacle.
        limits: what the joints can.
    """
    arm, task, world = Arm.from_spec(scene.arm), scene.task, joint_world(scene, margin_cm)
    if task.start_rad is None or task.goal_rad is None:
        world = _one_sided(world, elbow_sides(scene.arm))
    starts, goals = (
        [inverse_2r(arm, point, side) for side in elbow_sides(scene.arm)] if angles is None else [np.array(angles)]
        for point, angles in ((task.start_cm, task.start_rad), (task.goal_cm, task.goal_rad))
    )
    box_cm = np.array([*scene.workspace.x_cm, *scene.workspace.y_cm])
    ends = [(start, goal) for start in starts for goal in goals]
    return Task(arm, world, limits, ends, box_cm)


def _one_sided(world: JointWorld, sides: Sequence[str]) -> JointWorld:
    if len(sides) > 1:
        return world
    low, high = world.low_rad.copy(), world.high_rad.copy()
    if sides[0] == "up":
        high[1] = min(high[1], 0.0)
    else:
        low[1] = max(low[1], 0.0)
    return world._replace(low_rad=low, high_rad=high)


def fastest_path(
    scene: Scene, margin_cm: float, known: SmoothPath, limits: Limits, road_s: float, clock: Clock, told: Told
) -> JointSpline | None:
    """Return the fastest path found within the scene's budget; None when none was proved free.

    Args:
        scene: the scene.
        margin_cm: least distance of a link's centre line to an obstacle.
        known: a path from start to goal, as one of the starts.
        limits: what the joints can; speeds and accelerations are optimised for, torque is left to the timing.
        road_s: path time within which every stop has to end.
        clock: for the budget.
        told: told the share of the budget used and the best duration.
    """
    task = replace(scene_task(scene, margin_cm, limits), road_s=road_s)
    s = np.linspace(known.borders_s[0], known.borders_s[-1], POSES_OF_A_PATH)
    way: Floats = known.evaluate(s).q_rad
    return find_fastest(task, [way], Budget(scene.planner.budget_s), scene.planner.seed, clock, told)
