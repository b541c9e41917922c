"""Where the optimiser starts: short ways through joint space, on different sides of the obstacles.

Dijkstra's algorithm on a grid of joint angles, where a step costs the time that its slowest joint takes. After each way
found the surroundings of it cost more, so that the next one goes elsewhere if it can.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from planarm.smoothing.smooth_path import Floats
from planarm.workspace.joint_proof import JointWorld, pose_spare_cm
from planarm_wire.kernel_cache import kernel

STEPS_RAD = (0.05, 0.025, 0.0125)
"""About 3, 1.5 and 0.75 degrees: 9,000 to 150,000 nodes of an arm that turns once round and folds to both sides."""

DEARER = 3.0
"""What a step near a way already found costs, in multiples."""
NEAR_RAD = 0.25


def short_ways(world: JointWorld, start_rad: Floats, goal_rad: Floats, speeds_rad_s: Floats) -> Iterator[Floats]:
    """Yield ways from start to goal as poses, shape (m, 2), the shortest in time first; none when there is no way.

    The grid is made finer while it shows no way. Only for arms with two joints: it grows with the power of their
    number.
    """
    for step_rad in STEPS_RAD:
        ways = _ways_on(_axes(world, step_rad), world, start_rad, goal_rad, speeds_rad_s)
        first = next(ways, None)
        if first is not None:
            yield first
            yield from ways
            return


def _ways_on(
    grid: list[Floats], world: JointWorld, start_rad: Floats, goal_rad: Floats, speeds_rad_s: Floats
) -> Iterator[Floats]:
    """Yield ways on one grid, again and again around the surroundings of the ways before."""
    poses = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2)
    free = np.empty(len(poses), np.bool_)
    _free(world, poses, free)
    if not free.any():
        return
    ends = [int(np.argmin(np.where(free, np.abs(poses - pose).max(axis=1), np.inf))) for pose in (start_rad, goal_rad)]
    tails, heads, seconds = _edges(grid, free, speeds_rad_s)
    dear = np.ones(len(poses))
    while True:
        graph = csr_array((seconds * 0.5 * (dear[tails] + dear[heads]), (tails, heads)), shape=(len(poses),) * 2)
        far, before = dijkstra(graph, indices=ends[0], return_predecessors=True)
        if not np.isfinite(far[ends[1]]):
            return
        nodes = [ends[1]]
        while nodes[-1] != ends[0]:
            nodes.append(int(before[nodes[-1]]))
        way = poses[nodes[::-1]]
        yield np.concatenate([start_rad[None], way[1:-1], goal_rad[None]])
        near = cKDTree(way).query(poses, distance_upper_bound=NEAR_RAD, p=np.inf)[0] < NEAR_RAD
        dear[near] *= DEARER


def _axes(world: JointWorld, step_rad: float) -> list[Floats]:
    return [
        np.linspace(low, high, max(2, int(np.ceil((high - low) / step_rad)) + 1))
        for low, high in zip(world.low_rad, world.high_rad, strict=True)
    ]


@kernel
def _free(world: JointWorld, poses: Floats, out: NDArray[np.bool_]) -> None:
    for i in range(poses.shape[0]):
        out[i] = pose_spare_cm(world, poses[i]) > 0.0


def _edges(
    grid: list[Floats], free: NDArray[np.bool_], speeds_rad_s: Floats
) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """Return (tails, heads, seconds) of all steps to the eight neighbours between free nodes."""
    shape = len(grid[0]), len(grid[1])
    index = np.arange(shape[0] * shape[1]).reshape(shape)
    steps = np.array([axis[1] - axis[0] for axis in grid]) / speeds_rad_s
    tails, heads, seconds = [], [], []
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = index[: shape[0] - di, max(0, -dj) : shape[1] - max(0, dj)].ravel()
        b = index[di:, max(0, dj) : shape[1] - max(0, -dj)].ravel()
        both = free[a] & free[b]
        a, b = a[both], b[both]
        # The slower joint decides; the other's way counts a little, so that ties are straight.
        cost = max(di * steps[0], abs(dj) * steps[1]) + 0.05 * (di * steps[0] + abs(dj) * steps[1])
        tails += [a, b]
        heads += [b, a]
        seconds.append(np.full(2 * len(a), cost))
    return np.concatenate(tails), np.concatenate(heads), np.concatenate(seconds)
