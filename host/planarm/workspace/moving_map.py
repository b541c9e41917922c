"""The free Cartesian space at every motion sample (paper B, section 4), and what is free in between.

Three planes of bits for each sample, one bit a node: `free` at the sample's own time, as the paper has it; `stay`, free
during the whole sample that follows, so that the arm may wait there; `room`, free during it with the pose's sway to
spare, so that half a move from there, or to there, is free whatever happens in the other half
(`planarm.workspace.cell_poses`). A sample's time is prolonged by the delay margin. Moves between nodes without room are
judged one by one by `planarm.workspace.moving_proof`.

The planes are computed incrementally: a node begins free everywhere, and what an obstacle's distance says at one sample
it says of all that follow until the obstacle has come as far. So a node is judged again only when its answer can have
changed.
"""

from dataclasses import dataclass
from math import ceil, floor, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.errors import SceneError
from planarm.model.kinematics import ElbowSide
from planarm.model.moving import MovingSet, gap_in_span, moving_set, sampled_offsets_cm
from planarm.scene import MovingSpec, Scene
from planarm.workspace.cell_poses import CellPoses, cell_poses, most_turn_rad
from planarm.workspace.world import TwoLinkArm, build_world, links_apart2
from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]
Bits = NDArray[np.uint64]

WORD = 64


class Clock(NamedTuple):
    """How time is divided."""

    sample_s: float
    samples: int
    delay_s: float
    """Each pose is to stay free for so much longer than the plan has it there."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingMap:
    """The free space over time on one elbow side; planes have the shape [sample, iy, word], 64 nodes a word."""

    elbow: ElbowSide
    arm: TwoLinkArm
    """With the margin that the map keeps."""
    obstacles: MovingSet
    poses: CellPoses
    clock: Clock
    free: Bits
    """Free at each sample's time, samples + 1 planes."""
    stay: Bits
    """Free from a sample's time to the next and the delay margin longer, `samples` planes."""
    room: Bits
    """The same with the sway to spare."""
    cell_cm: float
    origin: tuple[int, int]
    """The first node, in cells."""

    def nodes(self, sample: int) -> NDArray[np.bool_]:
        """Return where nodes are free at a sample, shape [iy, ix]."""
        return unpacked(self.free[sample], self.poses.columns)

    def tip_cm(self, cell: int) -> tuple[float, float]:
        """Return a node's position."""
        iy, ix = divmod(cell, self.poses.columns)
        return (ix + self.origin[0]) * self.cell_cm, (iy + self.origin[1]) * self.cell_cm

    def cell_at(self, tip_cm: tuple[float, float]) -> int:
        """Return the cell whose node lies at a point, -1 where there is none."""
        ix, iy = (round(value / self.cell_cm) - first for value, first in zip(tip_cm, self.origin, strict=True))
        inside = 0 <= ix < self.poses.columns and 0 <= iy < self.poses.rows
        cell = iy * self.poses.columns + ix
        on_node = inside and max(abs(a - b) for a, b in zip(self.tip_cm(cell), tip_cm, strict=True)) < 1e-6
        return cell if on_node else -1


def unpacked(plane: Bits, columns: int) -> NDArray[np.bool_]:
    """Return a plane of bits as booleans, shape [iy, ix]."""
    octets = plane.astype("<u8").view(np.uint8).reshape(len(plane), -1)
    return np.unpackbits(octets, axis=1, count=columns, bitorder="little").astype(np.bool_)


def packed(nodes: NDArray[np.bool_]) -> Bits:
    """Return booleans of shape [iy, ix] as a plane of bits."""
    words = -(-nodes.shape[1] // WORD)
    octets = np.zeros((len(nodes), words * 8), np.uint8)
    bits = np.packbits(nodes, axis=1, bitorder="little")
    octets[:, : bits.shape[1]] = bits
    return octets.view("<u8").astype(np.uint64)


def moving_spec(scene: Scene) -> MovingSpec:
    """Return the scene's table [moving].

    Raises:
        SceneError: it has none.
    """
    if scene.moving is None:
        raise SceneError(scene.source, "moving", "missing: write a table [moving] with sample_s and samples")
    return scene.moving


def build_moving_map(
    scene: Scene,
    elbow: ElbowSide,
    margin_cm: float | None = None,
    *,
    between: bool = True,
    limited: bool = True,
    delay_s: float | None = None,
) -> MovingMap:
    """Return the free Cartesian space over time on one elbow side.

    Args:
        scene: a scene with a table [moving].
        elbow: the elbow side.
        margin_cm: least distance of a link's centre line to an obstacle; None takes the scene's.
        between: compute `stay` and `room`, too; else both are empty.
        limited: leave out moves that the joints cannot make in a sample's time.
        delay_s: the delay margin; None takes the scene's.

    Raises:
        SceneError: the scene has no table [moving]; or the limits of joint 2 leave no pose on this side.
    """
    spec = moving_spec(scene)
    clock = Clock(spec.sample_s, spec.samples, spec.delay_margin_s if delay_s is None else delay_s)
    arm = build_world(scene, margin_cm, elbow).arm
    poses = cell_poses(scene, elbow, most_turn_rad(scene, spec.sample_s)) if limited else cell_poses(scene, elbow)
    obstacles = moving_set(scene, spec.horizon_s + clock.delay_s)
    nodes = np.zeros(poses.rows * poses.columns, np.bool_)
    nodes[poses.cell] = True
    plane = packed(nodes.reshape(poses.rows, poses.columns))
    free = np.repeat(plane[None], clock.samples + 1, axis=0)
    offsets = sampled_offsets_cm(obstacles, clock.sample_s * np.arange(clock.samples + 1.0))
    _clear_taken(arm, poses, obstacles, offsets, clock.sample_s, free)
    stay = np.repeat(plane[None], clock.samples if between else 0, axis=0)
    room = stay.copy()
    if between:
        _clear_between(arm, poses, obstacles, offsets, clock, stay, room)
    workspace = scene.workspace
    origin = workspace.columns[0], workspace.rows[0]
    return MovingMap(elbow, arm, obstacles, poses, clock, free, stay, room, workspace.cell_cm, origin)


@kernel
def _clear_taken(
    arm: TwoLinkArm, poses: CellPoses, moving: MovingSet, offsets: Floats, sample_s: float, free: Bits
) -> None:
    """Clear the bits of nodes that an obstacle takes at a sample's time."""
    tip, elbow, cell, columns = poses.tip_cm, poses.elbow_cm, poses.cell, poses.columns
    centers, radii = moving.obstacles.centers_cm, moving.obstacles.radii_cm
    first_vertex = moving.obstacles.first_vertex
    last = offsets.shape[1] - 1
    for i in range(radii.shape[0]):
        round_one = first_vertex[i] == first_vertex[i + 1]
        stride = moving.speeds_cm_s[i] * sample_s
        cx, cy = centers[i, 0] - arm.base_x_cm, centers[i, 1] - arm.base_y_cm
        keep = radii[i] + arm.margin_cm
        for n in range(cell.shape[0]):
            ex, ey, x, y = elbow[n, 0], elbow[n, 1], tip[n, 0], tip[n, 1]
            iy, ix = cell[n] // columns, cell[n] % columns
            word, bit = ix // WORD, np.uint64(1) << np.uint64(ix % WORD)
            k = 0
            while k <= last:
                ox, oy = offsets[i, k, 0], offsets[i, k, 1]
                gap = sqrt(links_apart2(cx + ox, cy + oy, ex, ey, x, y, arm.per_l1, arm.per_l2)) - keep
                if not round_one and gap <= 0.0:
                    gap = _exact_gap(arm, moving, i, k * sample_s, k * sample_s, ex, ey, x, y, np.inf)
                if gap > 0.0:
                    k += last + 1 if stride <= 0.0 else max(1, _most(ceil(gap / stride), last + 1))
                    continue
                run = last if stride <= 0.0 else _most(floor(-gap / stride), last)
                for at in range(k, min(last, k + run) + 1):
                    free[at, iy, word] &= ~bit
                k += run + 1


@kernel
def _most(count: float, limit: int) -> int:
    """Return a count, a whole number that may be too large for one, no larger than the limit."""
    return limit if count >= limit else int(count)


@kernel
def _exact_gap(
    arm: TwoLinkArm,
    moving: MovingSet,
    i: int,
    since: float,
    until: float,
    ex: float,
    ey: float,
    x: float,
    y: float,
    enough_cm: float,
) -> float:
    """Return the least distance of an obstacle to the links in a span of time, less the margin.

    A polygon's, when they overlap, is -margin. Above `enough_cm` a lower bound may be returned.
    """
    bx, by = arm.base_x_cm, arm.base_y_cm
    gap = gap_in_span(moving, i, since, until, bx, by, bx + ex, by + ey, bx + x, by + y, enough_cm + arm.margin_cm)
    return gap - arm.margin_cm


@kernel
def _clear_between(
    arm: TwoLinkArm, poses: CellPoses, moving: MovingSet, offsets: Floats, clock: Clock, stay: Bits, room: Bits
) -> None:
    """Clear the bits of nodes that an obstacle takes, or comes too near to, during a sample."""
    tip, elbow, cell, columns, sway = poses.tip_cm, poses.elbow_cm, poses.cell, poses.columns, poses.sway_cm
    centers, radii = moving.obstacles.centers_cm, moving.obstacles.radii_cm
    samples = stay.shape[0]
    for i in range(radii.shape[0]):
        stride = moving.speeds_cm_s[i] * clock.sample_s
        span = stride + moving.speeds_cm_s[i] * clock.delay_s
        cx, cy = centers[i, 0] - arm.base_x_cm, centers[i, 1] - arm.base_y_cm
        keep = radii[i] + arm.margin_cm
        for n in range(cell.shape[0]):
            ex, ey, x, y = elbow[n, 0], elbow[n, 1], tip[n, 0], tip[n, 1]
            iy, ix = cell[n] // columns, cell[n] % columns
            word, bit = ix // WORD, np.uint64(1) << np.uint64(ix % WORD)
            k = 0
            while k < samples:
                ox, oy = offsets[i, k, 0], offsets[i, k, 1]
                gap = sqrt(links_apart2(cx + ox, cy + oy, ex, ey, x, y, arm.per_l1, arm.per_l2)) - keep
                if gap > sway[n] + span:
                    k += samples if stride <= 0.0 else max(1, _most(ceil((gap - sway[n] - span) / stride), samples))
                    continue
                since = k * clock.sample_s
                end = since + clock.sample_s + clock.delay_s
                gap = _exact_gap(arm, moving, i, since, end, ex, ey, x, y, sway[n])
                until = k if stride > 0.0 else samples - 1
                for at in range(k, until + 1):
                    if gap <= sway[n]:
                        room[at, iy, word] &= ~bit
                    if gap <= 0.0:
                        stay[at, iy, word] &= ~bit
                k = until + 1
