"""What the papers print: the only place where a published figure of a comparison is written.

Source: M. L. Muhammed, A. J. Humaidi and E. H. Flaieh, A Comparative Study of Graph Search Algorithms for Planar
Manipulator to Avoid Obstacle Collision, Table II and section VIII (paper C).
"""

from dataclasses import dataclass
from typing import Final

from planarm.scene import Algorithm

SOURCE: Final = (
    "M. L. Muhammed, A. J. Humaidi, E. H. Flaieh: A Comparative Study of Graph Search Algorithms for Planar "
    "Manipulator to Avoid Obstacle Collision, Table II"
)
LENGTH_DECIMALS: Final = 4
PERCENT_DECIMALS: Final = 2
CLOCK_S: Final = 1.0 / 64.0
"""All eight published times are multiples of it, rounded to four decimals: the tick of the authors' clock."""


@dataclass(frozen=True, slots=True)
class Planner:
    """A row of Table II."""

    name: str
    algorithm: Algorithm
    neighbours: int
    """Paper C, section VIII: 8, 24, 44 of which 23 are drawn at random, and 56."""


@dataclass(frozen=True, slots=True)
class Figures:
    """What Table II says about one planner in one case."""

    length_cm: float
    length_improvement_percent: float
    time_s: float
    time_improvement_percent: float


A_STAR: Final = Planner("A*", "a_star", 8)
MODIFIED: Final = Planner("Modified A*", "modified_a_star", 24)
CHAOS: Final = Planner("Chaos A*", "chaos_a_star", 44)
CHS: Final = Planner("CHS", "chs", 56)
PLANNERS: Final = (A_STAR, MODIFIED, CHAOS, CHS)
CASES: Final = (1, 2)

TABLE2: Final[dict[tuple[int, Planner], Figures]] = {
    (1, A_STAR): Figures(72.8406, 0.0, 11.9063, 0.0),
    (1, MODIFIED): Figures(72.6559, 0.25, 11.4844, 3.67),
    (1, CHAOS): Figures(72.6706, 0.23, 5.9844, 98.95),
    (1, CHS): Figures(68.984, 5.59, 11.6563, 2.14),
    (2, A_STAR): Figures(70.7401, 0.0, 10.0625, 0.0),
    (2, MODIFIED): Figures(69.2297, 2.18, 9.2656, 8.60),
    (2, CHAOS): Figures(69.2297, 2.18, 3.6406, 176.39),
    (2, CHS): Figures(68.325, 3.53, 10.0313, 0.31),
}
"""By case and planner; the improvements are against A* in the same case."""
