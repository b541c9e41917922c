"""Streaming a motion that has appointments: at the agreed time, watched, stopped before a conflict, planned again.

The obstacles' time 0 is a moment on the transport's clock, agreed before the motion starts. The ledger tells where the
arm is; when it is further behind than the plan's delay margin allows, less what a stop takes, it is stopped along its
path while its poses are still free, and a new plan leads on from where it rests, among the obstacles as they are then.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planarm.errors import NoPathError, PlanarmError
from planarm.link.clock import Clock
from planarm.link.exchange import StreamResult
from planarm.link.position import Certainty, StreamError
from planarm.link.stream import Stream, StreamProgress
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.moving import later
from planarm.model.transmission import Transmission
from planarm.plan import Plan
from planarm.routes.moving_route import rest_problem
from planarm.scene import Scene
from planarm_wire.messages import TICKS_HZ

FIRST_LEAD_S = 0.5
"""From opening the line to the agreed start: the session is opened and the queue filled meanwhile."""

REPLAN_S = 1.0
"""From a stop to the next start: planning takes a few tenths of a second, filling the queue another."""

REACTION_S = 0.03
"""From being late to slowing down: a status may be 20 ms old and the order takes a few more."""

EARLY_S = 0.001
BRAKING_PERCENT, FULL_PERCENT = 98, 100
"""How far ahead the arm may surely be before its path clock is slowed down, and to what: a resonator may be 0.5 % fast,
so two hundredths catch up; and a plan has no margin for what comes early."""

MOST_REPLANS = 20


class Timekeeper:
    """Holds the device's ledger against the plan's clock: stops the motion when it is too far behind, brakes it ahead.

    The ledger tells between which two steps the arm was, the clocks' synchronisation between which two moments that was
    so, and both together how late it is at most and how early at least. A board's clock that runs fast brings the arm
    ahead of its appointments; then its path clock is told to run a little slower, until that is no longer sure.
    """

    def __init__(self, start_at_s: float, most_late_s: float) -> None:
        self.start_at_s = start_at_s
        """When the motion is due to start."""
        self.late_s = 0.0
        self.early_s = 0.0
        """The most by which it was surely ahead."""
        self.stopping = False
        self._most_late_s = most_late_s
        self._early_now_s = 0.0
        self._percent = FULL_PERCENT

    def watch(self, told: StreamProgress) -> None:
        """Take note of a status."""
        late_s = told.made_s.most - self.start_at_s - told.path_span_s.least
        self.late_s = max(self.late_s, late_s)
        begun = told.path_span_s.least > 0.0
        self._early_now_s = -late_s if begun else 0.0
        self.early_s = max(self.early_s, self._early_now_s)

    def steer(self, stream: Stream) -> None:
        """Stop the motion along its path, once, when it is too late; slow its path clock down while it is ahead."""
        if self.late_s > self._most_late_s and not self.stopping:
            self.stopping = True
            stream.stop()
        percent = BRAKING_PERCENT if self._early_now_s > EARLY_S else FULL_PERCENT
        if percent != self._percent and not self.stopping and (percent != FULL_PERCENT or self._early_now_s <= 0.0):
            self._percent = percent
            stream.override(percent)


@dataclass(frozen=True, slots=True)
class Replan:
    """A stop on the way and what followed."""

    at_s: float
    """On the obstacles' clock."""
    late_s: float
    """How far behind the arm was, at most."""
    depart_s: float
    """When the next plan starts, on the obstacles' clock."""


@dataclass(frozen=True, slots=True, eq=False)
class KeptTime:
    """A motion that was carried out on time, or planned again until it was."""

    streamed: StreamResult
    """Of the last plan."""
    plan: Plan
    """The last one."""
    scene: Scene
    """What was asked for: the obstacles from their time 0."""
    zero_s: float
    """Their time 0 on the transport's clock."""
    late_s: float
    """How far behind the last plan was, at most."""
    early_s: float
    """How far ahead of it the arm surely was, at most."""
    replans: tuple[Replan, ...]

    @property
    def zero_tick(self) -> int:
        """The obstacles' time 0, where the transport's clock counts ticks from its own zero, as the emulator's does."""
        return round(self.zero_s * TICKS_HZ)

    @property
    def start_tick(self) -> int:
        """When the last plan was due to start."""
        departed_s = self.replans[-1].depart_s if self.replans else 0.0
        return round((self.zero_s + departed_s) * TICKS_HZ)

    def figures(self) -> dict[str, Any]:
        """Return what it took, for the summary."""
        late_s, early_s = round(self.late_s, 6), round(self.early_s, 6)
        return {"late_s": late_s, "early_s": early_s, "replans": [asdict(replan) for replan in self.replans]}


Streamer = Callable[[Plan, Timekeeper], StreamResult]


def most_late_s(plan: Plan) -> float:
    """Return how far behind the arm may be before it has to slow down: the margin, less reaction and the longest stop.

    A stop that takes path time n is over after at most 2 n, since the clock runs down from 1. Never less than the
    reaction: a ledger cannot tell less.
    """
    assert plan.moving is not None, "only motions among moving obstacles have appointments"
    longest = max((allowance.need_ticks for allowance in plan.segments.allowances), default=0.0) / TICKS_HZ
    return max(plan.moving.delay_margin_s - REACTION_S - 2.0 * longest, REACTION_S)


def stream_on_time(plan: Plan, clock: Clock, streamer: Streamer, plan_again: Callable[[Scene], Plan]) -> KeptTime:
    """Carry a plan out by its clock, and plan again where it falls behind.

    Args:
        plan: the certified plan.
        clock: the transport's.
        streamer: streams one plan, to start when its timekeeper says, watched and steered by it.
        plan_again: plans a scene from a pose; it may take REPLAN_S less a little.

    Raises:
        LinkError, DeviceFault: the line or the device failed, as ever. A StreamError after a stop whose notes say what
            touches the arm, and when, tells that no safe motion leads on.
    """
    zero_s = clock.now_s() + FIRST_LEAD_S
    first, start_s = plan.scene, zero_s
    replans: list[Replan] = []
    while True:
        keeper = Timekeeper(start_s, most_late_s(plan))
        try:
            streamed = streamer(plan, keeper)
        except StreamError as error:
            exact = error.position.certainty is Certainty.EXACT
            if not keeper.stopping or not exact or len(replans) >= MOST_REPLANS:
                raise
            now_s = clock.now_s() - zero_s
            error.add_note(f"the arm was up to {keeper.late_s:.3f} s behind its plan and was stopped along its path")
            joints = len(plan.segments.start_usteps)
            rest = np.add(plan.segments.start_usteps, error.position.moved_usteps[:joints])
            plan = _onwards(
                _from_rest(first, rest, now_s), _from_rest(first, rest, now_s + REPLAN_S), plan_again, error
            )
            replans.append(Replan(now_s, keeper.late_s, now_s + REPLAN_S))
            start_s = zero_s + now_s + REPLAN_S
        else:
            return KeptTime(streamed, plan, first, zero_s, keeper.late_s, keeper.early_s, tuple(replans))


def _onwards(resting: Scene, departing: Scene, plan_again: Callable[[Scene], Plan], stopped: StreamError) -> Plan:
    """Plan from where the arm rests; when nothing leads on, raise `stopped` with what touches the arm and when.

    Args:
        resting: the scene from now on.
        departing: the scene from the next start on.
        plan_again: the planner.
        stopped: the error that told of the stop.
    """
    try:
        touched = rest_problem(resting, REPLAN_S)
        if touched:
            raise NoPathError(f"{resting.source}: {touched}")
        return plan_again(departing)
    except PlanarmError as problem:
        horizon_s = resting.moving.horizon_s if resting.moving else 0.0
        stopped.add_note(f"no motion leads on: {problem}")
        stopped.add_note(rest_problem(resting, horizon_s) or f"nothing touches the resting arm for {horizon_s:g} s")
        raise stopped from problem


def _from_rest(scene: Scene, rest_usteps: NDArray[np.int64], at_s: float) -> Scene:
    """Return the scene as it is at a time, with the arm at rest at these micro-steps."""
    q_rad = Transmission.of(scene).q_rad(rest_usteps)
    x, y = forward(Arm.from_spec(scene.arm), q_rad)[-1]
    task = replace(scene.task, start_cm=(float(x), float(y)), start_rad=tuple(float(q) for q in q_rad))
    return later(replace(scene, task=task), at_s)
