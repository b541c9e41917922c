"""Scenes and plain geometry that the host's tests share; shapely is the independent oracle."""

from math import pi, radians

import numpy as np
import shapely

from planarm.model.kinematics import forward
from planarm.model.shapes import Circle, Polygon, shape_of
from planarm.scene import (
    ArmSpec,
    JointSpec,
    LinkSpec,
    MechanicsSpec,
    Obstacle,
    PlannerSpec,
    Scene,
    TaskSpec,
    WorkspaceSpec,
)

FULL_TURN = ((radians(-90), radians(270)), (-pi, pi))


LEAST = """
[arm]
link_lengths_cm = [30, 20]
link_width_cm = 0.8
elbow = "up"
[workspace]
x_cm = [-50, 50]
y_cm = [0, 50]
[task]
start_cm = [49, 2]
goal_cm = [1, 45]
[[joints]]
max_speed_deg_s = 180
max_acceleration_deg_s2 = 360
{first}
[[joints]]
max_speed_deg_s = 90
max_acceleration_deg_s2 = 720
{second}
"""


def least_scene(first="", second=""):
    """The text of a scene with what must be in one, and more lines for each joint."""
    return LEAST.format(first=first, second=second)


def make_scene(
    obstacles=(),
    *,
    links=(30.0, 20.0),
    base=(0.0, 0.0),
    elbow="up",
    limits=FULL_TURN,
    floor=False,
    x=(-50.0, 50.0),
    y=(-50.0, 50.0),
    cell=1.0,
    width=0.8,
    clearance=0.0,
    start=(49.0, 2.0),
    goal=(1.0, 45.0),
):
    joint = JointSpec(200, 16, 5.0, "a4988", 2.0, 10.0)
    return Scene(
        name="test",
        source="test.toml",
        arm=ArmSpec(links, width, base, elbow, limits, floor),
        workspace=WorkspaceSpec(x, y, cell, clearance),
        obstacles=tuple(obstacles),
        task=TaskSpec(start, goal),
        planner=PlannerSpec("chs", 56, "run", 1, "proved"),
        joints=(joint, joint),
        link=LinkSpec("sim://", 250_000),
        mechanics=MechanicsSpec.usual(links),
        coupling=((1.0, 0.0), (0.0, 1.0)),
    )


def star_polygon(rng, center, least, greatest, count):
    """A simple polygon, as a rule not convex: random distances at rising angles, gaps below 180 degrees."""
    angles = (np.arange(count) + rng.uniform(0.0, 0.45, count)) * 2.0 * pi / count
    distances = rng.uniform(least, greatest, count)
    points = np.column_stack([center[0] + distances * np.cos(angles), center[1] + distances * np.sin(angles)])
    return tuple((float(px), float(py)) for px, py in points)


def random_obstacles(rng, count, size=8.0, keep_off=12.0, reach=45.0):
    """Circles, named shapes and star polygons between `keep_off` and `reach` from the origin."""
    out = []
    for _ in range(count):
        direction, distance = rng.uniform(0.0, 2.0 * pi), rng.uniform(keep_off, reach)
        center = (float(distance * np.cos(direction)), float(distance * np.sin(direction)))
        shape = rng.choice(["circle", "square", "diamond", "triangle", "hexagon", "polygon"])
        diameter = float(rng.uniform(1.0, size))
        if shape == "polygon":
            out.append(Obstacle("polygon", vertices_cm=star_polygon(rng, center, 0.2 * diameter, 0.5 * diameter, 9)))
        else:
            out.append(Obstacle(str(shape), center, diameter))
    return tuple(out)


def oracle_distance_cm(segment, shape):
    """Distance from a segment ((ax, ay), (bx, by)) to a shape, by shapely."""
    line = shapely.LineString(segment)
    if isinstance(shape, Circle):
        return max(0.0, line.distance(shapely.Point(shape.center_cm)) - shape.radius_cm)
    assert isinstance(shape, Polygon)
    return line.distance(shapely.Polygon(shape.vertices_cm))


def oracle_clearance_cm(scene, arm, q_rad):
    """Least distance of the arm's links to the scene's obstacles, by shapely."""
    joints = forward(arm, q_rad)
    links = [(joints[i], joints[i + 1]) for i in range(arm.links)]
    shapes = [shape_of(o) for o in scene.obstacles]
    return min((oracle_distance_cm(link, shape) for link in links for shape in shapes), default=np.inf)
