"""Neighbourhood stencils: the only thing in which the four planners differ (paper C, figs. 2, 4, 6 and 8).

A stencil is a list of lattice offsets (dx, dy) in cells; a move goes in a straight line from a node to the node at
that offset. The order of the offsets (by squared length, then dy, then dx) is fixed, because ties between equally
good paths are broken by it.
"""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import floor, isqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planarm.scene import Algorithm

Offsets = NDArray[np.int16]


@dataclass(frozen=True, slots=True)
class _Square:
    """The square of (2 reach + 1)^2 nodes less its centre; 1 or 2 diagonals cut at a corner take 1 or 3 nodes."""

    reach: int
    diagonals_cut: int = 0

    def holds(self, dx: int, dy: int) -> bool:
        """Tell whether (dx, dy) belongs."""
        return max(abs(dx), abs(dy)) <= self.reach and abs(dx) + abs(dy) <= 2 * self.reach - self.diagonals_cut


@dataclass(frozen=True, slots=True)
class _Disc:
    """The lattice nodes with dx^2 + dy^2 <= radius_squared, less the centre."""

    radius_squared: int

    @property
    def reach(self) -> int:
        """The largest coordinate."""
        return isqrt(self.radius_squared)

    def holds(self, dx: int, dy: int) -> bool:
        """Tell whether (dx, dy) belongs."""
        return dx * dx + dy * dy <= self.radius_squared


_DISCS: Final[dict[int, _Square | _Disc]] = {12: _Disc(4), 28: _Disc(9), 48: _Disc(16), 56: _Disc(17), 80: _Disc(25)}

_SHAPES: Final[dict[Algorithm, dict[int, _Square | _Disc]]] = {
    "a_star": {8: _Square(1)},
    "modified_a_star": {24: _Square(2), 48: _Square(3)},
    # Octagons of paper C, fig. 6: squares of 8, 24, 48 and 80 nodes less 0, 1, 1 and 3 nodes at each of the four
    # corners, that is 8, 20, 44 and 68. (Its text says 48 for the one of which 23 are drawn; its results say 44.)
    "chaos_a_star": {8: _Square(1), 20: _Square(2, 1), 44: _Square(3, 1), 68: _Square(4, 2)},
    # Radii 2, 3, 4 and 5 of paper C, fig. 8 hold 12, 28, 48 and 80 nodes. The 56 that its results give for "radius 5"
    # are the nodes with dx^2 + dy^2 <= 17.
    "chs": _DISCS,
    "taut": _DISCS,
    "any_angle": _DISCS,
    "theta_star": {8: _Square(1)},
    "lazy_theta_star": {8: _Square(1)},
}

DRAWN: Final[dict[int, int]] = {8: 5, 20: 12, 44: 23, 68: 34}
"""Chaos A*: how many of an octagon's 8, 20, 44 or 68 neighbours are drawn at random (paper C, fig. 6)."""


def neighbour_counts(algorithm: Algorithm) -> tuple[int, ...]:
    """Return the neighbourhoods, by their number of nodes, that `algorithm` is defined for."""
    return tuple(sorted(_SHAPES[algorithm]))


def stencil(algorithm: Algorithm, neighbours: int) -> Offsets:
    """Return the offsets (dx, dy) in cells, int16[neighbours, 2], of one of the published neighbourhoods.

    For Chaos A* this is the whole octagon, of which the search draws `DRAWN[neighbours]`. Raises ValueError for a
    number of neighbours that the algorithm is not defined for.
    """
    shape = _SHAPES[algorithm].get(neighbours)
    if shape is None:
        allowed = ", ".join(map(str, neighbour_counts(algorithm)))
        raise ValueError(f"planner.neighbours = {neighbours} is not defined for {algorithm}; choose {allowed}")
    span = range(-shape.reach, shape.reach + 1)
    offsets = [(dx, dy) for dx in span for dy in span if (dx, dy) != (0, 0) and shape.holds(dx, dy)]
    offsets.sort(key=lambda o: (o[0] ** 2 + o[1] ** 2, o[1], o[0]))
    return np.array(offsets, dtype=np.int16)


def primitive(offsets: Offsets) -> Offsets:
    """Return the offsets that are no multiple of a shorter one, in the same order.

    Where every node on a straight free move is itself free, a multiple is a chain of its primitive move and leaving
    it out changes no length. Moves that are checked at their ends only may hop over a blocked node, so for those the
    whole stencil has to stay.
    """
    shortest: Offsets = offsets[np.gcd(offsets[:, 0], offsets[:, 1]) == 1]
    return shortest


@cache
def cover(dx: int, dy: int) -> tuple[tuple[int, int], ...]:
    """Return the cells, as offsets from the first, that the straight move from centre (0, 0) to (dx, dy) crosses.

    Only cells whose interior is met are listed; their closed squares cover the segment (one that passes exactly
    through a corner lies in the two cells that it leaves and enters). The cover of (-dx, -dy) is the same set of
    cells seen from the other end.
    """
    crossings = {0.0, 1.0}
    for d in (abs(dx), abs(dy)):
        crossings |= {(2 * k + 1) / (2 * d) for k in range(d)}
    ordered = sorted(crossings)
    middles = [(low + high) / 2.0 for low, high in pairwise(ordered)]
    return tuple((floor(t * dx + 0.5), floor(t * dy + 0.5)) for t in middles)
