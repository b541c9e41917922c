"""Step timing: what a recording of the STEP and DIR lines says, alone, against a plan, and against a driver's rules.

The recording is read twice: once for its extent and the board's clock, once to judge each edge. Memory is bounded by
a chunk, the plan's steps and the listed findings, whatever the recording's length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from planarm.analysis.capture import PS_PER_S, Capture
from planarm.analysis.channels import ChannelMap
from planarm.analysis.clock_fit import ClockFit, ClockFitter
from planarm.analysis.interrupt_cause import delayed_by
from planarm.analysis.joint_judge import JointJudge, Judged
from planarm.analysis.spread import Spread
from planarm.analysis.step_match import Schedule
from planarm.analysis.step_scan import (
    DIR_HOLD,
    DIR_SETUP,
    INTERRUPT,
    RULES,
    STEP_HIGH,
    STEP_LOW,
    WIDTH_BIN_PS,
    Scanned,
    ScanState,
    scan_chunk,
)
from planarm.errors import CaptureError
from planarm.notice import Notice, silent

Ints = npt.NDArray[np.int64]

MOST_FINDINGS = 1000
CURVE_BINS = 400
DEFAULT_TOLERANCE_US = 1.0

STRETCHED_SHARE = 0.05
"""With more than this share of the steps off time, the motion was held, slowed or starved: that is one finding."""


@dataclass(frozen=True, slots=True)
class PulseLimits:
    """What a driver asks of its lines, in seconds; 0 asks nothing."""

    step_high_s: float = 0.0
    step_low_s: float = 0.0
    dir_setup_s: float = 0.0
    dir_hold_s: float = 0.0

    def in_ps(self, resolution_ps: int) -> list[int]:
        """The limits, less what the recording's own resolution leaves in doubt."""
        limits = (self.step_high_s, self.step_low_s, self.dir_setup_s, self.dir_hold_s)
        doubt = resolution_ps if resolution_ps > 1 else 0
        return [max(round(limit * PS_PER_S) - doubt, 0) for limit in limits]


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is not as it should be.

    Attributes:
        kind: missing, extra, late, early, direction, stretched (the motion as a whole does not keep the plan's time),
            or the broken rule: step_high, step_low, dir_setup, dir_hold.
        joint: from 1.
        time_s: moment in the recording; where a step is missing, when it was due.
        path_s: moment of the plan, None without one.
        value_us: the error, or the measured width; None for steps that are missing, extra or turn the wrong way.
        limit_us: what it should have kept to.
        cause: what delayed the edge, where the recording tells which interrupts ran.
    """

    kind: str
    joint: int
    time_s: float
    path_s: float | None
    value_us: float | None = None
    limit_us: float | None = None
    cause: str | None = None


@dataclass(frozen=True, slots=True)
class JointTiming:
    """One joint's figures; None where nothing was there to measure, or no plan to measure against.

    Attributes:
        joint: from 1.
        steps, steps_planned: counted and scheduled.
        net_usteps: signed sum.
        missing, extra, wrong_direction, off_time: findings of each kind; off_time are steps beyond the tolerance.
        timing_error, interval_error: against the schedule on the board's own clock.
        shortest_interval_us: between two steps.
        high_min_us ... dir_hold_min_us: least widths, and the usual and the longest pulse.
        band_s: time at rates within the resonance band.
        rate_hz: signed steps a second over time, one value a bin of the recording's moving part.
    """

    joint: int
    steps: int
    steps_planned: int | None
    net_usteps: int
    missing: int
    extra: int
    wrong_direction: int
    off_time: int
    timing_error: Spread | None
    interval_error: Spread | None
    shortest_interval_us: float | None
    high_min_us: float | None
    high_p50_us: float | None
    high_max_us: float | None
    low_min_us: float | None
    dir_setup_min_us: float | None
    dir_hold_min_us: float | None
    band_s: float | None
    rate_hz: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TimingReport:
    """What `analyse` found.

    Attributes:
        source: the recording's file.
        resolution_ns: its unit of time.
        begin_s, end_s: first and last step in the recording.
        clock_ppm: how much faster (+) or slower (-) the board's clock runs than the recorder's; None without a plan.
        start_s: the recording's moment of the plan's zero; None without a plan.
        aligned: False when the steps do not follow the plan at all, so that only counts were compared.
        tolerance_us: beyond which a step is off its time.
        joints: one entry a joint.
        findings: at most MOST_FINDINGS, in order of time.
        counts: how many findings of each kind there are, unlisted ones included.
    """

    source: str
    resolution_ns: float
    begin_s: float
    end_s: float
    clock_ppm: float | None
    start_s: float | None
    aligned: bool
    tolerance_us: float
    joints: tuple[JointTiming, ...]
    findings: tuple[Finding, ...]
    counts: dict[str, int]

    @property
    def ok(self) -> bool:
        """True when nothing is wrong."""
        return self.aligned and not any(self.counts.values())

    def curve_times_s(self) -> npt.NDArray[np.float64]:
        """Middles of the bins of `rate_hz`."""
        edges = np.linspace(self.begin_s, self.end_s, CURVE_BINS + 1)
        middles: npt.NDArray[np.float64] = 0.5 * (edges[1:] + edges[:-1])
        return middles


@dataclass(frozen=True, slots=True)
class TimingRules:
    """How strictly to judge: each joint's driver, the tolerance, and the band of step rates that resonates."""

    limits: tuple[PulseLimits, ...] = ()
    tolerance_us: float = DEFAULT_TOLERANCE_US
    band_hz: tuple[float, float] | None = None


@dataclass(slots=True)
class Survey:
    """First reading: extent and clock."""

    begin_ps: int | None = None
    end_ps: int = 0
    steps: list[int] = field(default_factory=list)
    clock: ClockFit | None = None


def analyse(
    capture: Capture,
    channels: ChannelMap,
    schedules: Sequence[Schedule] | None,
    rules: TimingRules,
    notice: Notice = silent,
) -> TimingReport:
    """Judge a recording.

    Args:
        capture: the recording.
        channels: which line is which joint's.
        schedules: each joint's planned steps, or None to look at the recording alone.
        rules: driver rules and tolerance.
        notice: told the stage and the share that is done.

    Raises:
        CaptureError: the recording is damaged, has no step, or lacks a line that the plan moves.
    """
    if schedules is not None and len(schedules) != channels.joints:
        raise CaptureError(
            f"{capture.path}: the plan has {len(schedules)} joints, {channels.joints} are mapped to channels; "
            "map each joint's lines with --map"
        )
    survey = _survey(capture, channels, schedules, notice)
    if survey.begin_ps is None:
        raise CaptureError(f"{capture.path}: no STEP line rises; map the joints' lines with --map")
    return _judge(capture, channels, schedules, rules, survey, survey.begin_ps, notice)


def recorded_schedules(capture: Capture, channels: ChannelMap) -> list[Schedule]:
    """Return a recording's own steps as schedules, so that another one can be held against it.

    Raises:
        CaptureError: the recording is damaged or has no step.
    """
    state = ScanState(channels.joints)
    limits = np.zeros((channels.joints, len(RULES)), np.int64)
    parts = [scan_chunk(chunk, channels.roles, limits, state) for chunk in capture.chunks(channels.names)]
    schedules = [
        Schedule(
            np.concatenate([part.times_ps[j] for part in parts] or [np.empty(0, np.int64)]),
            np.concatenate([part.directions[j] for part in parts] or [np.empty(0, np.int8)]),
        )
        for j in range(channels.joints)
    ]
    if not any(len(schedule.times_ps) for schedule in schedules):
        raise CaptureError(f"{capture.path}: no STEP line rises; map the joints' lines with --map")
    return schedules


def _survey(capture: Capture, channels: ChannelMap, schedules: Sequence[Schedule] | None, notice: Notice) -> Survey:
    """Read the recording once for its extent, the counts, and the clock."""
    survey = Survey(steps=[0] * channels.joints)
    main, fitter = 0, None
    if schedules is not None:
        main = max(range(len(schedules)), key=lambda j: len(schedules[j].times_ps))
        if len(schedules[main].times_ps):
            fitter = ClockFitter(schedules[main])
    state = ScanState(channels.joints)
    limits = np.zeros((channels.joints, len(RULES)), np.int64)
    notice("read", 0.0)
    for chunk in capture.chunks(channels.names):
        scanned = scan_chunk(chunk, channels.roles, limits, state)
        for joint, times in enumerate(scanned.times_ps):
            survey.steps[joint] += len(times)
            if len(times):
                first = int(times[0])
                survey.begin_ps = first if survey.begin_ps is None else min(survey.begin_ps, first)
                survey.end_ps = max(survey.end_ps, int(times[-1]))
        if fitter is not None:
            fitter.add(scanned.times_ps[main])
    notice("read", 1.0)
    if schedules is not None:
        survey.clock = fitter.fit() if fitter else ClockFit(0.0, 1.0, aligned=sum(survey.steps) == 0)
    return survey


def _judge(
    capture: Capture,
    channels: ChannelMap,
    schedules: Sequence[Schedule] | None,
    rules: TimingRules,
    survey: Survey,
    begin_ps: int,
    notice: Notice,
) -> TimingReport:
    """Read the recording a second time and judge every edge."""
    edges_ps = np.linspace(begin_ps, max(survey.end_ps, begin_ps + 1), CURVE_BINS + 1)
    clock = survey.clock
    judges = [
        JointJudge(j, schedules[j] if schedules and clock and clock.aligned else None, clock, edges_ps, rules.band_hz)
        for j in range(channels.joints)
    ]
    state = ScanState(channels.joints)
    limits = np.array([limit.in_ps(capture.resolution_ps) for limit in _limits(rules, channels.joints)], np.int64)
    book = _Book(clock)
    interrupts = np.empty(0, INTERRUPT)
    notice("judge", 0.0)
    for chunk in capture.chunks(channels.names):
        scanned = scan_chunk(chunk, channels.roles, limits, state)
        interrupts = np.concatenate([interrupts[-64:], scanned.interrupts])  # a late edge may look back a little
        book.violations(scanned, limits + (capture.resolution_ps if capture.resolution_ps > 1 else 0))
        for judge, times, directions in zip(judges, scanned.times_ps, scanned.directions, strict=True):
            book.steps(judge, judge.take(times, directions), rules.tolerance_us, interrupts)
        notice("judge", min(0.99, float(chunk.times_ps[-1] - begin_ps) / max(survey.end_ps - begin_ps, 1)))
    for judge in judges:
        book.missing(judge, judge.rest())
    book.settle(sum(survey.steps))
    notice("judge", 1.0)
    aligned = clock is None or clock.aligned
    return TimingReport(
        source=str(capture.path),
        resolution_ns=capture.resolution_ps / 1000,
        begin_s=begin_ps / PS_PER_S,
        end_s=survey.end_ps / PS_PER_S,
        clock_ppm=1e6 * (1.0 / clock.scale - 1.0) if clock and aligned else None,
        start_s=clock.start_ps / PS_PER_S if clock and aligned else None,
        aligned=aligned,
        tolerance_us=rules.tolerance_us,
        joints=tuple(
            _joint_timing(judge, state, len(schedules[j].times_ps) if schedules else None, book)
            for j, judge in enumerate(judges)
        ),
        findings=tuple(sorted(book.findings, key=lambda f: f.time_s)),
        counts=book.totals(),
    )


def _limits(rules: TimingRules, joints: int) -> tuple[PulseLimits, ...]:
    return rules.limits or (PulseLimits(),) * joints


def _joint_timing(judge: JointJudge, state: ScanState, planned: int | None, book: _Book) -> JointTiming:
    j = judge.joint

    def least_us(rule: int) -> float | None:
        width = state.least_ps(j, rule)
        return None if width is None else width / 1e6

    longest = state.longest_high_ps(j)
    bins = state.high_bins[j]
    usual = int(np.searchsorted(np.cumsum(bins), np.ceil(0.5 * bins.sum()))) if bins.any() else None
    return JointTiming(
        joint=j + 1,
        steps=judge.steps,
        steps_planned=planned,
        net_usteps=judge.net_usteps,
        missing=book.count("missing", j),
        extra=book.count("extra", j),
        wrong_direction=book.count("direction", j),
        off_time=book.count("late", j) + book.count("early", j),
        timing_error=judge.timing.spread(),
        interval_error=judge.intervals.spread(),
        shortest_interval_us=judge.shortest_interval_us,
        high_min_us=least_us(STEP_HIGH),
        high_p50_us=None if usual is None else usual * WIDTH_BIN_PS / 1e6,
        high_max_us=None if longest is None else longest / 1e6,
        low_min_us=least_us(STEP_LOW),
        dir_setup_min_us=least_us(DIR_SETUP),
        dir_hold_min_us=least_us(DIR_HOLD),
        band_s=judge.band_s,
        rate_hz=tuple(judge.rate_hz().tolist()),
    )


class _Book:
    """Keeps the findings, the first of each kind and joint whole, all of them as counts."""

    def __init__(self, clock: ClockFit | None) -> None:
        self.clock = clock if clock and clock.aligned else None
        self.findings: list[Finding] = []
        self._counts: dict[tuple[str, int], int] = {}

    def count(self, kind: str, joint: int) -> int:
        return self._counts.get((kind, joint), 0)

    def totals(self) -> dict[str, int]:
        totals: dict[str, int] = {}
        for (kind, _), count in self._counts.items():
            totals[kind] = totals.get(kind, 0) + count
        return totals

    def violations(self, scanned: Scanned, limits_ps: Ints) -> None:
        """Write down broken driver rules."""
        for row in scanned.violations:
            rule, joint = int(row["rule"]), int(row["joint"])
            self._add(RULES[rule], joint, row["time_ps"], row["measured_ps"] / 1e6, limits_ps[joint, rule] / 1e6)

    def steps(self, judge: JointJudge, judged: Judged, tolerance_us: float, interrupts: npt.NDArray[np.void]) -> None:
        """Write down what is wrong with some steps."""
        if self.clock is None:
            return
        for time_ps in judged.extra_ps.tolist():
            self._add("extra", judge.joint, time_ps)
        for time_ps in judged.wrong_direction_ps.tolist():
            self._add("direction", judge.joint, time_ps)
        self.missing(judge, judged.missing)
        off = np.flatnonzero(np.abs(judged.errors_ps) > 1e6 * tolerance_us)
        for k in off.tolist():
            error_ps = float(judged.errors_ps[k])
            time_ps = int(judged.times_ps[k])
            cause = delayed_by(interrupts, time_ps - error_ps, time_ps) if error_ps > 0 else None
            self._add("late" if error_ps > 0 else "early", judge.joint, time_ps, error_ps / 1e6, tolerance_us, cause)

    def missing(self, judge: JointJudge, planned: Ints) -> None:
        """Write down scheduled steps that did not come."""
        if self.clock is None or judge.schedule is None:
            return
        for due_ps in judge.schedule.times_ps[planned].tolist():
            self._add("missing", judge.joint, round(self.clock.start_ps + self.clock.scale * due_ps))

    def settle(self, steps: int) -> None:
        """Say once that the motion as a whole does not keep time, where that is so."""
        off = [key for key in self._counts if key[0] in ("late", "early")]
        if sum(self._counts[key] for key in off) <= STRETCHED_SHARE * steps:
            return
        first = min((f for f in self.findings if f.kind in ("late", "early")), key=lambda f: f.time_s)
        for key in off:
            del self._counts[key]
        self.findings = [f for f in self.findings if f.kind not in ("late", "early")]
        self.findings.append(replace(first, kind="stretched", cause=None))
        self._counts["stretched", first.joint - 1] = 1

    def _add(
        self,
        kind: str,
        joint: int,
        time_ps: int,
        value_us: float | None = None,
        limit_us: float | None = None,
        cause: str | None = None,
    ) -> None:
        self._counts[kind, joint] = self._counts.get((kind, joint), 0) + 1
        if len(self.findings) < MOST_FINDINGS:
            path_s = self.clock.planned_ps(float(time_ps)) / PS_PER_S if self.clock else None
            value = None if value_us is None else float(value_us)
            limit = None if limit_us is None else float(limit_us)
            self.findings.append(Finding(kind, joint + 1, int(time_ps) / PS_PER_S, path_s, value, limit, cause))
