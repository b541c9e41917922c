"""Compile or load every kernel before anything is timed, by planning a scene that takes a few milliseconds.

Run as a program it does one of its parts: `planarm.first_start` runs them side by side.
"""

from __future__ import annotations

import gc
import sys
from contextlib import closing
from dataclasses import replace

import numpy as np

from planarm.link.arm_record import ArmSetup
from planarm.link.transport import open_transport
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.moving import later
from planarm.model.shapes import Circle, Polygon
from planarm.motions.margin import planning_margin_cm
from planarm.notice import silent
from planarm.operations.replanning import first_plan, plan_from
from planarm.operations.splicing import first_border, plan_from_border
from planarm.operations.verdicts import judge
from planarm.pipeline import plan_scene
from planarm.routes.moving_route import find_moving_route, rest_touch
from planarm.routes.route import find_route
from planarm.scene import parse_scene
from planarm.smoothing.joint_spline import JointSpline
from planarm.stepping.certify import certify
from planarm.stepping.schedule import schedule
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion

SMALL_SCENE = """
name = "warm-up"
[arm]
link_lengths_cm = [3, 2]
link_width_cm = 0.1
elbow = "up"
joint_limits_deg = [[-90, 270], [-150, 150]]
[workspace]
x_cm = [-5, 5]
y_cm = [0, 5]
cell_cm = 0.5
[[obstacles]]
shape = "circle"
center_cm = [-3, 4.5]
diameter_cm = 0.5
[[obstacles]]
shape = "square"
center_cm = [3.5, 3.5]
diameter_cm = 0.5
[task]
start_cm = [4, 1]
goal_cm = [1, 3.5]
[[joints]]
steps_per_rev = 200
microsteps = 16
gear_ratio = 1
driver = "a4988"
max_speed_deg_s = 200
max_acceleration_deg_s2 = 2000
[[joints]]
steps_per_rev = 200
microsteps = 16
gear_ratio = 1
driver = "a4988"
max_speed_deg_s = 200
max_acceleration_deg_s2 = 2000
"""


PLANNERS = ("", '[planner]\nalgorithm = "a_star"\n')
"""The default, and one whose paths have corners that are no obstacle's."""

MOMENT_S = 0.001

POSES_RAD = ((0.0, -0.6), (0.5, -1.2), (1.0, -0.8))

ON_ROADMAP = '[planner]\nalgorithm = "mpd_star_lite"\n[roadmap]\nnodes = 200\n'


AMONG_MOVING = """
[moving]
sample_s = 0.5
samples = 24
smoothing = "pso"
via_points = 1
[[obstacles]]
shape = "circle"
center_cm = [4.5, 4.5]
diameter_cm = 0.5
[obstacles.motion]
path = "straight"
by_cm = [-2, 0.5]
motion_samples = 20
"""
"""A circle that crosses the way, after the small scene's obstacles, which rest."""


def warm_up(*, on_roadmap: bool = False, moving: bool = False, replanning: bool = False) -> None:
    """Plan the small scene; the first time on a machine this compiles, later it loads from the cache.

    The kernels of planners on a roadmap, those among moving obstacles, and those that answer a new obstacle are not
    wanted by other scenes, so they are asked for.
    """
    if moving:
        warm_up_moving()
    if replanning:
        warm_up_replanning()
    for planner in (*PLANNERS, *((ON_ROADMAP,) if on_roadmap else ())):
        plan_scene(parse_scene(SMALL_SCENE + planner, "warm-up"), silent)


def warm_up_search() -> None:
    """Do the part of `warm_up` up to the smooth path."""
    for planner in PLANNERS:
        scene = parse_scene(SMALL_SCENE + planner, "warm-up")
        find_route(scene, planning_margin_cm(scene))


def warm_up_motion() -> None:
    """Do the part of `warm_up` from a smooth path to the certificate."""
    scene = parse_scene(SMALL_SCENE, "warm-up")
    poses = np.array(POSES_RAD)
    none = np.zeros(poses[:-1].shape)
    straight = np.ascontiguousarray(np.stack([poses[:-1], np.diff(poses, axis=0), none, none], axis=1))
    path = JointSpline(Arm.from_spec(scene.arm), np.arange(float(len(poses))), straight, np.array([1.0]))
    motion = fastest_motion(path, Limits.of(scene))
    trajectory, train, segments = schedule(scene, lambda _limit: motion)
    certify(scene, trajectory, train, segments)


def warm_up_emulator() -> None:
    """Start the emulated board with an arm around it, for a moment."""
    scene = parse_scene(SMALL_SCENE, "warm-up")
    with closing(open_transport("sim://", scene.link.baud, ArmSetup(scene, (0, 0)))) as transport:
        if transport.arm:
            transport.arm.settle(MOMENT_S)


def warm_up_replanning() -> None:
    """Plan on a roadmap, let obstacles appear beside the way, and plan again from where an arm was stopped."""
    scene = parse_scene(SMALL_SCENE + ON_ROADMAP, "warm-up")
    task, plan = first_plan(scene, silent)
    (rest_rad,) = plan.trajectory.sample(np.array([0.2 * plan.trajectory.duration_s]))[0]
    for shape in (Circle((-4.0, 1.0), 0.1), Polygon(((-4.5, 1.0), (-4.0, 1.0), (-4.0, 1.5)))):
        judge(plan, shape, planning_margin_cm(scene), 0.0, 0.0)
        _, changes = task.roadmap.add_obstacle(shape)
        task.planner.change(changes)
    plan_from(scene, task, rest_rad, silent)
    border, margin_cm = first_border(plan, 0, 0.0), planning_margin_cm(scene)
    assert border is not None, "a motion has more than one segment"
    plan_from_border(scene, task, plan, border, 0.0, margin_cm)
    here, then = task.planner.solve().nodes[:2]
    graph = task.roadmap.graph
    (first,) = np.flatnonzero((graph.tail == here) & (graph.head == then))
    task.planner.change(changes._replace(edges=np.array([first]), costs=np.array([np.inf])))
    task.planner.solve()


def warm_up_moving() -> None:
    """Plan among moving obstacles, with all that is told about it, and once more from where an arm was stopped."""
    arm_and_rest, task = SMALL_SCENE.split("[task]")
    scene = parse_scene(f"{arm_and_rest}{AMONG_MOVING}[task]{task}", "warm-up")
    plan = plan_scene(scene, silent)
    stopped_s = 0.4 * plan.trajectory.duration_s
    (rest_rad,) = plan.trajectory.sample(np.array([stopped_s]))[0]
    x, y = forward(Arm.from_spec(scene.arm), rest_rad)[-1]
    start = replace(scene.task, start_cm=(float(x), float(y)), start_rad=tuple(map(float, rest_rad)))
    resting = later(replace(scene, task=start), stopped_s)
    rest_touch(resting, MOMENT_S)
    find_moving_route(resting, planning_margin_cm(resting))


PARTS = {"search": warm_up_search, "motion": warm_up_motion, "emulator": warm_up_emulator}

if __name__ == "__main__":
    # What the compiler makes lives to the end; to look through it for what is unused took a tenth of the time.
    gc.set_threshold(100_000, 10, 10)
    PARTS[sys.argv[1]]()
