"""Which lengths a lattice path can have, by arithmetic alone: no map, no obstacles, no search.

A path of 24-neighbour moves (paper C, section V) is made of steps of length 1, sqrt 2 and sqrt 5 cells; steps of
length 2 and 2 sqrt 2 count twice. Its length is a + b sqrt 2 + c sqrt 5 with whole a, b, c, and since a step of length
1 or sqrt 5 changes dx + dy by an odd number and one of sqrt 2 by an even one, a + c is odd exactly when dx + dy from
start to goal is.
"""

from math import sqrt
from typing import NamedTuple


class Steps(NamedTuple):
    """How many steps of length 1, sqrt 2 and sqrt 5 cells."""

    straight: int
    diagonal: int
    knight: int

    @property
    def odd(self) -> bool:
        """Whether such a path joins nodes with an odd dx + dy, in cells."""
        return (self.straight + self.knight) % 2 == 1


def steps_of_length(length_cm: float, cell_cm: float, decimals: int, knights: bool) -> tuple[Steps, ...]:
    """Return all step counts whose length rounds to `length_cm` at so many decimals; without knight's steps: A*."""
    half_digit_cm = 0.5 * 10.0**-decimals * (1.0 + 1e-9)
    cells = length_cm / cell_cm
    found = []
    for knight in range(int(cells / sqrt(5.0)) + 1 if knights else 1):
        for diagonal in range(int((cells - knight * sqrt(5.0)) / sqrt(2.0)) + 1):
            rest = cells - knight * sqrt(5.0) - diagonal * sqrt(2.0)
            straight = round(rest)
            if abs(straight - rest) * cell_cm <= half_digit_cm:
                found.append(Steps(straight, diagonal, knight))
    return tuple(found)
