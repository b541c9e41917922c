"""Count steps from the pins' edges and hold them against the planned schedule.

The judge reads waveforms only: a step is a rising STEP edge, its direction is the DIR level at that moment. The
firmware's own counters are not asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Ticks = npt.NDArray[np.int64]
Directions = npt.NDArray[np.int8]


FIRST_STEPS = 64
"""Steps of all joints together that tell where the plan's zero is."""


@dataclass(frozen=True, slots=True)
class Waveform:
    """One pin's edges.

    Attributes:
        ticks: Moment of each edge in mcu ticks of 62.5 ns, ascending, int64[n].
        levels: Level after each edge, 0 or 1, uint8[n]. The pin is low before its first edge.
    """

    ticks: Ticks
    levels: npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class MeasuredSteps:
    """One joint's steps as its driver sees them.

    Attributes:
        ticks: Rising STEP edges, int64[n].
        directions: +1 or -1 at each of them, int8[n].
        min_high_ticks: Shortest pulse; None without a complete pulse.
        min_low_ticks: Shortest pause between pulses; None with fewer than two pulses.
        min_dir_setup_ticks: Least time from a DIR edge to the next rising STEP edge; None without one.
        min_dir_hold_ticks: Least time from a rising STEP edge to the next DIR edge; None without one.
    """

    ticks: Ticks
    directions: Directions
    min_high_ticks: int | None
    min_low_ticks: int | None
    min_dir_setup_ticks: int | None
    min_dir_hold_ticks: int | None

    @property
    def net_usteps(self) -> int:
        """Signed sum of the steps."""
        return int(self.directions.sum(dtype=np.int64))


@dataclass(frozen=True, slots=True)
class StepComparison:
    """Steps at the pins against the schedule, all joints.

    Attributes:
        steps_planned: Scheduled steps of each joint.
        steps_at_pins: Counted steps of each joint.
        directions_agree: True when every counted step has the planned direction.
        max_timing_error_ticks: Largest difference of any rising edge from its scheduled tick after the one common
            start offset is removed; None when the counts differ.
    """

    steps_planned: tuple[int, ...]
    steps_at_pins: tuple[int, ...]
    directions_agree: bool
    max_timing_error_ticks: int | None

    @property
    def agrees(self) -> bool:
        """True when exactly the planned steps were made, each in its direction."""
        return self.steps_planned == self.steps_at_pins and self.directions_agree

    def explain(self) -> str:
        """Say in a sentence how pins and plan compare."""
        if self.steps_planned != self.steps_at_pins:
            return f"the pins show {self.steps_at_pins} steps, the plan has {self.steps_planned}"
        if not self.directions_agree:
            return f"the pins show {self.steps_at_pins} steps as planned, but some in the wrong direction"
        return f"the pins show the planned steps, within {self.max_timing_error_ticks} ticks"


def measure_steps(step: Waveform, direction: Waveform) -> MeasuredSteps:
    """Read one joint's steps and pulse widths from its STEP and DIR waveforms."""
    rises = step.ticks[step.levels == 1]
    falls = step.ticks[step.levels == 0]
    # Index of the DIR edge that last happened at or before each rise; -1 means none yet, so low.
    before = np.searchsorted(direction.ticks, rises, side="right") - 1
    level = np.where(before >= 0, direction.levels[np.maximum(before, 0)], 0) if len(direction.ticks) else 0 * rises
    directions = np.where(level == 1, 1, -1).astype(np.int8)
    return MeasuredSteps(
        ticks=rises,
        directions=directions,
        min_high_ticks=_least_gap(rises, falls),
        min_low_ticks=_least_gap(falls, rises),
        min_dir_setup_ticks=_least_gap(direction.ticks, rises),
        min_dir_hold_ticks=_least_gap(rises, direction.ticks),
    )


def compare_steps(planned: Sequence[tuple[Ticks, Directions]], measured: Sequence[MeasuredSteps]) -> StepComparison:
    """Hold the measured steps against the schedule.

    Args:
        planned: For each joint the scheduled ticks, from the schedule's own zero, and the directions.
        measured: For each joint what the pins showed.

    Returns:
        The comparison. The schedule's start on the board is not known to the host, so one offset, common to all
        joints, is taken from the first steps; every other edge has to fit it.
    """
    counts_planned = tuple(len(ticks) for ticks, _ in planned)
    counts_measured = tuple(len(joint.ticks) for joint in measured)
    if counts_planned != counts_measured:
        return StepComparison(counts_planned, counts_measured, False, None)
    agree = all(
        np.array_equal(directions, joint.directions) for (_, directions), joint in zip(planned, measured, strict=True)
    )
    offset = start_tick_of([ticks for ticks, _ in planned], [joint.ticks for joint in measured])
    errors = [seen.ticks - ticks - offset for (ticks, _), seen in zip(planned, measured, strict=True)]
    error = max((int(np.abs(one).max(initial=0)) for one in errors), default=0)
    return StepComparison(counts_planned, counts_measured, agree, error)


def start_tick_of(planned: Sequence[Ticks], seen: Sequence[Ticks]) -> int:
    """Return the tick of the plan's zero by the first steps at the pins, 0 when there is none.

    A step that an interrupt makes comes a little early or late, one of a compare output does not, and a motion may be
    slowed down later on: so it is the middle one of the first FIRST_STEPS steps' differences that counts.
    """
    pairs = [(ticks[: len(at)], at[: len(ticks)]) for ticks, at in zip(planned, seen, strict=True)]
    meant = np.concatenate([ticks for ticks, _ in pairs])
    apart = np.concatenate([at for _, at in pairs]) - meant
    first = np.sort(apart[np.argsort(meant, kind="stable")[:FIRST_STEPS]])
    return int(first[(len(first) - 1) // 2]) if len(first) else 0


def _least_gap(first: Ticks, then: Ticks) -> int | None:
    """Least time from an edge in `first` to the next later edge in `then`."""
    if not len(first) or not len(then):
        return None
    following = np.searchsorted(then, first, side="right")
    inside = following < len(then)
    if not inside.any():
        return None
    return int((then[following[inside]] - first[inside]).min())
