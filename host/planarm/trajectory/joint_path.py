"""What the timing needs to know of a path: joint angles and their derivatives over one parameter.

The parameter s is the path's own (for tip paths a length in cm); its unit cancels out of every result. A path is made
of pieces. Inside a piece the angles have continuous second derivatives; at a border between two pieces the second
derivative may jump, and at a stop the first may, too.
"""

from typing import Protocol

from planarm.smoothing.smooth_path import Floats, JointState, Side

__all__ = ["Floats", "JointPath", "JointState", "Side"]


class JointPath(Protocol):
    """A path of the joints over s, from the first to the last of `borders_s`."""

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
        """Say where s is, in words for a message, such as ``path 12.3 cm, tip (35.1, 17.9) cm``."""
