"""Scenes with moving obstacles and a plain account of them; shapely is the independent oracle."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from host_scenes import make_scene, oracle_distance_cm
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.moving import shape_at
from planarm.scene import MovingSpec, Obstacle, ObstacleMotion, load_scene

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SAMPLE_S = 0.5
QUARTER = ((0.0, 2.0 * np.pi), (-0.5 * np.pi, 0.5 * np.pi))


def random_motion(rng, samples, reach_cm=25.0):
    """A polyline of one to three legs, or none."""
    kind = rng.integers(0, 4)
    if kind == 0:
        return None
    count = int(rng.integers(1, 4))
    times = np.sort(rng.choice(np.arange(1, samples + 5), count, replace=False)) * SAMPLE_S
    offsets = np.cumsum(rng.uniform(-reach_cm, reach_cm, (count, 2)) / count, axis=0)
    repeat = bool(rng.integers(0, 2))
    if repeat:
        offsets[-1] = 0.0
    if repeat and count == 1:
        return None
    return ObstacleMotion((0.0, *map(float, times)), ((0.0, 0.0), *((float(x), float(y)) for x, y in offsets)), repeat)


def random_moving_scene(rng, *, count=3, samples=20, cell=2.0, delay_s=0.0, shapes=("circle", "square", "triangle")):
    """An arm of 15 + 15 cm among obstacles that move, start and goal on nodes that are free at the beginning."""
    obstacles = []
    for _ in range(count):
        direction, distance = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(10.0, 40.0)
        center = (float(distance * np.cos(direction)), float(distance * np.sin(direction)))
        shape, motion = str(rng.choice(shapes)), random_motion(rng, samples)
        obstacles.append(Obstacle(shape, center, float(rng.uniform(2.0, 9.0)), motion=motion))
    angles, radii = rng.uniform(0.0, 2.0 * np.pi, 2), rng.uniform(22.0, 28.0, 2)
    start, goal = (
        tuple(float(cell * round(r * f(a) / cell)) for f in (np.cos, np.sin))
        for a, r in zip(angles, radii, strict=True)
    )
    scene = make_scene(
        obstacles,
        links=(15.0, 15.0),
        limits=QUARTER,
        x=(-32.0, 32.0),
        y=(-32.0, 32.0),
        cell=cell,
        start=start,
        goal=goal,
    )
    moving = MovingSpec(SAMPLE_S, samples, delay_s)
    return replace_moving(scene, moving)


def replace_moving(scene, moving):
    return replace(scene, moving=moving)


def clearance_at(scene, q_rad, time_s):
    """Least distance of the links at a pose to the obstacles where they are at a time, by shapely."""
    joints = forward(Arm.from_spec(scene.arm), q_rad)
    links = [(joints[i], joints[i + 1]) for i in range(len(joints) - 1)]
    shapes = [shape_at(obstacle, time_s) for obstacle in scene.obstacles]
    return min((oracle_distance_cm(link, shape) for link in links for shape in shapes), default=np.inf)


def quiet(_stage, _share):
    return None


def environment(number, *, faster=1.0, smoothing="none"):
    """An example, its clock run faster: obstacles and samples alike."""
    scene = load_scene(EXAMPLES / f"moving_env{number}.toml")
    moving = replace(scene.moving, sample_s=scene.moving.sample_s / faster, smoothing=smoothing)
    obstacles = tuple(
        replace(o, motion=replace(o.motion, times_s=tuple(t / faster for t in o.motion.times_s)))
        for o in scene.obstacles
    )
    return replace(scene, moving=moving, obstacles=obstacles)
