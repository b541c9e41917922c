"""The poses that a two-link arm takes with its tip on a grid's nodes, and the moves between neighbouring ones.

In a motion sample the arm moves from a node's pose to a neighbour's, both joints together on a straight line in joint
space, from rest to rest: q(u) = q_a + (q_b - q_a) (3 u^2 - 2 u^3). That takes 1.5 |dq| / T of speed and 6 |dq| / T^2 of
acceleration; a move that the joints cannot make in the sample's time does not exist, nor one across the end of joint
1's turn.

In the first half of the time joint 1 turns by at most half of dq1, and the elbow moves by at most l1 times that. On the
straight line in joint space the tip's second derivative by the share of the way is at most
c = l1 dq1^2 + l2 (dq1 + dq2)^2, so the tip is within c / 8 of the straight line between the nodes and moves at most
half of its length and c / 8. No point of the arm moves farther than elbow or tip (`planarm.workspace.proof`). So a
pose's sway, the largest of these over its moves, bounds the first half of every move from it and the second half of
every move to it.
"""

from dataclasses import replace
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.model.kinematics import ElbowSide
from planarm.scene import Scene
from planarm.workspace.free_map import build_free_map
from planarm.workspace.world import FREE, TwoLinkArm, cos_beta_at, elbow_from_base, theta1_at, theta2_at
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Cells = NDArray[np.int32]

DX = np.array([1, 0, -1, 0, 1, -1, -1, 1])
DY = np.array([0, 1, 0, -1, 1, 1, -1, -1])
"""The eight moves; the opposite of the straight move d is d ^ 2, of a diagonal one too."""

HEADROOM = 0.999
"""Share of the joints' limits that moves use."""


class CellPoses(NamedTuple):
    """The poses within reach and limits, obstacles left aside; m of them."""

    columns: int
    rows: int
    cell: Cells
    """Their cells, iy * columns + ix, ascending, shape (m,)."""
    place: Cells
    """The place of each cell in these arrays, -1 where there is no pose, shape (rows * columns,)."""
    tip_cm: Floats
    """The tip from the base, shape (m, 2)."""
    elbow_cm: Floats
    """The elbow from the base, shape (m, 2)."""
    q_rad: Floats
    """Shape (m, 2)."""
    sway_cm: Floats
    """Bound of any point's displacement in half of any move, shape (m,)."""
    moves: NDArray[np.uint8]
    """Bit d is set when move d exists, shape (m,)."""


def most_turn_rad(scene: Scene, sample_s: float) -> tuple[float, float]:
    """Return how far each joint can turn from rest to rest in a motion sample, in the way this module describes."""
    share = HEADROOM * scene.motion.acceleration_share
    first, second = (
        min(HEADROOM * joint.max_speed_rad_s * sample_s / 1.5, share * joint.max_acceleration_rad_s2 * sample_s**2 / 6)
        for joint in scene.joints
    )
    return first, second


def cell_poses(scene: Scene, elbow: ElbowSide, most_turn: tuple[float, float] = (inf, inf)) -> CellPoses:
    """Return the poses on the nodes of a scene's grid.

    Args:
        scene: arm and workspace; its obstacles are left aside.
        elbow: the elbow side.
        most_turn: how far each joint can turn in one move, in radians; a move with a longer turn does not exist.

    Raises:
        SceneError: the limits of joint 2 leave no pose on this side.
    """
    empty = build_free_map(replace(scene, obstacles=()), elbow=elbow)
    rows, columns = empty.region.shape
    cell = np.flatnonzero(empty.region == FREE).astype(np.int32)
    place = np.full(rows * columns, -1, np.int32)
    place[cell] = np.arange(len(cell), dtype=np.int32)
    count = len(cell)
    poses = CellPoses(
        columns=columns,
        rows=rows,
        cell=cell,
        place=place,
        tip_cm=np.column_stack([empty.x_cm[cell % columns], empty.y_cm[cell // columns]]) - scene.arm.base_cm,
        elbow_cm=np.empty((count, 2)),
        q_rad=np.empty((count, 2)),
        sway_cm=np.zeros(count),
        moves=np.zeros(count, np.uint8),
    )
    _fill_poses(empty.world.arm, poses.tip_cm, poses.elbow_cm, poses.q_rad)
    # Half a turn is never a short move: it is one across the end of joint 1's range.
    _fill_moves(empty.world.arm, poses, min(most_turn[0], 3.0), min(most_turn[1], 3.0))
    return poses


@kernel
def _fill_poses(arm: TwoLinkArm, tip_cm: Floats, elbow_cm: Floats, q_rad: Floats) -> None:
    for i in range(tip_cm.shape[0]):
        x, y = tip_cm[i, 0], tip_cm[i, 1]
        r2 = x * x + y * y
        r = np.sqrt(r2)
        elbow_cm[i, 0], elbow_cm[i, 1] = elbow_from_base(arm, x, y, r2, r)
        beta = np.arccos(cos_beta_at(arm, r))
        q_rad[i, 0] = theta1_at(arm, x + arm.base_x_cm, y + arm.base_y_cm, beta)
        q_rad[i, 1] = theta2_at(arm, r)


@kernel
def _fill_moves(arm: TwoLinkArm, poses: CellPoses, most1: float, most2: float) -> None:
    columns, rows, cell, place = poses.columns, poses.rows, poses.cell, poses.place
    tip, q, sway, moves = poses.tip_cm, poses.q_rad, poses.sway_cm, poses.moves
    for i in range(cell.shape[0]):
        iy, ix = cell[i] // columns, cell[i] % columns
        for d in range(8):
            jy, jx = iy + DY[d], ix + DX[d]
            if jy < 0 or jy >= rows or jx < 0 or jx >= columns:
                continue
            j = place[jy * columns + jx]
            if j < 0:
                continue
            turn1, turn2 = abs(q[j, 0] - q[i, 0]), abs(q[j, 1] - q[i, 1])
            if turn1 > most1 or turn2 > most2:
                continue
            moves[i] |= np.uint8(1 << d)
            turn12 = q[j, 0] + q[j, 1] - q[i, 0] - q[i, 1]
            bend = 0.125 * (arm.l1_cm * turn1**2 + arm.l2_cm * turn12**2)
            by_tip = 0.5 * np.hypot(tip[j, 0] - tip[i, 0], tip[j, 1] - tip[i, 1]) + bend
            sway[i] = max(sway[i], by_tip, 0.5 * turn1 * arm.l1_cm)
