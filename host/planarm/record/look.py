"""Pins and emulated arm held against the plan, after it was carried out."""

from __future__ import annotations

from planarm.analysis.step_count import Waveform, compare_steps, measure_steps, start_tick_of
from planarm.link.arm_record import ArmTrace
from planarm.link.transport import PinTrace, Transport
from planarm.plan import Findings, Plan
from planarm.record.arm_findings import SETTLE_S, ArmFindings, judge_arm
from planarm.record.outcome import Seen
from planarm.stepping.segments import SegmentPlan, expand
from planarm.streaming.moving_run import KeptTime


def judge_pins(plan: SegmentPlan, trace: PinTrace) -> Findings:
    """Count the steps from the pins' edges and hold them against the plan."""
    measured = tuple(
        measure_steps(_waveform(trace, step), _waveform(trace, direction))
        for step, direction in plan.board.joint_pins[: len(plan.start_usteps)]
    )
    planned = [(joint.ticks, joint.directions) for joint in expand(plan).steps]
    return Findings(measured, compare_steps(planned, measured))


def look_at(plan: Plan, transport: Transport, settle_s: float, kept: KeptTime | None = None) -> Seen:
    """Hold pins and emulated arm against the plan, after a while in which the board executes what it has queued.

    With `kept` the arm is held against the obstacles' own clock; after a new plan on the way the pins show more than
    the last plan, so they are not held against it.
    """
    if transport.pins is None:
        return Seen()
    if transport.arm:
        transport.arm.settle(settle_s)
    if kept and kept.replans:
        arm = judge_on_time(kept, transport.arm) if transport.arm else None
        return Seen(transport.pins, None, arm, kept.start_tick)
    findings = judge_pins(plan.segments, transport.pins)
    arm = judge_emulated_arm(plan, findings, transport.arm, kept) if transport.arm else None
    planned = [joint.ticks for joint in expand(plan.segments).steps]
    return Seen(transport.pins, findings, arm, start_tick_of(planned, [joint.ticks for joint in findings.measured]))


def judge_on_time(kept: KeptTime, trace: ArmTrace) -> ArmFindings:
    """Let the emulated arm come to rest, and hold it against the last plan and against the obstacles all along."""
    trace.settle(SETTLE_S)
    return judge_arm(kept.plan, trace.record(), kept.start_tick, (kept.scene, kept.zero_tick))


def judge_emulated_arm(plan: Plan, findings: Findings, trace: ArmTrace, kept: KeptTime | None = None) -> ArmFindings:
    """Let the emulated arm come to rest, and hold what it did against the plan."""
    trace.settle(SETTLE_S)
    planned = [joint.ticks for joint in expand(plan.segments).steps]
    start_tick = start_tick_of(planned, [joint.ticks for joint in findings.measured])
    return judge_arm(plan, trace.record(), start_tick, (kept.scene, kept.zero_tick) if kept else None)


def _waveform(trace: PinTrace, pin: str) -> Waveform:
    edges = trace.edges(pin)
    return Waveform(edges["cycle"], edges["level"])
