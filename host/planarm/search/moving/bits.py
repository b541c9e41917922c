"""Sets of nodes as planes of bits: which moves exist, and a motion sample's spreading, all nodes of a word at once."""

import numpy as np
from numpy.typing import NDArray

from planarm.workspace.cell_poses import DX, DY, CellPoses
from planarm.workspace.moving_map import packed
from planarm_wire.kernel_cache import kernel

Bits = NDArray[np.uint64]


def move_planes(poses: CellPoses) -> Bits:
    """Return for each of the eight moves the nodes that have it, shape (8, rows, words)."""
    planes = []
    for d in range(8):
        nodes = np.zeros(poses.rows * poses.columns, np.bool_)
        nodes[poses.cell] = (poses.moves >> np.uint8(d)) & 1
        planes.append(packed(nodes.reshape(poses.rows, poses.columns)))
    return np.stack(planes)


@kernel
def has(plane: Bits, iy: int, ix: int) -> bool:
    """Tell whether a node is in a set."""
    return bool((plane[iy, ix >> 6] >> np.uint64(ix & 63)) & np.uint64(1))


@kernel
def put(plane: Bits, iy: int, ix: int) -> None:
    """Add a node to a set."""
    plane[iy, ix >> 6] |= np.uint64(1) << np.uint64(ix & 63)


@kernel
def spread(source: Bits, moves: Bits, out: Bits) -> None:
    """Add to `out` all nodes that a move leads to from a node of `source`."""
    rows, words = source.shape
    for d in range(8):
        dx, dy = DX[d], DY[d]
        for iy in range(max(0, -dy), min(rows, rows - dy)):
            carry = np.uint64(0)
            if dx == 0:
                for w in range(words):
                    out[iy + dy, w] |= source[iy, w] & moves[d, iy, w]
            elif dx > 0:
                for w in range(words):
                    here = source[iy, w] & moves[d, iy, w]
                    out[iy + dy, w] |= (here << np.uint64(1)) | carry
                    carry = here >> np.uint64(63)
            else:
                for w in range(words - 1, -1, -1):
                    here = source[iy, w] & moves[d, iy, w]
                    out[iy + dy, w] |= (here >> np.uint64(1)) | carry
                    carry = here << np.uint64(63)
