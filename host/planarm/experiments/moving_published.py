"""What paper B prints about its two environments: the only place where its figures are written.

Source: F. A. Raheem and U. I. Hameed, Interactive Heuristic D* Path Planning Solution Based on PSO for Two-Link Robotic
Arm in Dynamic Environment, World Journal of Engineering and Technology 7 (2019) 80-99 (paper B).
"""

from dataclasses import dataclass
from typing import Final

SOURCE: Final = (
    "F. A. Raheem, U. I. Hameed: Interactive Heuristic D* Path Planning Solution Based on PSO for Two-Link Robotic Arm "
    "in Dynamic Environment, World Journal of Engineering and Technology 7 (2019), Table 2 and section 6"
)


@dataclass(frozen=True, slots=True)
class PublishedEnvironment:
    """Table 2 and the text about one environment."""

    obstacles: int
    d_star_cm: float
    as_sum: str
    """The D* path as straight and diagonal moves of 1 cm."""
    pso_cm: float
    shorter_in_text_cm: float
    """By how much the text says PSO is shorter."""
    backs: tuple[int, ...]
    """Motion samples at which D* returns backward."""
    pso_backs: tuple[int, ...]
    frames: tuple[int, ...]
    """Motion samples of the other pictures along the D* path (Figs. 6 and 12)."""
    free_spaces: tuple[int, ...]
    """Motion samples of the free Cartesian spaces (Figs. 5 and 11)."""


PUBLISHED: Final = {
    1: PublishedEnvironment(
        3, 72.4264, "30 + 30 sqrt 2", 69.6865, 3.2846, (15, 38), (7,), (8, 21, 36), (1, 4, 5, 7, 8)
    ),
    2: PublishedEnvironment(
        4, 78.2132, "57 + 15 sqrt 2", 73.8408, 4.3724, (21, 46), (), (11, 33, 42), (1, 5, 7, 8, 11)
    ),
}
SAMPLE_S: Final = 0.01
POPULATION: Final = 50
ITERATIONS: Final = 100
