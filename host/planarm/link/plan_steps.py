"""Where a motion's segments take each joint: positions at their borders, and which step a position belongs to."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Self

from planarm_wire.messages import Segment
from planarm_wire.steps import signed_steps, step_count

LOOK_AHEAD = 8
"""Segments beyond the whole ones executed in which a joint may be: four slices are handed over ahead of time."""


@dataclass(frozen=True, slots=True)
class PlanSteps:
    """The steps of a motion, added up.

    Attributes:
        positions: of each joint, signed micro-steps since the start at every border, segments + 1 of them.
        counts: of each joint, steps made up to every border.
    """

    positions: tuple[tuple[int, ...], ...]
    counts: tuple[tuple[int, ...], ...]

    @classmethod
    def of(cls, segments: Sequence[Segment]) -> Self:
        """Add up the steps of `segments`."""
        joints = list(zip(*(segment.moves for segment in segments), strict=True))
        return cls(
            tuple(tuple(accumulate((signed_steps(move) for move in moves), initial=0)) for moves in joints),
            tuple(tuple(accumulate((step_count(move) for move in moves), initial=0)) for moves in joints),
        )

    @property
    def segments(self) -> int:
        """How many segments there are."""
        return len(self.positions[0]) - 1 if self.positions else 0

    def planned_usteps(self) -> tuple[int, ...]:
        """Signed micro-steps of each joint over the whole motion."""
        return tuple(positions[-1] for positions in self.positions)

    def range_usteps(self, told: Sequence[int], executed: int, most: int) -> tuple[tuple[int, int], ...]:
        """Least and greatest position of each joint from where it is told to be, in segment `executed`, up to `most`.

        Within a segment a joint turns one way, so its extremes lie at borders.
        """
        ranges = []
        for position, positions in zip(told, self.positions, strict=True):
            ahead = (position, *positions[executed + 1 : most + 1])
            ranges.append((min(ahead), max(ahead)))
        return tuple(ranges)

    def locate(self, executed: int, moved_usteps: Sequence[int]) -> tuple[int, ...] | None:
        """How many of its steps each joint has made, given whole segments executed and the joints' positions.

        None when no step of the segments that may be running has those positions: it is another motion's.
        """
        made = tuple(
            _steps_to(moved, positions, counts, executed)
            for moved, positions, counts in zip(moved_usteps, self.positions, self.counts, strict=True)
        )
        return None if any(steps < 0 for steps in made) else tuple(made)


def planned_usteps(segments: Sequence[Segment]) -> tuple[int, ...]:
    """Signed micro-steps that `segments` move each joint by."""
    return PlanSteps.of(segments).planned_usteps()


def _steps_to(moved: int, positions: Sequence[int], counts: Sequence[int], executed: int) -> int:
    """Count the steps until the first visit of `moved` at or after border `executed`; -1 when there is none."""
    for k in range(executed, min(executed + LOOK_AHEAD, len(positions) - 1)):
        low, high = sorted(positions[k : k + 2])
        if low <= moved <= high:
            return counts[k] + abs(moved - positions[k])
    return counts[-1] if positions[-1] == moved and executed + LOOK_AHEAD >= len(positions) else -1
