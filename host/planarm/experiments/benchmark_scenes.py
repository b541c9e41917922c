"""The open benchmark's scenes: made from their numbers alone, the same on every machine, each with a hash.

All numbers are whole or halves, and the draws are those of Python's `random.Random`, whose sequence is kept from
version to version. A scene is drawn again until start and goal are free, a path joins them, and the straight line does
not, so no scene is trivial.
"""

import hashlib
import json
from collections.abc import Iterator
from itertools import count
from math import pi
from random import Random
from typing import Any, Final

from planarm.experiments.node_optimum import BOUND, line_is_legal
from planarm.model.shapes import Circle, shape_of
from planarm.scene import (
    ArmSpec,
    JointSpec,
    LinkSpec,
    MechanicsSpec,
    Obstacle,
    Point,
    Scene,
    TaskSpec,
    WorkspaceSpec,
)
from planarm.search.grid_search import find_path
from planarm.workspace.free_map import FreeMap, build_free_map
from planarm.workspace.world import FREE

NAME: Final = "planarm-open-1"
SCENES: Final = 1_000
LINKS_CM: Final = ((30.0, 20.0), (25.0, 25.0), (20.0, 30.0), (35.0, 15.0))
CELL_CM: Final = 2.0
"""Coarse, so that the optimum over all pairs of nodes takes a second; moves are proved all along at any cell size."""
LIMITS_RAD: Final = ((-pi, pi), (-pi, pi))


def benchmark_scene(number: int) -> tuple[Scene, FreeMap]:
    """Return scene 0 .. SCENES - 1 with its map."""
    for attempt in count():
        rng = Random(f"{NAME}:{number}:{attempt}")
        scene = _drawn(number, rng)
        free_map = build_free_map(scene)
        if _is_worth_it(scene, free_map):
            return scene, free_map
    raise AssertionError("count() does not end")


def problem(scene: Scene) -> dict[str, Any]:
    """Return what a planner is told of a scene, in centimetres and radians: docs/benchmark.md says what it means."""
    return {
        "name": scene.name,
        "link_lengths_cm": list(scene.arm.link_lengths_cm),
        "base_cm": list(scene.arm.base_cm),
        "elbow": scene.arm.elbow,
        "joint_limits_rad": [list(limits) for limits in scene.arm.joint_limits_rad],
        "margin_cm": scene.margin_cm,
        "x_cm": list(scene.workspace.x_cm),
        "y_cm": list(scene.workspace.y_cm),
        "cell_cm": scene.workspace.cell_cm,
        "obstacles": [_told(obstacle) for obstacle in scene.obstacles],
        "start_cm": list(scene.task.start_cm),
        "goal_cm": list(scene.task.goal_cm),
    }


def scene_hash(scene: Scene) -> str:
    """Return 16 hexadecimal digits of a hash of the scene as drawn."""
    told = problem(scene)
    told["obstacles"] = [[o.shape, o.center_cm, o.diameter_cm, o.vertices_cm] for o in scene.obstacles]
    told["joint_limits_rad"] = "full turns"
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:16]


def _drawn(number: int, rng: Random) -> Scene:
    links = rng.choice(LINKS_CM)
    obstacles = tuple(_obstacles(rng, rng.randrange(2, 9)))
    joint = JointSpec(200, 16, 5.0, "a4988", 2.0, 10.0)
    return Scene(
        name=f"{NAME} {number}",
        source=f"{NAME}:{number}",
        arm=ArmSpec(links, 0.8, (0.0, 0.0), rng.choice(("up", "down")), LIMITS_RAD, floor=False),
        workspace=WorkspaceSpec((-50.0, 50.0), (-50.0, 50.0), CELL_CM, 0.0),
        obstacles=obstacles,
        task=TaskSpec(_node(rng), _node(rng)),
        planner=BOUND,
        joints=(joint, joint),
        link=LinkSpec("sim://", 250_000),
        mechanics=MechanicsSpec.usual(links),
        coupling=((1.0, 0.0), (0.0, 1.0)),
    )


def _obstacles(rng: Random, wanted: int) -> Iterator[Obstacle]:
    for _ in range(wanted):
        x, y = float(rng.randrange(-48, 49)), float(rng.randrange(-48, 49))
        size = 0.5 * rng.randrange(4, 25)
        shape = rng.choice(("circle", "square", "diamond", "triangle", "hexagon", "polygon"))
        if shape == "polygon":  # a bar, upright or level
            w, h = rng.choice(((size, 1.0), (1.0, size)))
            yield Obstacle("polygon", vertices_cm=((x, y), (x + w, y), (x + w, y + h), (x, y + h)))
        else:
            yield Obstacle(shape, (x, y), size)  # type: ignore[arg-type] # one of the names above


def _node(rng: Random) -> Point:
    return CELL_CM * rng.randrange(-24, 25), CELL_CM * rng.randrange(-24, 25)


def _is_worth_it(scene: Scene, free_map: FreeMap) -> bool:
    """Tell whether both ends are free nodes, a path joins them, and the straight line does not."""
    start, goal = scene.task.start_cm, scene.task.goal_cm
    for x, y in (start, goal):
        if free_map.region[round((y - free_map.y_cm[0]) / CELL_CM), round((x - free_map.x_cm[0]) / CELL_CM)] != FREE:
            return False
    if line_is_legal(free_map.world, *start, *goal):
        return False
    return find_path(free_map, start, goal, BOUND).path is not None


def _told(obstacle: Obstacle) -> dict[str, Any]:
    shape = shape_of(obstacle)
    if isinstance(shape, Circle):
        return {"center_cm": list(shape.center_cm), "radius_cm": shape.radius_cm}
    return {"vertices_cm": [list(vertex) for vertex in shape.vertices_cm]}
