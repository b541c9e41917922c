"""A way on a roadmap made shorter: moves between its own configurations, and points between these, that cost less.

A roadmap's way goes from configuration to configuration as they were drawn, so it is jagged. Of all ways that visit
some of its configurations in their order, by moves that are proved free, the cheapest is found; then points between
them are added, and it is found once more. Each is among the candidates of the next, so the cost never rises.
"""

import numpy as np
from numpy.typing import NDArray

from planarm.dynamics.energy import EdgeModel, edge_costs
from planarm.roadmap.moves import move_is_free
from planarm.workspace.joint_proof import JointWorld
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

REACH = 24
"""A move may pass over so many configurations."""
ROUNDS = 4
PARTS = 3
"""Into so many parts a move is cut for the next round."""
MOST_POSES = 120
WORTH = 1e-3
"""A round that saves less than this share is the last."""


def shortened(
    world: JointWorld, model: EdgeModel, kind: int, poses_rad: Floats, cost: float, rounds: int = ROUNDS
) -> tuple[NDArray[np.float64], float]:
    """Return a way with the same ends that costs no more, and its cost.

    Args:
        world: the arm among all obstacles.
        model: the arm's masses and motors.
        kind: what a move costs, as `planarm.dynamics.energy.edge_costs`.
        poses_rad: the way, shape (m, joints); its moves are free.
        cost: what it costs.
        rounds: the first takes the way's own configurations only.
    """
    poses, least = poses_rad, cost
    for number in range(rounds):
        candidates = poses if number == 0 else with_points_between(poses)
        if number and len(candidates) > MOST_POSES:
            break
        kept, found = cheapest_through(world, model, kind, np.ascontiguousarray(candidates))
        if found >= least * (1.0 - WORTH) and len(kept) >= len(poses):
            break
        poses, least = candidates[kept], min(found, least)
    return poses, least


def with_points_between(poses_rad: Floats) -> NDArray[np.float64]:
    """Return a way with its moves cut into PARTS, shape (PARTS (m - 1) + 1, joints)."""
    shares = (np.arange(PARTS) / PARTS)[None, :, None]
    inner = poses_rad[:-1, None] + shares * np.diff(poses_rad, axis=0)[:, None]
    return np.concatenate([inner.reshape(-1, poses_rad.shape[1]), poses_rad[-1:]])


@kernel
def cheapest_through(
    world: JointWorld, model: EdgeModel, kind: int, poses_rad: Floats
) -> tuple[NDArray[np.int64], float]:
    """Return which configurations of a way the cheapest free way with its ends visits, in their order, and its cost."""
    count, joints = poses_rad.shape
    q, full, ends = np.empty(joints), np.empty(joints), np.empty((joints + 1, 2))
    least, before = np.full(count, np.inf), np.full(count, -1)
    least[0] = 0.0
    for j in range(1, count):
        for i in range(max(0, j - REACH), j):
            through = least[i] + edge_costs(model, kind, poses_rad[i], poses_rad[j])[0]
            if through < least[j] and (i == j - 1 or move_is_free(world, poses_rad[i], poses_rad[j], q, full, ends)):
                least[j], before[j] = through, i
    kept, at, size = np.empty(count, np.int64), count - 1, 0
    while at >= 0:
        kept[size] = at
        size += 1
        at = before[at]
    return kept[:size][::-1].copy(), least[count - 1]
