"""What is left of a run when it has ended, well or not: the stages' values, and what was seen while it streamed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from planarm_wire.messages import TICKS_HZ
from planarm_wire.steps import duration_ticks

if TYPE_CHECKING:
    from planarm.link.arq import Resent
    from planarm.link.stream import StreamProgress
    from planarm.link.transport import PinTrace
    from planarm.plan import Findings, Plan
    from planarm.record.arm_findings import ArmFindings


@dataclass(frozen=True, slots=True)
class StreamSample:
    """What the device told at one moment.

    Attributes:
        at_s: the moment on the transport's clock, by the clocks' synchronisation: not later.
        path_s: path time by then, not earlier.
        executed_segments: their number.
        queued_segments: segments sent and not yet executed.
        state: what the device was doing, in the protocol's word.
    """

    at_s: float
    path_s: float
    executed_segments: int
    queued_segments: int
    state: str


class StreamLog:
    """Keeps what the device tells while a plan is streamed."""

    def __init__(self) -> None:
        self.samples: list[StreamSample] = []
        self.resent: tuple[Resent, ...] = ()

    def note(self, told: StreamProgress) -> None:
        """Keep one progress message; one that only tells what was sent again is no new sample."""
        at_s, path_s = told.made_s.most, told.path_span_s.least
        if len(told.resent) == len(self.resent) or not self.samples or self.samples[-1].at_s != at_s:
            self.samples.append(
                StreamSample(at_s, path_s, told.executed_segments, told.queued_segments, told.state.name.lower())
            )
        self.resent = told.resent


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What was seen of a run from outside the board.

    Attributes:
        pins: the pins; None when they cannot be seen, as on a real board.
        findings: what they showed.
        arm: what the emulated arm did; None when there is none.
        start_tick: tick of the plan's zero on the board, by the first step at the pins; 0 when there is none.
    """

    pins: PinTrace | None = None
    findings: Findings | None = None
    arm: ArmFindings | None = None
    start_tick: int = 0

    def notes(self) -> list[str]:
        """Say what became of the emulated arm, for an error of the stream."""
        return [*self.arm.record.faults, f"the emulated arm: {self.arm.explain()}"] if self.arm else []


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """A run.

    Attributes:
        plan: what was planned.
        summary: its figures.
        samples: what the device told while it was streamed.
        seen: what pins and arm showed.
        error: why the run ended early, as the command line tells it; None when it did not.
        resent: what was sent again, on the transport's clock.
    """

    plan: Plan
    summary: Mapping[str, Any]
    samples: tuple[StreamSample, ...] = ()
    seen: Seen = Seen()
    error: Mapping[str, Any] | None = None
    resent: tuple[Resent, ...] = ()

    @property
    def start_s(self) -> float | None:
        """The time of the plan's zero on the transport's clock; None when nothing was executed.

        An emulator's clock is the board's. On a real port the zero is bounded by every status: it was made not later
        than a moment and not earlier on the path than a place, so the earliest is nearest.
        """
        if self.seen.start_tick:
            return self.seen.start_tick / TICKS_HZ
        return min((sample.at_s - sample.path_s for sample in self.samples if sample.executed_segments), default=None)

    def buffered_s(self) -> list[float]:
        """Return, for each sample, the path time of what the device had in its queue."""
        ends = (0, *accumulate(duration_ticks(segment) for segment in self.plan.segments.segments))
        last = len(ends) - 1
        return [
            (ends[min(s.executed_segments + s.queued_segments, last)] - ends[min(s.executed_segments, last)]) / TICKS_HZ
            for s in self.samples
        ]
