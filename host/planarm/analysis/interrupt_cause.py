"""Which interrupt kept an edge from its time, where the recording carries the emulator's interrupt line."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def delayed_by(interrupts: npt.NDArray[np.void], due_ps: float, came_ps: float) -> str | None:
    """Name the vector that ran longest between the moment an edge was due and the moment it came.

    Args:
        interrupts: those that ended before or around, fields vector, begin_ps, end_ps; ascending.
        due_ps: the edge's planned moment.
        came_ps: its real one.

    Returns:
        "interrupt N", or None when none ran then.
    """
    begins = np.maximum(interrupts["begin_ps"], due_ps)
    ends = np.minimum(interrupts["end_ps"], came_ps)
    overlaps = ends - begins
    if not len(overlaps) or overlaps.max() <= 0:
        return None
    return f"interrupt {int(interrupts['vector'][int(overlaps.argmax())])}"
