"""A motion's segments over path time, and how far a device is along them, by its ledger."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from planarm.errors import CertificateError, LinkError, StepsDifferError
from planarm.link.clock_sync import Span
from planarm.link.path_time import PathTime
from planarm.link.plan_steps import PlanSteps
from planarm.link.position import executed_since, moved_usteps
from planarm_wire.messages import TICKS_HZ, Ledger, Segment
from planarm_wire.steps import duration_ticks, is_last


class Course:
    """Where a motion stands.

    Attributes:
        segments: the motion's.
        ends_ticks: path time at every border, segments + 1 of them.
        steps: the segments' steps.
        before: the ledger at the motion's start; None before it was told.
        executed: whole segments executed, by the last ledger.
        executed_s: when that number was seen first; the start, before.

    Raises:
        CertificateError: the segments are no whole motion.
    """

    def __init__(self, segments: Sequence[Segment]) -> None:
        self.before: Ledger | None = None
        self.executed, self.executed_s = 0, 0.0
        self.take(segments)

    def take(self, segments: Sequence[Segment]) -> None:
        """Follow these segments; those executed stay executed."""
        _check_ends(segments)
        self.segments = tuple(segments)
        self.ends_ticks = tuple(accumulate(map(duration_ticks, segments), initial=0))
        self.steps = PlanSteps.of(segments)
        self._path_time = PathTime(self.segments, self.ends_ticks, self.steps)

    @property
    def total_s(self) -> float:
        """Path time of all of it."""
        return self.ends_ticks[-1] / TICKS_HZ

    def between_s(self, first: int, until: int) -> float:
        """Path time of the segments from one border to another."""
        return (self.ends_ticks[until] - self.ends_ticks[first]) / TICKS_HZ

    def follow(self, ledger: Ledger, sent: int, now_s: float) -> None:
        """Take a ledger, of a device to which so many segments were sent.

        Raises:
            LinkError: it tells more.
        """
        assert self.before is not None, "a motion begins with a ledger"
        executed = executed_since(self.before, ledger)
        if executed > sent:
            raise LinkError(
                f"the device tells {executed} executed segments, but only {sent} were sent;"
                " another program speaks to it, or host and firmware disagree"
            )
        if executed != self.executed:
            self.executed, self.executed_s = executed, now_s

    def moved_usteps(self, ledger: Ledger) -> tuple[int, ...]:
        """Signed micro-steps of each joint since the start."""
        assert self.before is not None, "a motion begins with a ledger"
        return moved_usteps(self.before, ledger)

    def span_s(self, ledger: Ledger) -> Span:
        """Return where on the path the motion was when the ledger was read."""
        return self._path_time.span_s(self.executed, self.moved_usteps(ledger))

    def check_done(self, ledger: Ledger) -> None:
        """Compare what a device executed with the plan, segment count and steps of every joint.

        Raises:
            LinkError: it ended early.
            StepsDifferError: it made other steps.
        """
        if self.executed != len(self.segments):
            raise LinkError(
                f"the device ended its motion after {self.executed} of {len(self.segments)} segments without a fault;"
                " host and firmware disagree: flash the released image"
            )
        planned = self.steps.planned_usteps()
        for joint, (done, meant) in enumerate(zip(self.moved_usteps(ledger), planned, strict=True), start=1):
            if done != meant:
                raise StepsDifferError(
                    f"joint {joint} moved by {done:+d} usteps by the device's ledger, the plan has {meant:+d}"
                    f" ({done - meant:+d}); home the arm before the next motion"
                )


def _check_ends(segments: Sequence[Segment]) -> None:
    ends = [index for index, segment in enumerate(segments) if is_last(segment)]
    if ends != [len(segments) - 1]:
        raise CertificateError(
            f"the plan has {len(segments)} segments and marks {ends} as the last of the motion; only the very last one"
            " may be and must be marked: plan the scene again"
        )
