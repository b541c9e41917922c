"""The free Cartesian space of a two-link arm on a grid: where the end effector may be, and what forbids the rest.

Papers B and C plan on this map. A node is the centre of its cell and lies on a multiple of the cell size. A free node
says that one pose is free, nothing about its cell; a cell that is free as a whole says that of every pose with the
tip in it (`planarm.workspace.proof` has the bound).
"""

from dataclasses import dataclass
from math import acos, hypot, nan, sqrt

import numpy as np
from numpy.typing import NDArray

from planarm.model.kinematics import ElbowSide
from planarm.scene import Scene
from planarm.workspace.proof import disc_is_free, disc_within_reach
from planarm.workspace.world import (
    FREE,
    LIMIT,
    OBSTACLE,
    ArmWorld,
    build_world,
    cos_beta_at,
    elbow_at,
    floor_clearance,
    obstacle_clearance,
    region_at,
    theta1_at,
    theta2_at,
)
from planarm_wire.kernel_cache import kernel

WHOLE, MIXED, BLOCKED_CELL = 0, 1, 2
"""A cell is free as a whole, or its node is free and its rest not known to be, or its node is not free."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeMap:
    """The map; node arrays have the shape [iy, ix], ix along `x_cm`, iy along `y_cm`."""

    x_cm: NDArray[np.float64]
    """Node coordinates, shape (columns,): multiples of `cell_cm`."""
    y_cm: NDArray[np.float64]
    region: NDArray[np.uint8]
    """FREE, BEYOND_REACH, INNER_HOLE, OBSTACLE or LIMIT (joint limit or floor)."""
    whole: NDArray[np.bool_]
    """True where every pose with the tip in the cell is free."""
    theta_rad: NDArray[np.float64]
    """Joint angles, shape [iy, ix, 2]; NaN out of reach and in the inner hole."""
    clearance_cm: NDArray[np.float64]
    """Least distance of the links' centre lines to obstacles and floor; NaN where theta_rad is."""
    cell_cm: float
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


def build_free_map(scene: Scene, margin_cm: float | None = None, elbow: ElbowSide | None = None) -> FreeMap:
    """Return the free Cartesian space of a scene.

    Args:
        scene: a scene with a two-link arm.
        margin_cm: a node is blocked where a link's centre line comes this near to an obstacle; None takes the
            scene's: half the link's width plus the clearance.
        elbow: the elbow side; None takes the scene's, which must then not be "either".

    Raises:
        SceneError: the limits of theta2 leave no pose on this elbow side; or the side is open.
    """
    world = build_world(scene, margin_cm, elbow)
    cell_cm = scene.workspace.cell_cm
    x_cm = np.array(scene.workspace.columns, np.float64) * cell_cm
    y_cm = np.array(scene.workspace.rows, np.float64) * cell_cm
    shape = (len(y_cm), len(x_cm))
    region = np.empty(shape, np.uint8)
    whole = np.empty(shape, np.bool_)
    theta_rad = np.empty((*shape, 2))
    clearance_cm = np.empty(shape)
    _fill(world, x_cm, y_cm, 0.5 * sqrt(2.0) * cell_cm, region, whole, theta_rad, clearance_cm)
    for array in (x_cm, y_cm, region, whole, theta_rad, clearance_cm):
        array.flags.writeable = False
    return FreeMap(
        x_cm=x_cm,
        y_cm=y_cm,
        region=region,
        whole=whole,
        theta_rad=theta_rad,
        clearance_cm=clearance_cm,
        cell_cm=cell_cm,
        margin_cm=world.arm.margin_cm,
        elbow="up" if world.arm.side > 0.0 else "down",
        world=world,
    )


@kernel
def _fill(
    world: ArmWorld,
    x_cm: NDArray[np.float64],
    y_cm: NDArray[np.float64],
    rho_cm: float,
    region: NDArray[np.uint8],
    whole: NDArray[np.bool_],
    theta_rad: NDArray[np.float64],
    clearance_cm: NDArray[np.float64],
) -> None:
    """Fill the node arrays; `rho_cm` is the radius of a cell's circumscribed circle."""
    arm = world.arm
    for iy in range(y_cm.shape[0]):
        for ix in range(x_cm.shape[0]):
            x, y = x_cm[ix], y_cm[iy]
            r = hypot(x - arm.base_x_cm, y - arm.base_y_cm)
            node = region_at(arm, r)
            theta1, theta2, clearance = nan, nan, nan
            if node == FREE:
                theta1, theta2 = theta1_at(arm, x, y, acos(cos_beta_at(arm, r))), theta2_at(arm, r)
                node, clearance = _pose_region(world, x, y, r, theta1)
            region[iy, ix] = node
            theta_rad[iy, ix, 0], theta_rad[iy, ix, 1] = theta1, theta2
            clearance_cm[iy, ix] = clearance
            spare = clearance - arm.margin_cm
            whole[iy, ix] = (
                node == FREE and disc_within_reach(arm, r, rho_cm) and disc_is_free(arm, r, rho_cm, theta1, spare)
            )


@kernel
def _pose_region(world: ArmWorld, x: float, y: float, r: float, theta1: float) -> tuple[int, float]:
    """Return (region, clearance) of a tip position within reach."""
    arm = world.arm
    ex, ey = elbow_at(arm, x, y, r)
    to_obstacle, _ = obstacle_clearance(world, ex, ey, x, y)
    to_floor = floor_clearance(arm, ey, y)
    region = FREE
    if to_obstacle <= arm.margin_cm:
        region = OBSTACLE
    if to_floor <= arm.margin_cm or theta1 < arm.theta1_min_rad or theta1 > arm.theta1_max_rad:
        region = LIMIT
    return region, min(to_obstacle, to_floor)
