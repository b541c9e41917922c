"""The free Cartesian space of a two-link arm on a grid: where the end effector may be, and what forbids the rest.

Papers B and C plan on this map. A node is the centre of its cell and lies on a multiple of the cell size. A free node
says that one pose is free, nothing about its cell; a cell that is free as a whole says that of every pose with the
tip in it (`planarm.workspace.proof` has the bound).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planarm.model.collision import segment_clearance
from planarm.model.kinematics import ROUNDING_CM, ElbowSide
from planarm.model.shapes import ObstacleSet, obstacle_set, shape_of
from planarm.scene import Scene
from planarm.workspace.fill_map import fill
from planarm.workspace.world import BEYOND_REACH, FREE, INNER_HOLE, LIMIT, OBSTACLE, ArmWorld, build_world
from planarm_wire.kernel_cache import kernel

WHOLE, MIXED, BLOCKED_CELL = 0, 1, 2
"""A cell is free as a whole, or its node is free and its rest not known to be, or its node is not free."""


@dataclass(frozen=True, slots=True, eq=False)
class RegionMap:
    """Regions of tip positions; node arrays have the shape [iy, ix], ix along `x_cm`, iy along `y_cm`."""

    x_cm: NDArray[np.float64]
    """Node coordinates, shape (columns,): multiples of `cell_cm`."""
    y_cm: NDArray[np.float64]
    region: NDArray[np.uint8]
    """FREE, BEYOND_REACH, INNER_HOLE, OBSTACLE or LIMIT (joint limit or floor)."""
    cell_cm: float


@dataclass(frozen=True, slots=True, eq=False)
class FreeMap(RegionMap):
    """The map on one elbow side."""

    whole: NDArray[np.bool_]
    """True where every pose with the tip in the cell is free."""
    margin_cm: float
    elbow: ElbowSide
    world: ArmWorld
    """What the kernels of `planarm.workspace.proof` take."""

    @property
    def free_nodes(self) -> int:
        """The number of free nodes."""
        return int(np.count_nonzero(self.region == FREE))

    @property
    def cells(self) -> NDArray[np.uint8]:
        """WHOLE, MIXED or BLOCKED_CELL for each cell, shape [iy, ix]."""
        return np.where(self.whole, WHOLE, np.where(self.region == FREE, MIXED, BLOCKED_CELL)).astype(np.uint8)


def build_free_map(
    scene: Scene, margin_cm: float | None = None, elbow: ElbowSide | None = None, *, whole_cells: bool = True
) -> FreeMap:
    """Return the free Cartesian space of a scene.

    Args:
        scene: a scene with a two-link arm.
        margin_cm: a node is blocked where a link's centre line comes this near to an obstacle; None takes the
            scene's: half the link's width plus the clearance.
        elbow: the elbow side; None takes the scene's, which must then not be "either".
        whole_cells: False asks for the nodes alone, in half the time; then no cell is known to be free as a whole.

    Raises:
        SceneError: the limits of theta2 leave no pose on this elbow side; or the side is open.
    """
    world = build_world(scene, margin_cm, elbow)
    cell_cm = scene.workspace.cell_cm
    x_cm, y_cm = _nodes_cm(scene)
    shape = (len(y_cm), len(x_cm))
    region = np.empty(shape, np.uint8)
    whole = np.empty(shape, np.bool_) if whole_cells else np.zeros(shape, np.bool_)
    fill(world, x_cm, y_cm, cell_cm, region, whole if whole_cells else whole[:0])
    for array in (x_cm, y_cm, region, whole):
        array.flags.writeable = False
    return FreeMap(
        x_cm=x_cm,
        y_cm=y_cm,
        region=region,
        whole=whole,
        cell_cm=cell_cm,
        margin_cm=world.arm.margin_cm,
        elbow="up" if world.arm.side > 0.0 else "down",
        world=world,
    )


def tip_map(scene: Scene, margin_cm: float) -> RegionMap:
    """Return where the tip itself may be, for an arm with any number of links: to look at, not to search.

    Such an arm has many poses at a point, so a node is OBSTACLE or LIMIT only where the tip is too near to an obstacle
    or the floor; whether a whole free pose leads there is not asked.
    """
    x_cm, y_cm = _nodes_cm(scene)
    lengths, base = scene.arm.link_lengths_cm, scene.arm.base_cm
    inner_cm = max(0.0, 2.0 * max(lengths) - sum(lengths))
    r_cm = np.hypot(x_cm - base[0], (y_cm - base[1])[:, None])
    clearance_cm = np.full(r_cm.shape, np.inf)
    if scene.obstacles:
        points_clearance(x_cm, y_cm, obstacle_set([shape_of(obstacle) for obstacle in scene.obstacles]), clearance_cm)
    region = np.full(r_cm.shape, FREE, np.uint8)
    region[clearance_cm <= margin_cm] = OBSTACLE
    if scene.arm.floor:
        region[y_cm <= margin_cm] = LIMIT
    region[r_cm < inner_cm - ROUNDING_CM] = INNER_HOLE
    region[r_cm > sum(lengths) + ROUNDING_CM] = BEYOND_REACH
    for array in (x_cm, y_cm, region):
        array.flags.writeable = False
    return RegionMap(x_cm, y_cm, region, scene.workspace.cell_cm)


def _nodes_cm(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the coordinates of the grid's nodes along x and y."""
    workspace = scene.workspace
    return (
        np.arange(workspace.columns.start, workspace.columns.stop, dtype=np.float64) * workspace.cell_cm,
        np.arange(workspace.rows.start, workspace.rows.stop, dtype=np.float64) * workspace.cell_cm,
    )


@kernel
def points_clearance(
    x_cm: NDArray[np.float64], y_cm: NDArray[np.float64], obstacles: ObstacleSet, out_cm: NDArray[np.float64]
) -> None:
    """Fill the distance of each node to the nearest obstacle, shape [iy, ix]."""
    for iy in range(y_cm.shape[0]):
        for ix in range(x_cm.shape[0]):
            out_cm[iy, ix], _ = segment_clearance(x_cm[ix], y_cm[iy], x_cm[ix], y_cm[iy], obstacles, np.inf)
