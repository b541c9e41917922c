"""Distinct ways of a two-link arm: past each obstacle with the elbow on one side or on the other.

The straight arm that points at an obstacle within reach touches it, so in joint space the obstacle's poses lie across
theta2 = 0 at the obstacle's direction: a way past it crosses that direction above them or below, with theta2 < 0 or
theta2 > 0. Each obstacle has a gate for either. Two ways that cross different gates cannot be drawn into each other
without touching an obstacle. (With one elbow side for the whole way there is one way at most.)

The cheapest way that crosses none of a set of gates is found with those gates closed; closing each gate of a way in
turn gives the next candidates, so ways come out from the cheapest on, each through other gates than those before.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import pairwise
from math import atan2, ceil, floor, pi
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planarm.model.kinematics import ElbowSide
from planarm.model.shapes import bounding_circle, shape_of
from planarm.scene import JointSpaceSpec, Scene
from planarm.search.joint_lattice import crosses
from planarm.search.joint_space import SIDES, JointRoute, find_joint_route

Floats = NDArray[np.float64]

MOST_TRIED: Final = 200
"""Sets of closed gates that are tried before the search for more ways is given up."""


@dataclass(frozen=True, slots=True)
class Gate:
    """A half of the line theta1 = an obstacle's direction."""

    of: int
    """The obstacle, counted from 1."""
    side: ElbowSide
    theta1_rad: float

    @property
    def line(self) -> tuple[float, float]:
        """What the search takes: theta1, and the sign of theta2."""
        return self.theta1_rad, -1.0 if self.side == "up" else 1.0


@dataclass(frozen=True, slots=True)
class Way:
    """A way and how it passes."""

    route: JointRoute
    passed: tuple[tuple[int, ElbowSide], ...]
    """Obstacles whose direction joint 1 passes, counted from 1, each with the elbow's side there."""


def ways(scene: Scene, margin_cm: float, spec: JointSpaceSpec) -> Iterator[Way]:
    """Yield distinct ways in joint space, the cheapest first.

    Args:
        scene: a scene with a two-link arm.
        margin_cm: least distance of a link's centre line to an obstacle.
        spec: the objective, and which elbow sides start and goal may have.
    """
    gates = gates_of(scene)
    told: set[frozenset[int]] = set()
    tried: set[frozenset[int]] = set()
    waiting: list[tuple[float, int, frozenset[int], frozenset[int], JointRoute]] = []

    def consider(closed: frozenset[int]) -> None:
        if closed in tried or len(tried) >= MOST_TRIED:
            return
        tried.add(closed)
        route = find_joint_route(scene, margin_cm, spec, [gates[k].line for k in closed]).route
        if route is not None:
            heappush(waiting, (route.cost, len(tried), closed, crossed_gates(route.poses_rad, gates), route))

    consider(frozenset())
    while waiting:
        _, _, closed, crossed, route = heappop(waiting)
        if crossed not in told:
            told.add(crossed)
            yield Way(route, tuple(sorted((gates[k].of, gates[k].side) for k in crossed)))
        for k in sorted(crossed):
            consider(closed | {k})


def gates_of(scene: Scene) -> tuple[Gate, ...]:
    """Return both gates of every obstacle, in every turn that joint 1's limits allow."""
    low, high = scene.arm.joint_limits_rad[0]
    gates = []
    for number, obstacle in enumerate(scene.obstacles, start=1):
        x, y = bounding_circle(shape_of(obstacle)).center_cm
        direction = atan2(y - scene.arm.base_cm[1], x - scene.arm.base_cm[0])
        for turn in range(ceil((low - direction) / (2 * pi)), floor((high - direction) / (2 * pi)) + 1):
            gates += [Gate(number, side, direction + 2 * pi * turn) for side in SIDES]
    return tuple(gates)


def crossed_gates(poses_rad: Floats, gates: tuple[Gate, ...]) -> frozenset[int]:
    """Return which gates straight moves between poses cross an odd number of times: to and fro is not to pass."""
    odd = set()
    for k, gate in enumerate(gates):
        line = np.array([gate.line])
        if sum(crosses(line, *a, *b) for a, b in pairwise(poses_rad)) % 2:
            odd.add(k)
    return frozenset(odd)
