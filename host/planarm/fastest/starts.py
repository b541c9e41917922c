"""Where the optimiser starts: short ways through joint space, on different sides of the obstacles.

Dijkstra's algorithm on a grid of joint angles, where a step costs the time that its slowest joint takes. After each way
found the surroundings of it cost more, so that the next one goes elsewhere if it can.
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from planarm.smoothing.smooth_path import Floats
from planarm.workspace.joint_proof import JointWorld, pose_spare_cm
from planarm_wire.kernel_cache import kernel

STEP_RAD = np.radians(3.0)
MOST_NODES = 60_000
DEARER = 3.0
"""What a step near a way already found costs, in multiples."""
NEAR_RAD = 0.25


def short_ways(world: JointWorld, start_rad: Floats, goal_rad: Floats, speeds_rad_s: Floats) -> Iterator[Floats]:
    """Yield ways from start to goal as poses, shape (m, 2), the shortest in time first; none when there is no way.

    Only for arms with two joints: the grid grows with the power of their number.
    """
    grid = _axes(world)
    shape = tuple(len(axis) for axis in grid)
    poses = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2)
    free = np.empty(len(poses), np.bool_)
    _free(world, poses, free)
    ends = [int(np.argmin(np.where(free, np.abs(poses - pose).max(axis=1), np.inf))) for pose in (start_rad, goal_rad)]
    tails, heads, seconds = _edges(shape, grid, free, speeds_rad_s)
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
        gap = np.abs(poses[:, None, :] - way[None, :: max(1, len(way) // 24), :]).max(axis=2).min(axis=1)
        dear[gap < NEAR_RAD] *= DEARER


def _axes(world: JointWorld) -> list[Floats]:
    spans = world.high_rad - world.low_rad
    step = max(float(STEP_RAD), float(np.sqrt(np.prod(spans) / MOST_NODES)))
    return [
        np.linspace(low, high, max(2, int(np.ceil((high - low) / step)) + 1))
        for low, high in zip(world.low_rad, world.high_rad, strict=True)
    ]


@kernel
def _free(world: JointWorld, poses: Floats, out: np.ndarray) -> None:
    for i in range(poses.shape[0]):
        out[i] = pose_spare_cm(world, poses[i]) > 0.0


def _edges(
    shape: tuple[int, ...], grid: list[Floats], free: np.ndarray, speeds_rad_s: Floats
) -> tuple[np.ndarray, np.ndarray, Floats]:
    """Return (tails, heads, seconds) of all steps to the eight neighbours between free nodes."""
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
