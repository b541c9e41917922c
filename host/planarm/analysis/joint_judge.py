"""Judges one joint's steps, chunk by chunk: where they lie against the schedule, and the curves they make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planarm.analysis.capture import PS_PER_S
from planarm.analysis.clock_fit import WORST_CLOCK, ClockFit
from planarm.analysis.spread import SpreadBins
from planarm.analysis.step_match import EXTRA, MatchState, Schedule, match_steps

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Directions = npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """What is to be said of some steps.

    Attributes:
        times_ps, errors_ps: the steps that belong to the schedule, and how much later than due they came.
        extra_ps: steps that belong to none.
        wrong_direction_ps: steps that turn the other way.
        missing: numbers of scheduled steps that were passed over.
    """

    times_ps: Ints
    errors_ps: Floats
    extra_ps: Ints
    wrong_direction_ps: Ints
    missing: Ints


class JointJudge:
    """One joint's steps so far.

    Args:
        joint: from 0.
        schedule: the planned steps; None to look at the steps alone.
        clock: how the schedule lies in the recording.
        edges_ps: borders of the curve's bins, ascending.
        band_hz: rates of the resonance band.
    """

    def __init__(
        self,
        joint: int,
        schedule: Schedule | None,
        clock: ClockFit | None,
        edges_ps: Floats,
        band_hz: tuple[float, float] | None,
    ) -> None:
        self.joint = joint
        self.schedule = schedule
        self.steps = 0
        self.net_usteps = 0
        self.timing = SpreadBins()
        self.intervals = SpreadBins()
        self._clock = clock
        self._state = MatchState(round(clock.start_ps)) if schedule is not None and clock else None
        self._last = (-2, 0.0)  # number and error of the last step that belongs to the schedule
        self._last_ps: int | None = None
        self._shortest_ps: int | None = None
        self._band_hz = band_hz
        self._band_ps = 0
        self._edges_ps = edges_ps
        self._bins = np.zeros(len(edges_ps) - 1, np.int64)

    @property
    def shortest_interval_us(self) -> float | None:
        """Between two steps; None with fewer than two."""
        return None if self._shortest_ps is None else self._shortest_ps / 1e6

    @property
    def band_s(self) -> float | None:
        """Time at rates within the band; None without one."""
        return None if self._band_hz is None else self._band_ps / PS_PER_S

    def rate_hz(self) -> Floats:
        """Signed steps a second, a value a bin."""
        rate: Floats = self._bins / (np.diff(self._edges_ps) / PS_PER_S)
        return rate

    def take(self, times_ps: Ints, directions: Directions) -> Judged:
        """Judge the next steps."""
        self._count(times_ps, directions)
        if self.schedule is None or self._state is None or self._clock is None:
            none = np.empty(0, np.int64)
            return Judged(times_ps, np.empty(0), none, none, none)
        matched = match_steps(times_ps, self.schedule, self._clock.scale, WORST_CLOCK, self._state)
        found = matched.planned != EXTRA
        numbers, times = matched.planned[found], times_ps[found]
        due_ps = self._clock.start_ps + self._clock.scale * self.schedule.times_ps[numbers]
        errors = times - due_ps
        self.timing.add(errors)
        self._compare_intervals(numbers, errors)
        wrong = directions[found] != self.schedule.directions[numbers]
        return Judged(times, errors, times_ps[~found], times[wrong], matched.missing)

    def rest(self) -> Ints:
        """Return the numbers of the scheduled steps that never came."""
        if self.schedule is None or self._state is None:
            return np.empty(0, np.int64)
        return np.arange(self._state.next_step, len(self.schedule.times_ps))

    def _count(self, times_ps: Ints, directions: Directions) -> None:
        if not len(times_ps):
            return
        self.steps += len(times_ps)
        self.net_usteps += int(directions.sum(dtype=np.int64))
        places = np.clip(np.searchsorted(self._edges_ps, times_ps, side="right") - 1, 0, len(self._bins) - 1)
        np.add.at(self._bins, places, directions.astype(np.int64))
        before = times_ps[:1] if self._last_ps is None else np.array([self._last_ps])
        gaps = np.diff(np.concatenate([before, times_ps]))
        if self._last_ps is None:
            gaps = gaps[1:]
        if len(gaps):
            shortest = int(gaps.min())
            self._shortest_ps = shortest if self._shortest_ps is None else min(self._shortest_ps, shortest)
        if self._band_hz is not None:
            low, high = self._band_hz
            inside = (gaps >= PS_PER_S / high) & (gaps <= PS_PER_S / low)
            self._band_ps += int(gaps[inside].sum())
        self._last_ps = int(times_ps[-1])

    def _compare_intervals(self, numbers: Ints, errors: Floats) -> None:
        """Compare each interval between two scheduled neighbours with the schedule's."""
        if not len(numbers):
            return
        number, error = self._last
        steps = np.diff(numbers, prepend=number)
        self.intervals.add(np.diff(errors, prepend=error)[steps == 1])
        self._last = (int(numbers[-1]), float(errors[-1]))
