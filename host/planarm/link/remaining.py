"""How long a motion still takes, honestly: by the path clock that the device tells, and by the clock on the wall."""

from collections.abc import Callable

from planarm.link.stream import PERCENT, StreamProgress
from planarm_wire.messages import State

SEEN_S = 0.2
"""Before so much has passed on the line, its clock is taken for the wall's."""
STANDING = (State.HELD, State.STARVED, State.READY)


class Remaining:
    """Compares two clocks: an emulated board's may run faster or slower than the wall's."""

    def __init__(self, wall_s: Callable[[], float]) -> None:
        self._wall_s = wall_s
        self._began: tuple[float, float] | None = None

    def after(self, told: StreamProgress) -> float | None:
        """Return the seconds on the wall until the end, or None while the arm stands still and nobody can know."""
        wall_s = self._wall_s()
        if self._began is None:
            self._began = wall_s, told.at_s
        left_s = told.total_s - told.path_s
        if left_s <= 0.0:
            return 0.0
        if told.state in STANDING or told.rate_percent == 0:
            return None
        on_line_s = told.at_s - self._began[1]
        pace = (wall_s - self._began[0]) / on_line_s if on_line_s > SEEN_S else 1.0
        return left_s * PERCENT / told.rate_percent * pace


def words_of(told: StreamProgress, left_s: float | None, *, short: bool = False) -> str:
    """Return path time, that of what the device holds, and remaining time in words; `short` leaves out the first."""
    rate = "" if told.rate_percent in (0, PERCENT) else f", at {told.rate_percent} %"
    if short:
        left = told.state.name.lower() if left_s is None else f"{left_s:.0f} s left"
        return f"{told.queued_s:.1f} s queued{rate}, {left}"
    left = f"the arm stands ({told.state.name.lower()})" if left_s is None else f"about {left_s:.1f} s left"
    return f"{told.path_s:.2f} of {told.total_s:.2f} s, {told.queued_s:.2f} s queued{rate}, {left}"
