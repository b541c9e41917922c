"""Compile or load every planning kernel before anything is timed, by planning a scene that takes a few milliseconds."""

from __future__ import annotations

from planarm.pipeline import plan_scene
from planarm.scene import parse_scene

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


def warm_up() -> None:
    """Plan the small scene; the first time on a machine this compiles, later it loads from the cache."""
    for planner in PLANNERS:
        plan_scene(parse_scene(SMALL_SCENE + planner, "warm-up"), lambda _stage, _share: None)
