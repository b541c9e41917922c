"""Where on its path a motion is, between two steps: from the ledger's whole segments and the steps that joints made."""

from bisect import bisect_right
from collections.abc import Sequence

from planarm.link.clock_sync import Span
from planarm.link.plan_steps import LOOK_AHEAD, PlanSteps
from planarm_wire.messages import TICKS_HZ, Segment
from planarm_wire.steps import step_tick


class PathTime:
    """Tells a motion's path time from its ledger.

    Args:
        segments: the motion's.
        ends_ticks: path time at every border, segments + 1 of them.
        steps: the segments' steps.
    """

    def __init__(self, segments: Sequence[Segment], ends_ticks: Sequence[int], steps: PlanSteps) -> None:
        self._segments, self._ends, self._steps = segments, ends_ticks, steps

    def span_s(self, executed: int, moved_usteps: Sequence[int]) -> Span:
        """Return the path time of the moment at which a ledger was read, in seconds.

        At least that of the last step that any joint has made, at most that of the first that it has not. Where a joint
        comes by the same place more than once within the segments that may be running, it tells only the former.

        Args:
            executed: whole segments executed.
            moved_usteps: of each joint since the motion's start.
        """
        least, most = self._ends[min(executed, len(self._segments))], self._ends[-1]
        for joint, moved in enumerate(moved_usteps):
            made = self._made(joint, moved, executed)
            if made and made[0]:
                least = max(least, self._tick(joint, made[0] - 1))
            if len(made) == 1 and made[0] < self._steps.counts[joint][-1]:
                most = min(most, self._tick(joint, made[0]))
        return Span(least / TICKS_HZ, max(least, most) / TICKS_HZ)

    def _made(self, joint: int, moved: int, executed: int) -> list[int]:
        """How many steps a joint may have made when it stands there, ascending."""
        positions, counts = self._steps.positions[joint], self._steps.counts[joint]
        found = set()
        for k in range(executed, min(executed + LOOK_AHEAD, len(self._segments))):
            low, high = sorted(positions[k : k + 2])
            if low <= moved <= high:
                found.add(counts[k] + abs(moved - positions[k]))
        return sorted(found)

    def _tick(self, joint: int, step: int) -> int:
        """The path tick of a joint's step, counted from 0 over the whole motion."""
        counts = self._steps.counts[joint]
        k = bisect_right(counts, step) - 1
        return self._ends[k] + step_tick(self._segments[k].moves[joint], step - counts[k])
