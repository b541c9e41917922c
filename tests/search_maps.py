"""Maps for tests of the search: drawn in text, random, or of the arm itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from host_scenes import make_scene
from planarm.scene import PlannerSpec, Scene, load_scene
from planarm.scene.load import NEIGHBOURS
from planarm.workspace.free_map import FreeMap
from planarm.workspace.world import FREE, OBSTACLE, build_world

ROOT = Path(__file__).resolve().parents[1]


def table1_scene(case, cell_cm=1.0) -> Scene:
    """Paper C, Table I, as reconstructed; another cell size than 1 cm on demand."""
    scene = load_scene(ROOT / "examples" / f"table1_case{case}.toml")
    return replace(scene, workspace=replace(scene.workspace, cell_cm=cell_cm))


def grid_map(free, cell_cm=1.0) -> FreeMap:
    """A map with the given free nodes [iy, ix] and its first node at (0, 0).

    The nodes stand for no arm: its `world` has no obstacles, so such a map is for moves = "nodes".
    """
    free = np.asarray(free, bool)
    rows, columns = free.shape
    return FreeMap(
        x_cm=np.arange(columns) * cell_cm,
        y_cm=np.arange(rows) * cell_cm,
        region=np.where(free, FREE, OBSTACLE).astype(np.uint8),
        whole=np.zeros((rows, columns), bool),
        cell_cm=cell_cm,
        margin_cm=0.4,
        elbow="up",
        world=build_world(make_scene()),
    )


def drawn_map(picture, cell_cm=1.0):
    """Return (map, start_cm, goal_cm) of a picture: '#' blocked, 'S' start, 'G' goal; the last line is y = 0.

    A lower-case 's' or 'g' is a start or goal on a blocked node.
    """
    lines = [line.strip() for line in picture.strip().splitlines()][::-1]
    cells = np.array([list(line) for line in lines])
    free = (cells != "#") & (cells != "s") & (cells != "g")

    def place(letter):
        (iy,), (ix,) = np.nonzero(np.char.upper(cells) == letter)
        return ix * cell_cm, iy * cell_cm

    return grid_map(free, cell_cm), place("S"), place("G")


def planner(algorithm, neighbours, *, moves="nodes", subset="run", seed=1) -> PlannerSpec:
    """A planner's settings, by default as the papers read: only nodes are checked."""
    return PlannerSpec(algorithm, neighbours, subset, seed, moves)


GRID = ("a_star", "modified_a_star", "chaos_a_star", "chs")
"""The algorithms of paper C; their paths are moves of a stencil."""

PLANNERS = [(algorithm, count) for algorithm in GRID for count in NEIGHBOURS[algorithm]]
"""Every algorithm of paper C with every neighbourhood."""

EXACT = [(algorithm, count) for algorithm, count in PLANNERS if algorithm != "chaos_a_star"]
"""Those that use the whole neighbourhood."""
