"""Step-timing analysis as one readable function: recording + plan + driver -> what is wrong, and where on the path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planarm.analysis.capture import PS_PER_TICK, open_capture
from planarm.analysis.channels import Pins, map_channels
from planarm.analysis.step_match import Schedule
from planarm.analysis.timing import PulseLimits, TimingReport, TimingRules, analyse, recorded_schedules
from planarm.errors import CaptureError, UsageError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.transmission import Transmission
from planarm.notice import Notice
from planarm.plan_file import StoredPlan, load_plan
from planarm.scene.rebuild import scene_from_mapping
from planarm.stepping.expand import expand
from planarm.stepping.train import StepTrain
from planarm_wire.drivers import DRIVERS, DriverRow
from planarm_wire.messages import BOARDS, TICKS_HZ

Point = tuple[float, float]

RESONANT_FULL_STEPS_HZ = (80.0, 200.0)
"""Where steppers of the NEMA17 kind resonate, in full steps a second; dwelling there is told when a plan is given."""


@dataclass(frozen=True, slots=True)
class TimingRequest:
    """What to look at.

    Attributes:
        capture: the recording.
        plan: the plan it is held against, or None.
        driver: name of the driver whose rules hold for all joints; None takes the plan's, or none.
        channels: words like "step1=D9"; none takes the board's pin names.
        tolerance_us: beyond which a step is off its time.
        board: whose pins' names count; None takes the plan's, or uno's.
    """

    capture: Path
    plan: Path | None
    driver: str | None
    channels: tuple[str, ...]
    tolerance_us: float
    board: str | None = None


@dataclass(frozen=True, slots=True)
class TimingFindings:
    """The report, and where on the path the end effector was to be at each finding; None without a plan."""

    report: TimingReport
    drivers: tuple[str | None, ...]
    tips_cm: tuple[Point | None, ...]


def judge_recording(request: TimingRequest, notice: Notice) -> TimingFindings:
    """Read a recording, hold it against the plan and the drivers' rules, and place each finding on the path.

    Raises:
        CaptureError: the recording cannot be read or lacks a line, or no such driver is known.
        PlanFileError, CertificateError: the plan cannot be read.
        UsageError: the board that is named is not the plan's.
    """
    plan = load_plan(request.plan) if request.plan else None
    capture = open_capture(request.capture)
    channels = map_channels(request.capture, capture.channels, request.channels, _pins(request, plan))
    train = expand(plan.segments) if plan else None
    drivers = _drivers(request.driver, plan, channels.joints)
    rules = TimingRules(
        limits=tuple(_limits(driver) for driver in drivers),
        tolerance_us=request.tolerance_us,
        band_hz=_band_hz(plan),
    )
    report = analyse(capture, channels, _schedules(train) if train else None, rules, notice)
    places = [finding.path_s for finding in report.findings]
    tips = tips_at(plan, train, places) if plan and train else [None] * len(places)
    return TimingFindings(report, tuple(driver.name if driver else None for driver in drivers), tuple(tips))


def compare_recordings(first: Path, request: TimingRequest, notice: Notice) -> TimingFindings:
    """Hold one recording against another: the first one's steps are the schedule of the second.

    Raises:
        CaptureError: one of them cannot be read or lacks a line.
    """
    reference = open_capture(first)
    pins = _pins(request, None)
    schedules = recorded_schedules(reference, map_channels(first, reference.channels, request.channels, pins))
    capture = open_capture(request.capture)
    channels = map_channels(request.capture, capture.channels, request.channels, pins)
    drivers = _drivers(request.driver, None, channels.joints)
    rules = TimingRules(tuple(_limits(driver) for driver in drivers), request.tolerance_us)
    report = analyse(capture, channels, schedules, rules, notice)
    return TimingFindings(
        report, tuple(driver.name if driver else None for driver in drivers), (None,) * len(report.findings)
    )


def tips_at(plan: StoredPlan, train: StepTrain, times_s: Sequence[float | None]) -> list[Point | None]:
    """Return where the end effector is to be at moments of the plan."""
    scene = scene_from_mapping(plan.scene)
    known = [n for n, time in enumerate(times_s) if time is not None]
    ticks = np.array([(times_s[n] or 0.0) * TICKS_HZ for n in known])
    columns = []
    for start, joint in zip(train.start_usteps, train.steps, strict=True):
        after = np.concatenate([[0], np.cumsum(joint.directions, dtype=np.int64)])
        columns.append(start + after[np.searchsorted(joint.ticks, ticks, side="right")])
    q_rad = Transmission.of(scene).q_rad(np.stack(columns, axis=-1)) if known else np.empty((0, len(columns)))
    tips: list[Point | None] = [None] * len(times_s)
    for n, (x, y) in zip(known, forward(Arm.from_spec(scene.arm), q_rad)[:, -1].tolist(), strict=True):
        tips[n] = (x, y)
    return tips


def _pins(request: TimingRequest, plan: StoredPlan | None) -> Pins:
    """Return STEP and DIR pins of each joint: of the board that is named, or of the plan's joints."""
    if request.board is not None:
        if plan is not None and plan.segments.board.name != request.board:
            raise UsageError(
                f"--board {request.board}: {request.plan} is for the board {plan.segments.board.name}; leave --board"
                " out, or name the lines of another wiring with --map"
            )
        return BOARDS[request.board].joint_pins
    if plan is None:
        return BOARDS["uno"].joint_pins
    return plan.segments.board.joint_pins[: len(plan.segments.start_usteps)]


def _schedules(train: StepTrain) -> list[Schedule]:
    return [Schedule(PS_PER_TICK * joint.ticks, joint.directions) for joint in train.steps]


def _drivers(named: str | None, plan: StoredPlan | None, joints: int) -> tuple[DriverRow | None, ...]:
    if named is not None and named not in DRIVERS:
        raise CaptureError(f"no driver {named!r} is known; there are {', '.join(sorted(DRIVERS))}")
    if named is None and plan is not None:
        return tuple(joint.driver_row for joint in scene_from_mapping(plan.scene).joints)
    return (DRIVERS[named] if named is not None else None,) * joints


def _limits(driver: DriverRow | None) -> PulseLimits:
    if driver is None:
        return PulseLimits()
    return PulseLimits(driver.step_high_s, driver.step_low_s, driver.dir_setup_s or 0.0, driver.dir_hold_s or 0.0)


def _band_hz(plan: StoredPlan | None) -> tuple[float, float] | None:
    """Return the resonance band as rates of micro-steps: the first joint's, the others' being alike."""
    if plan is None:
        return None
    microsteps = scene_from_mapping(plan.scene).joints[0].microsteps
    low, high = RESONANT_FULL_STEPS_HZ
    return (low * microsteps, high * microsteps)
