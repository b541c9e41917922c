"""Finds where a schedule starts in a recording, and how fast the board's clock runs against the recorder's.

Clones of the Uno are clocked by ceramic resonators and run up to half a per cent fast or slow, so a schedule fits no
recording of a board until its seconds are scaled.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from planarm.analysis.step_match import EXTRA, MatchState, Schedule, match_steps

Ints = npt.NDArray[np.int64]

WORST_CLOCK = 0.006
"""How far the ratio of the two clocks may be from 1 (a resonator's 0.5 % and some more)."""

MOST_SKIPPED = 4
"""How many steps may be missing or extra at the very start."""

OPENING_STEPS = 400
MOST_PAIRS = 1 << 18
_ALIKE_PS = 2000.0
_PAUSE_PS = 10**9
_FEW_PAIRS = 100


@dataclass(frozen=True, slots=True)
class ClockFit:
    """recorded moment = start_ps + scale x planned moment; `aligned` is False when the steps do not follow the plan."""

    start_ps: float
    scale: float
    aligned: bool

    def planned_ps(self, recorded_ps: float) -> float:
        """The schedule's moment for one of the recording."""
        return (recorded_ps - self.start_ps) / self.scale


@dataclass(slots=True, eq=False)
class ClockFitter:
    """Collects one joint's steps, chunk by chunk, and fits.

    Attributes:
        schedule: the joint's planned steps.
    """

    schedule: Schedule
    _opening: list[Ints] = field(default_factory=list, init=False)
    _state: MatchState | None = field(default=None, init=False)
    _seen: list[Ints] = field(default_factory=list, init=False)
    _planned: list[Ints] = field(default_factory=list, init=False)
    _every: int = field(default=1, init=False)

    def add(self, times_ps: Ints) -> None:
        """Take the next recorded steps."""
        if self._state is None:
            self._opening.append(times_ps.copy())
            if sum(map(len, self._opening)) < OPENING_STEPS:
                return
            times_ps = self._open()
        self._match(times_ps)

    def fit(self) -> ClockFit:
        """Return the fit to all steps taken; not aligned when fewer than half of them belong to the schedule."""
        if self._state is None and any(len(steps) for steps in self._opening):
            self._match(self._open())
        planned = np.concatenate(self._planned) if self._planned else np.empty(0, np.int64)
        seen = np.concatenate(self._seen) if self._seen else np.empty(0, np.int64)
        if len(planned) < 2 or 2 * self._every * len(planned) < self._state_steps():
            start = float(seen[0] - planned[0]) if len(planned) else 0.0
            return ClockFit(start, 1.0, aligned=len(planned) == 1 == len(self.schedule.times_ps))
        part = steady_part(planned, seen)
        start, scale = robust_line(planned[part], seen[part])
        if abs(scale - 1.0) > WORST_CLOCK:  # no clock: the motion was stretched
            start, scale = float(seen[part][0] - planned[part][0]), 1.0
        return ClockFit(start, scale, aligned=True)

    def _state_steps(self) -> int:
        return self._state.next_step if self._state else 0

    def _open(self) -> Ints:
        """Choose how the first steps belong together; return the steps collected so far that take part."""
        times_ps = np.concatenate(self._opening)
        self._opening = []
        skipped_plan, skipped_seen = best_opening(times_ps[:OPENING_STEPS], self.schedule)
        planned_ps = int(self.schedule.times_ps[skipped_plan])
        self._state = MatchState(int(times_ps[skipped_seen]) - planned_ps)
        self._state.places[:] = skipped_plan, times_ps[skipped_seen], planned_ps
        return times_ps[skipped_seen:]

    def _match(self, times_ps: Ints) -> None:
        assert self._state is not None
        matched = match_steps(times_ps, self.schedule, 1.0, WORST_CLOCK, self._state)
        found = matched.planned != EXTRA
        self._seen.append(times_ps[found][:: self._every].copy())
        self._planned.append(self.schedule.times_ps[matched.planned[found][:: self._every]])
        if sum(map(len, self._planned)) > MOST_PAIRS:  # half of them fix a line as well
            self._seen = [np.concatenate(self._seen)[::2]]
            self._planned = [np.concatenate(self._planned)[::2]]
            self._every *= 2


def best_opening(times_ps: Ints, schedule: Schedule) -> tuple[int, int]:
    """Return how many scheduled and how many recorded steps to pass over at the start.

    While a joint speeds up, its steps fit a schedule that is shifted by one almost as well, so of all openings under
    which (nearly) as many steps belong to the schedule the one counts that leaves the least error, and of those that
    are alike the one that passes over the fewest.
    """
    tried = [
        _try_opening(times_ps, schedule, plan, seen)
        for plan in range(min(MOST_SKIPPED, len(schedule.times_ps)))
        for seen in range(min(MOST_SKIPPED, len(times_ps)))
    ]
    most = max(opening.found for opening in tried)
    likely = [opening for opening in tried if opening.found >= 0.9 * most]
    least_ps = min(opening.error_ps for opening in likely)
    alike = [opening for opening in likely if opening.error_ps <= 2.0 * least_ps + _ALIKE_PS]
    best = min(alike, key=lambda opening: (opening.skipped_plan + opening.skipped_seen, -opening.found))
    return best.skipped_plan, best.skipped_seen


@dataclass(frozen=True, slots=True)
class _Opening:
    """Steps passed over in schedule and recording; steps found, less those missing and extra; median error."""

    skipped_plan: int
    skipped_seen: int
    found: int
    error_ps: float


def _try_opening(times_ps: Ints, schedule: Schedule, plan: int, seen: int) -> _Opening:
    state = MatchState(0)
    state.places[:] = plan, times_ps[seen], schedule.times_ps[plan]
    matched = match_steps(times_ps[seen:], schedule, 1.0, WORST_CLOCK, state)
    belong = matched.planned != EXTRA
    found = 2 * int(belong.sum()) - len(belong) - len(matched.missing) - plan - seen
    if belong.sum() < 2:
        return _Opening(plan, seen, found, np.inf)
    planned_ps, seen_ps = schedule.times_ps[matched.planned[belong]], times_ps[seen:][belong]
    start_ps, scale = robust_line(planned_ps, seen_ps)
    error_ps = float(np.median(np.abs(seen_ps - start_ps - scale * planned_ps)))
    return _Opening(plan, seen, found, error_ps if abs(scale - 1.0) <= WORST_CLOCK else np.inf)


def steady_part(planned: Ints, seen: Ints) -> slice:
    """Return the stretch to which a clock can be fitted: up to the first pause, or the longest where that is short."""
    gaps = np.diff(seen) - np.diff(planned)
    pauses = np.flatnonzero(gaps > WORST_CLOCK * np.diff(planned) + _PAUSE_PS) + 1
    borders = [0, *pauses.tolist(), len(planned)]
    parts = [slice(a, b) for a, b in pairwise(borders)]
    longest = max(parts, key=lambda part: part.stop - part.start)
    return parts[0] if parts[0].stop >= min(_FEW_PAIRS, longest.stop - longest.start) else longest


def robust_line(planned: Ints, seen: Ints) -> tuple[float, float]:
    """Fit seen = start + scale x planned by least squares, leaving outliers out (beyond 5 median deviations).

    Args:
        planned: moments of the schedule, int64[n], n >= 2, ascending.
        seen: the same steps in the recording, int64[n].
    """
    # From the first pair, so that float64 keeps its picoseconds over hours.
    x, y = (planned - planned[0]).astype(np.float64), (seen - seen[0]).astype(np.float64)
    kept = np.ones(len(x), np.bool_)
    for _ in range(4):
        span = x[kept] - x[kept].mean()
        scale = float(span @ (y[kept] - y[kept].mean()) / (span @ span)) if span.any() else 1.0
        offset = float(y[kept].mean() - scale * x[kept].mean())
        error = np.abs(y - offset - scale * x)
        kept = error <= max(5.0 * float(np.median(error)), 1.0)
    return float(seen[0]) + offset - scale * float(planned[0]), scale
