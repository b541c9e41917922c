"""What timing and stepping need to know of a smooth path: joint angles and their derivatives over one parameter.

The parameter s is the path's own (cm for paths of the tip, radians for paths in joint space); its unit cancels out of
every result. A path is made of pieces. Inside a piece the angles have continuous second derivatives; at a border
between two pieces the second derivative may jump, and at a stop the first may, too.
"""

from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Side = Literal["left", "right"]


class JointState(NamedTuple):
    """Joint angles and their derivatives by s, each of shape (m, n): rad, rad per unit of s, rad per its square."""

    q_rad: Floats
    dq_rad: Floats
    ddq_rad: Floats


class SmoothPath(Protocol):
    """A path of n joints over s, from the first to the last of `borders_s`."""

    @property
    def borders_s(self) -> Floats:
        """Ends of the pieces, ascending, shape (pieces + 1,); a path of one point has one border."""

    @property
    def stops_s(self) -> Floats:
        """The inner borders at which the motion has to come to rest, ascending."""

    def evaluate(self, s: Floats, side: Side = "right") -> JointState:
        """Return the state at each s of shape (m,); at a border, of the piece on the given side.

        Values are NaN where the arm cannot be.
        """

    def place(self, s: float) -> str:
        """Say where s is, in words for a message, such as ``path 12.3 of 80.1 cm, tip (35.1, 17.9) cm``."""
