"""Holds a joint's steps against its schedule, one after the other, and finds what is missing, extra or out of place.

The next scheduled step is expected one scaled scheduled interval after the last one that was found. A step within
0.4 of the smaller neighbouring interval of that moment is it; one before is extra. One after is held against the next
few scheduled steps: where it is one of them, those before are missing; where it is none, the motion paused and the step
is the one that was expected. So one defect stays one defect, and neither a pause nor a fast or slow clock carries on.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from planarm_wire.kernel_cache import kernel

Ints = npt.NDArray[np.int64]
Directions = npt.NDArray[np.int8]

NEAR = 0.4
"""Share of the smaller neighbouring interval within which a step is the scheduled one."""

MOST_MISSING = 8
"""How many steps in a row may be missing; a longer gap is a pause."""

EXTRA = -1
ALONE_PS = 10**12
"""Interval that a first or last step has on its open side, 1 s."""

_NEXT, _SEEN_PS, _PLANNED_PS = range(3)


@dataclass(frozen=True, slots=True, eq=False)
class Schedule:
    """One joint's planned steps: picoseconds from the motion's start, ascending, int64[n], and directions, int8[n]."""

    times_ps: Ints
    directions: Directions


@dataclass(slots=True, eq=False)
class MatchState:
    """Where the match of one joint stands.

    Attributes:
        start_ps: the recording's moment of the schedule's zero, as far as known.
        places: next scheduled step, and seen and planned moment of the last one found, int64[3].
    """

    start_ps: int
    places: Ints = field(init=False)

    def __post_init__(self) -> None:
        """Expect the first step."""
        self.places = np.array([0, self.start_ps, 0], np.int64)

    @property
    def next_step(self) -> int:
        """The scheduled step that is expected next."""
        return int(self.places[_NEXT])


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """What the match says of some steps.

    Attributes:
        planned: for each step the number of the scheduled one, or EXTRA, int64[n].
        missing: scheduled steps that were passed over, int64[m].
    """

    planned: Ints
    missing: Ints


def match_steps(times_ps: Ints, schedule: Schedule, scale: float, drift: float, state: MatchState) -> Matched:
    """Match the next steps of a joint.

    Args:
        times_ps: rising STEP edges that follow the ones given before, int64[n].
        schedule: the joint's planned steps.
        scale: recorded seconds for one of the schedule.
        drift: how wrong `scale` may be.
        state: carried from call to call.
    """
    planned = np.empty(len(times_ps), np.int64)
    missing = np.empty(len(schedule.times_ps) - state.next_step, np.int64)
    gone = _match(times_ps, schedule.times_ps, scale, drift, state.places, planned, missing)
    return Matched(planned, missing[:gone])


@kernel
def _lateness(now: int, plan: Ints, n: int, scale: float, drift: float, places: Ints) -> tuple[float, float]:
    """Return how much later than step n was due a step came, and how much may be."""
    since = plan[n] - places[_PLANNED_PS]
    before = plan[n] - plan[n - 1] if n > 0 else ALONE_PS
    after = plan[n + 1] - plan[n] if n + 1 < len(plan) else ALONE_PS
    late = np.float64(now - places[_SEEN_PS]) - since * scale
    return late, NEAR * min(before, after) * scale + drift * since


@kernel
def _match(times: Ints, plan: Ints, scale: float, drift: float, places: Ints, planned: Ints, missing: Ints) -> int:
    n = places[_NEXT]
    size = len(plan)
    gone = 0
    for k in range(len(times)):
        planned[k] = EXTRA
        if n >= size:
            continue
        late, room = _lateness(times[k], plan, n, scale, drift, places)
        if late < -room:
            continue
        skipped = 0
        while late > room and skipped < MOST_MISSING and n + skipped + 1 < size:
            skipped += 1
            late, room = _lateness(times[k], plan, n + skipped, scale, drift, places)
        if abs(late) > room:  # none of the next: a pause
            skipped = 0
        for passed in range(n, n + skipped):
            missing[gone] = passed
            gone += 1
        n += skipped
        planned[k] = n
        places[_SEEN_PS] = times[k]
        places[_PLANNED_PS] = plan[n]
        n += 1
    places[_NEXT] = n
    return gone
