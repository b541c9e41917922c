"""Scenes of arms with one to four links on any wiring, a polygon in their way."""

from dataclasses import replace

from planarm.scene import parse_scene

ARM = """
[arm]
link_lengths_cm = {lengths}
link_width_cm = 1.5
elbow = "either"
[board]
wiring = "{wiring}"
[workspace]
x_cm = [-60, 60]
y_cm = [-30, 60]
[[obstacles]]
shape = "polygon"
vertices_cm = [[26, 22], [34, 24], [30, 34]]
[task]
start_deg = {start}
goal_deg = {goal}
[planner]
algorithm = "mpd_star_lite"
[roadmap]
nodes = 500
cost = "travel"
[mechanics]
gravity = false
"""
JOINT = """
[[joints]]
gear_ratio = 5
microsteps = 8
max_speed_deg_s = 60
max_acceleration_deg_s2 = 600
[joints.motor]
current_a = 1.7
"""
LENGTHS, START, GOAL = (22.0, 16.0, 11.0, 7.0), (0.0, 40.0, -30.0, 20.0), (75.0, 10.0, 25.0, -30.0)


def scene_of(joints, wiring="own", **joint):
    head = ARM.format(
        lengths=list(LENGTHS[:joints]), wiring=wiring, start=list(START[:joints]), goal=list(GOAL[:joints])
    )
    scene = parse_scene(head + JOINT * joints, f"{joints}-{wiring}.toml")
    return replace(scene, joints=tuple(replace(one, **joint) for one in scene.joints))
