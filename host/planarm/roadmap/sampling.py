"""Free configurations spread over joint space: at random as in paper A, or with low discrepancy; both by a seed."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from planarm.errors import NoPathError
from planarm.scene import Sampling
from planarm.workspace.joint_proof import JointWorld, pose_spare_cm
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]

BATCH = 4096
MOST_MORTON_BITS = 10
SMALLEST_RAD = 1e-9
MOST_BATCHES = 1000


def free_poses(world: JointWorld, count: int, sampling: Sampling, seed: int) -> Floats:
    """Return free configurations within the joints' limits, shape (count, n), the same for the same arguments.

    Args:
        world: the arm among its obstacles.
        count: how many.
        sampling: "random" draws each joint's angle evenly; "halton" takes Halton's sequence, shifted by the seed.
        seed: of the draws, or of the shift.

    Raises:
        NoPathError: hardly any pose is free: some millions were drawn.
    """
    joints, rng = len(world.lengths_cm), np.random.default_rng(seed)
    sequence = qmc.Halton(joints, scramble=False)
    shift = rng.random(joints)
    kept: list[Floats] = []
    found = 0
    for _ in range(MOST_BATCHES):
        drawn = rng.random((BATCH, joints)) if sampling == "random" else (sequence.random(BATCH) + shift) % 1.0
        poses = world.low_rad + drawn * (world.high_rad - world.low_rad)
        kept.append(poses[_are_free(world, poses)])
        found += len(kept[-1])
        if found >= count:
            return np.concatenate(kept)[:count]
    raise NoPathError(
        f"{found} of {MOST_BATCHES * BATCH} configurations drawn are free, roadmap.nodes asks for {count}; lower "
        "it, or workspace.clearance_cm"
    )


def in_memory_order(world: JointWorld, poses_rad: Floats) -> Floats:
    """Return the poses along Morton's curve: neighbours in joint space lie near each other in memory, too."""
    joints = poses_rad.shape[1]
    bits = min(MOST_MORTON_BITS, 62 // joints)
    shares = (poses_rad - world.low_rad) / np.maximum(world.high_rad - world.low_rad, SMALLEST_RAD)
    cells = np.clip(shares * (1 << bits), 0, (1 << bits) - 1).astype(np.int64)
    code = np.zeros(len(poses_rad), np.int64)
    for bit in range(bits):
        for joint in range(joints):
            code |= ((cells[:, joint] >> bit) & 1) << (bit * joints + joint)
    return np.ascontiguousarray(poses_rad[np.argsort(code, kind="stable")])


@kernel
def _are_free(world: JointWorld, poses_rad: Floats) -> NDArray[np.bool_]:
    """Tell which poses are free, shape (m,)."""
    out = np.empty(poses_rad.shape[0], np.bool_)
    for i in range(poses_rad.shape[0]):
        out[i] = pose_spare_cm(world, poses_rad[i]) > 0.0
    return out
