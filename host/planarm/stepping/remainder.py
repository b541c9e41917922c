"""What is left of a motion after a rest on the path: the same steps, the first of them slower.

The arm stands still somewhere on the path, where the plan has it at speed. So the path clock begins at a rate u0 at
which every motor is at most at its start-stop speed, and speeds up by half of what the segments allow until it runs as
planned:

    du/dt = fast / 2,  that is  d(u^2)/dtau = fast  over the planned time tau,  t = integral of dtau / u.

From the next segment border on the plan's own segments follow, unchanged. In a segment where the clock speeds up so the
device may speed it up by the other half, and slow it down by as much as in the plan: d(uv)/dt = v^2 du/dt + u dv/dt.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planarm.errors import CertificateError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.transmission import Transmission, motor_axes
from planarm.scene import JointSpec, Scene
from planarm.stepping.certificate import Certificate, at_most
from planarm.stepping.check_board import check_board
from planarm.stepping.check_space import check_space
from planarm.stepping.check_steps import check_gaps
from planarm.stepping.check_wire import check_pulses, check_wire
from planarm.stepping.expand import expand
from planarm.stepping.plan import Allowance, SegmentPlan
from planarm.stepping.poses import motor_positions
from planarm.stepping.segments import Coding, compress
from planarm.stepping.table import table_of
from planarm.stepping.train import Floats, JointSteps, StepTrain, Ticks
from planarm_wire.messages import TICKS_HZ

LEAD_TICKS = 4000
"""Before the first step, for DIR's setup time."""
OUT_OF_STEP_TICKS = 200_000
"""Joints that stopped at different moments of the path, 12.5 ms apart, did not stop by any rule of the device."""


@dataclass(frozen=True, slots=True, eq=False)
class Ramp:
    """The path clock from a rest until it runs as planned.

    Attributes:
        tau_ticks: planned times at which the rule changes, ascending; the last is a segment's end.
        squared: u^2 at each.
        growth: change of u^2 per tick after each.
        t_ticks: the time at each.
        border: the first segment that is executed as planned.
    """

    tau_ticks: Floats
    squared: Floats
    growth: Floats
    t_ticks: Floats
    border: int

    def time_of(self, tau_ticks: Floats) -> Floats:
        """Return when planned moments come, in ticks from the start."""
        k = np.clip(np.searchsorted(self.tau_ticks, tau_ticks, side="right") - 1, 0, len(self.tau_ticks) - 2)
        return np.asarray(self.t_ticks[k] + _time(self.squared[k], self.growth[k], tau_ticks - self.tau_ticks[k]))


def remainder(plan: SegmentPlan, made: Sequence[int], axes: Sequence[JointSpec]) -> SegmentPlan:
    """Return the motion that makes the steps of `plan` that are left, from a rest.

    Args:
        plan: the whole motion, with its allowances.
        made: how many of its steps each joint has made.
        axes: the motors' own axes.

    Raises:
        CertificateError: the joints do not stand at one place of the path, or the plan has no allowances.
        TimingError: the steps cannot be coded.
    """
    if len(plan.allowances) != len(plan.segments):
        raise CertificateError("the plan does not tell how its path clock may change; plan the scene again")
    whole, coding = expand(plan), Coding.of(axes)
    begin = _begin_ticks(whole, made)
    starts = np.concatenate([[0], np.cumsum([segment.duration_flags >> 1 for segment in plan.segments])])
    ramp = _ramp(plan.allowances, starts, begin, _first_rate(whole, made, coding))
    end = int(starts[ramp.border])
    slowed = _slowed(whole, made, ramp, end)
    first = compress(slowed, coding, _latest(whole, slowed.duration_ticks, end))
    following = plan.segments[ramp.border :]
    segments = first.segments
    if following:
        segments = (*segments[:-1], replace(segments[-1], duration_flags=segments[-1].duration_flags & ~1))
    return SegmentPlan(
        segments=(*segments, *following),
        duration_ticks=first.duration_ticks + int(starts[-1] - starts[ramp.border]),
        start_usteps=slowed.start_usteps,
        allowances=(*_allowances(first, plan.allowances, starts, ramp), *plan.allowances[ramp.border :]),
        wiring=plan.wiring,
    )


def steps_left(plan: SegmentPlan, made: Sequence[int]) -> StepTrain:
    """Return the steps that a motion still has to make, on the plan's ticks."""
    whole = expand(plan)
    return StepTrain(
        _standing(whole, made),
        tuple(JointSteps(j.ticks[m:], j.directions[m:]) for j, m in zip(whole.steps, made, strict=True)),
        whole.duration_ticks,
        whole.wiring,
    )


def _standing(whole: StepTrain, made: Sequence[int]) -> tuple[int, ...]:
    joints = zip(whole.start_usteps, whole.steps, made, strict=True)
    return tuple(start + int(steps.directions[:m].sum(dtype=np.int64)) for start, steps, m in joints)


def _begin_ticks(whole: StepTrain, made: Sequence[int]) -> float:
    """Return the planned moment at which the arm stands: after the last step made, before the first that is not."""
    last = max((int(j.ticks[m - 1]) for j, m in zip(whole.steps, made, strict=True) if m), default=0)
    coming = [int(j.ticks[m]) for j, m in zip(whole.steps, made, strict=True) if m < len(j.ticks)]
    following = min(coming, default=whole.duration_ticks)
    if last - following > OUT_OF_STEP_TICKS:
        raise CertificateError(
            f"the joints do not stand at one place of the path: a step planned at {last / TICKS_HZ:.6f} s was made,"
            f" one at {following / TICKS_HZ:.6f} s was not; move the arm to the plan's start and run it anew"
        )
    return float(min(last, following))


def _first_rate(whole: StepTrain, made: Sequence[int], coding: Coding) -> float:
    """Return the rate of the path clock at which no motor is above its start-stop speed just here."""
    rate = 1.0
    for steps, count, limit in zip(whole.steps, made, coding.start_stop_ticks, strict=True):
        near = np.diff(steps.ticks[max(count - 1, 0) : count + 2])
        if len(near):
            rate = min(rate, float(near.min()) / limit)
    return rate


def _ramp(allowances: Sequence[Allowance], starts: Ticks, begin: float, rate: float) -> Ramp:
    """Follow the rule from `begin` to the end of the segment in which the clock comes to run as planned."""
    k = max(int(np.searchsorted(starts, begin, side="right")) - 1, 0)
    k = min(k, len(allowances) - 1)
    tau, squared, growth, t = [begin], [rate * rate], [0.0], [0.0]

    def go(to: float, change: float) -> None:
        growth[-1] = change
        t.append(t[-1] + float(_time(np.array(squared[-1]), np.array(change), np.array(to - tau[-1]))))
        squared.append(min(1.0, squared[-1] + change * (to - tau[-1])))
        tau.append(to)
        growth.append(0.0)

    while k < len(allowances):
        change = allowances[k].fast_per_s / TICKS_HZ
        full = tau[-1] + (1.0 - squared[-1]) / change if change > 0.0 else np.inf
        if squared[-1] < 1.0 and full < starts[k + 1]:
            go(full, change)
            squared[-1] = 1.0
        go(float(starts[k + 1]), change if squared[-1] < 1.0 else 0.0)
        k += 1
        if squared[-1] >= 1.0:
            break
    return Ramp(np.array(tau), np.array(squared), np.array(growth), np.array(t), k)


def _time(squared: Floats, growth: Floats, tau_ticks: Floats) -> Floats:
    """Return the integral of dtau / u over `tau_ticks`, where u^2 begins at `squared` and grows evenly."""
    u0 = np.sqrt(squared)
    u1 = np.sqrt(np.maximum(squared + growth * tau_ticks, 0.0))
    return np.asarray(2.0 * tau_ticks / (u0 + u1))  # (u1 - u0) / (growth / 2), without its 0 / 0


def _slowed(whole: StepTrain, made: Sequence[int], ramp: Ramp, end: int) -> StepTrain:
    """Return the steps up to the ramp's end, on their new ticks."""
    steps = []
    for joint, count in zip(whole.steps, made, strict=True):
        until = int(np.searchsorted(joint.ticks, end))
        planned = np.maximum(joint.ticks[count:until].astype(np.float64), ramp.tau_ticks[0])
        ticks = LEAD_TICKS + np.floor(ramp.time_of(planned)).astype(np.int64)
        steps.append(JointSteps(ticks, joint.directions[count:until]))
    duration = LEAD_TICKS + int(np.ceil(ramp.t_ticks[-1])) + 1
    return StepTrain(_standing(whole, made), tuple(steps), duration, whole.wiring)


def _latest(whole: StepTrain, duration_ticks: int, end: int) -> tuple[int, ...]:
    """Return how late each joint's last step before the ramp's end may be: no nearer to what follows than planned.

    What follows is coded already, and its first step may be as early as its tolerance allows.
    """
    latest = []
    for joint in whole.steps:
        until = int(np.searchsorted(joint.ticks, end))
        last = int(joint.ticks[until - 1]) if until else end
        latest.append(duration_ticks - (end - last))
    return tuple(latest)


def _allowances(first: SegmentPlan, planned: Sequence[Allowance], starts: Ticks, ramp: Ramp) -> list[Allowance]:
    """Return the allowances of the ramp's segments: of all planned segments that each has a part of, the least."""
    opening = int(np.searchsorted(starts, ramp.tau_ticks[0], side="right")) - 1
    borders = LEAD_TICKS + ramp.time_of(starts[opening + 1 : ramp.border + 1].astype(np.float64))
    told, at = [], 0
    for segment in first.segments:
        end = at + (segment.duration_flags >> 1)
        low = opening + int(np.searchsorted(borders, at, side="right"))
        high = opening + int(np.searchsorted(borders, end, side="left"))
        part = planned[min(low, len(planned) - 1) : min(high, len(planned) - 1) + 1] or planned[-1:]
        told.append(
            Allowance(
                min(one.slow_per_s for one in part),
                0.5 * min(one.fast_per_s for one in part),
                max(one.need_ticks for one in part),
            )
        )
        at = end
    return told


def certify_remainder(scene: Scene, left: StepTrain, plan: SegmentPlan) -> Certificate:
    """Return every check of a remainder that needs no planned motion: the wire, the board, the steps, the arm in space.

    Args:
        scene: of the whole plan.
        left: the steps that were to be made still.
        plan: the segments that are to make them.
    """
    axes = motor_axes(scene.joints, scene.coupling)
    made = expand(plan)
    table, at = table_of(plan), motor_positions(made)
    checks = [*check_wire(plan, table, scene.board), *check_pulses(scene, made), *check_board(table, made, scene.link)]
    for number, (steps, wanted) in enumerate(zip(made.steps, left.steps, strict=True), start=1):
        differ = 0 if np.array_equal(steps.directions, wanted.directions) else len(wanted.directions)
        checks.append(at_most(f"joint {number} steps that differ from the plan", differ, 0, "steps"))
        checks += check_gaps(made, axes, number)
    standing_cm = forward(Arm.from_spec(scene.arm), Transmission.of(scene).q_rad(np.array(plan.start_usteps)))[-1]
    here = replace(scene, task=replace(scene.task, start_cm=(float(standing_cm[0]), float(standing_cm[1]))))
    return Certificate((*checks, *check_space(here, made, at)))
