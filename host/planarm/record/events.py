"""A run's events on one time axis, in seconds since the plan's zero."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Literal, NamedTuple

from planarm.link.arm_record import BrokenRule, LostSteps
from planarm.record.arm_findings import ArmFindings
from planarm.record.outcome import Outcome
from planarm_wire.messages import TICKS_HZ

Lane = Literal["device", "line", "arm", "injected"]
Severity = Literal["info", "warn", "bad"]

MOST_OF_A_KIND = 200
"""More events of one kind are counted, not listed."""
FAULT_LINE = re.compile(r"(\d+\.\d+) s: (.*)")


class Event(NamedTuple):
    """Something that happened at one moment; `until_s` when it lasted."""

    t_s: float
    lane: Lane
    severity: Severity
    text: str
    until_s: float | None = None


def events_of(outcome: Outcome) -> list[dict[str, Any]]:
    """Return every event of a run in order of time; none that cannot be placed in time."""
    start_s = outcome.start_s
    found = [*_ends(outcome)]
    if start_s is not None:
        found += [*_states(outcome, start_s), *_resent(outcome, start_s)]
        if outcome.seen.arm is not None:
            found += [*_injected(outcome.seen.arm, start_s), *_arm(outcome.seen.arm, outcome.seen.start_tick)]
    found.sort(key=lambda event: event.t_s)
    return [_plain(event) for event in found]


def _plain(event: Event) -> dict[str, Any]:
    until = {} if event.until_s is None else {"until_s": round(event.until_s, 6)}
    return {
        "t_s": round(event.t_s, 6),
        "lane": event.lane,
        "severity": event.severity,
        "text": event.text,
        **until,
    }


def _ends(outcome: Outcome) -> Iterator[Event]:
    """Yield how the run ended, when it ended badly."""
    if outcome.error is None:
        return
    start_s, samples = outcome.start_s, outcome.samples
    at_s = samples[-1].at_s - start_s if samples and start_s is not None else 0.0
    yield Event(at_s, "line", "bad", f"{outcome.error['kind']}: {outcome.error['message']}")


def _states(outcome: Outcome, start_s: float) -> Iterator[Event]:
    """Yield what the device was doing, from each change of its state to the next."""
    changes = [
        sample for n, sample in enumerate(outcome.samples) if n == 0 or sample.state != outcome.samples[n - 1].state
    ]
    if not changes:
        return
    ends = [*(later.at_s for _, later in pairwise(changes)), outcome.samples[-1].at_s]
    for sample, end_s in zip(changes, ends, strict=True):
        severity: Severity = "bad" if sample.state == "fault" else "warn"
        if sample.state in ("running", "ready", "idle"):
            severity = "info"
        yield Event(sample.at_s - start_s, "device", severity, sample.state, end_s - start_s)


def _resent(outcome: Outcome, start_s: float) -> Iterator[Event]:
    """Yield what was sent again, no more than MOST_OF_A_KIND."""
    for again in outcome.resent[:MOST_OF_A_KIND]:
        what = "1 frame" if again.frames == 1 else f"{again.frames} frames"
        why = "no answer came in time" if again.unanswered else "the device missed one"
        yield Event(again.at_s - start_s, "line", "warn", f"{what} sent again: {why}")


def _injected(arm: ArmFindings, start_s: float) -> Iterator[Event]:
    """Yield what a schedule of faults did."""
    for line in arm.record.faults:
        told = FAULT_LINE.fullmatch(line)
        if told:
            yield Event(float(told[1]) - start_s, "injected", "warn", told[2])


def _arm(arm: ArmFindings, start_tick: int) -> Iterator[Event]:
    """Yield the arm's losses, broken rules and touches, no more than MOST_OF_A_KIND of each."""
    record, counts = arm.record, Counter[str]()
    happened = [(loss.ticks, "loss", _loss_words(loss)) for loss in record.lost]
    happened += [(broken.ticks, "rule", _rule_words(broken)) for broken in record.broken_rules]
    happened += [(touch.ticks, "touch", words) for touch, words in zip(record.touches, arm.touches, strict=True)]
    for ticks, kind, text in sorted(happened):
        counts[kind] += 1
        if counts[kind] <= MOST_OF_A_KIND:
            yield Event((ticks - start_tick) / TICKS_HZ, "arm", "bad", text)


def _loss_words(loss: LostSteps) -> str:
    return f"joint {loss.motor} slipped by {loss.full_steps:+d} full steps"


def _rule_words(broken: BrokenRule) -> str:
    return f"joint {broken.motor}: {broken.rule} {broken.measured_us:.4g} us, {broken.limit_us:.4g} us are needed"
