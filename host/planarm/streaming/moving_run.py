"""Streaming a motion that has appointments: at the agreed time, watched, stopped before a conflict, planned again.

The obstacles' time 0 is a moment on the transport's clock, agreed before the motion starts. The ledger tells where the
arm is; when it is further behind than the plan's delay margin allows, less what a stop takes, it is stopped along its
path while its poses are still free, and a new plan leads on from where it rests, among the obstacles as they are then.
A start that is missed, because planning or filling the queue took longer, is put off the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from planarm.errors import NoPathError, PlanarmError
from planarm.link.clock import Clock
from planarm.link.exchange import StreamResult
from planarm.link.position import Certainty, MissedStartError, StreamError
from planarm.link.session import SessionLimits
from planarm.link.stream import Stream, StreamProgress
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.moving import later
from planarm.model.transmission import Transmission
from planarm.plan import Plan
from planarm.routes.moving_route import rest_touch
from planarm.scene import Scene
from planarm_wire.messages import TICKS_HZ
from planarm_wire.steps import duration_ticks

FIRST_LEAD_S = 0.5
"""From opening the line to the agreed start: the session is opened and the queue filled meanwhile."""

REPLAN_S = 1.0
"""From a stop to the next start: planning takes a few tenths of a second, filling the queue another."""

LONGER = 2.0
"""After a start that was missed the next is put off by this many times what was missing."""

REACTION_S = 0.03
"""From being late to slowing down: a status may be 20 ms old and the order takes a few more. Never less than the line's
round trip: half of it makes a status old, and the order takes the other half."""

SILENT_S = 0.1
"""A running device tells its status twice as often; after this long it is asked for no more, it is silent."""

POSES_TO_LOOK_AT = 32

EARLY_S = 0.001
BRAKING_PERCENT, FULL_PERCENT = 98, 100
"""How far ahead the arm may surely be before its path clock is slowed down, and to what: a resonator may be 0.5 % fast,
so two hundredths catch up; and a plan has no margin for what comes early."""

MOST_REPLANS = 20


class Timekeeper:
    """Holds the device's ledger against the plan's clock: stops the motion when it is too far behind, brakes it ahead.

    The ledger tells between which two steps the arm was, the clocks' synchronisation between which two moments that was
    so, and both together how late it is at most and how early at least. While nothing is heard the arm may stand still.
    A board's clock that runs fast brings the arm ahead of its appointments; then its path clock is told to run a little
    slower, until that is no longer sure.
    """

    def __init__(self, clock: Clock, start_at_s: float, room: Room) -> None:
        self.start_at_s = start_at_s
        """When the motion is due to start."""
        self.limits = SessionLimits(silence_s=SessionLimits().silence_s + max(0.0, room.margin_s))
        """A line that is silent for the delay margin has broken no appointment yet."""
        self.late_s = 0.0
        """How late the arm was, at most, by what it told."""
        self.early_s = 0.0
        """The most by which it was surely ahead."""
        self.stopping = False
        self._clock = clock
        self._room = room
        self._told: StreamProgress | None = None
        self._early_now_s = 0.0
        self._percent = FULL_PERCENT

    def watch(self, told: StreamProgress) -> None:
        """Take note of a status."""
        self._told = told
        late_s = told.made_s.most - self.start_at_s - told.path_span_s.least
        self.late_s = max(self.late_s, late_s)
        begun = told.path_span_s.least > 0.0
        self._early_now_s = -late_s if begun else 0.0
        self.early_s = max(self.early_s, self._early_now_s)

    def steer(self, stream: Stream) -> None:
        """Stop the motion along its path, once, when it is too late or, unheard of, may be; brake it while ahead."""
        if self._told is None or self.stopping:
            return
        late_s = max(self.late_s, self._unheard_s(self._told))
        if late_s > self._room.most_late_s(stream.round_trip_s):
            self.stopping, self.late_s = True, late_s
            stream.stop()
            return
        percent = BRAKING_PERCENT if self._early_now_s > EARLY_S else FULL_PERCENT
        if percent != self._percent and (percent != FULL_PERCENT or self._early_now_s <= 0.0):
            self._percent = percent
            stream.override(percent)

    def _unheard_s(self, told: StreamProgress) -> float:
        """How late the arm is if it has stood still since it was last heard of; 0 while that was just now."""
        now_s = self._clock.now_s()
        return now_s - self.start_at_s - told.path_span_s.least if now_s - told.made_s.most > SILENT_S else 0.0


@dataclass(frozen=True, slots=True)
class Room:
    """How far behind its plan an arm may be."""

    margin_s: float
    """The plan's delay margin."""
    stop_s: float
    """The longest stop. One that takes path time n is over after at most 2 n, since the clock runs down from 1."""

    @classmethod
    def of(cls, plan: Plan) -> Room:
        """Return a plan's."""
        assert plan.moving is not None, "only motions among moving obstacles have appointments"
        longest = max((allowance.need_ticks for allowance in plan.segments.allowances), default=0.0) / TICKS_HZ
        return cls(plan.moving.delay_margin_s, 2.0 * longest)

    def most_late_s(self, round_trip_s: float = 0.0) -> float:
        """Return how late the arm may be told to be before it has to slow down: the margin, less reaction and stop.

        Never less than REACTION_S: a ledger cannot tell less.
        """
        return max(self.margin_s - max(REACTION_S, round_trip_s) - self.stop_s, REACTION_S)


@dataclass(frozen=True, slots=True)
class Replan:
    """A stop on the way and what followed."""

    at_s: float
    """On the obstacles' clock."""
    late_s: float
    """How far behind the arm was, at most."""
    depart_s: float
    """When the next plan starts, on the obstacles' clock."""
    why: Literal["late", "missed start"] = "late"


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


def stream_on_time(plan: Plan, clock: Clock, streamer: Streamer, plan_again: Callable[[Scene], Plan]) -> KeptTime:
    """Carry a plan out by its clock, and plan again where it falls behind or misses its start.

    Args:
        plan: the certified plan.
        clock: the transport's.
        streamer: streams one plan, to start when its timekeeper says, watched and steered by it.
        plan_again: plans a scene from a pose.

    Raises:
        LinkError, DeviceFault: the line or the device failed, as ever. Notes on a StreamError say what touches the arm
            where it rests, and when; after a stop they tell that no safe motion leads on.
    """
    zero_s = clock.now_s() + FIRST_LEAD_S
    first, start_s, lead_s = plan.scene, zero_s, REPLAN_S
    replans: list[Replan] = []
    while True:
        keeper = Timekeeper(clock, start_s, Room.of(plan))
        try:
            streamed = streamer(plan, keeper)
        except StreamError as error:
            now_s, missed = clock.now_s() - zero_s, error.__cause__
            if isinstance(missed, MissedStartError):
                lead_s += LONGER * missed.by_s
            elif not keeper.stopping:
                _tell_touch(error, first, plan, now_s)
                raise
            if error.position.certainty is not Certainty.EXACT or len(replans) >= MOST_REPLANS:
                _tell_touch(error, first, plan, now_s)
                raise
            if keeper.stopping:
                error.add_note(
                    f"the arm was up to {keeper.late_s:.3f} s behind its plan, which stays free for "
                    f"{plan.moving.delay_margin_s if plan.moving else 0.0:.3f} s, and was stopped along its path"
                )
            rest_rad = _rest_rad(plan, error)
            resting, departing = (_at_rest(first, rest_rad, at_s) for at_s in (now_s, now_s + lead_s))
            plan = _onwards(resting, departing, (now_s, lead_s), plan_again, error)
            why: Literal["late", "missed start"] = "late" if keeper.stopping else "missed start"
            replans.append(Replan(now_s, keeper.late_s, now_s + lead_s, why))
            start_s = zero_s + now_s + lead_s
        else:
            return KeptTime(streamed, plan, first, zero_s, keeper.late_s, keeper.early_s, tuple(replans))


def _onwards(
    resting: Scene,
    departing: Scene,
    now_and_lead_s: tuple[float, float],
    plan_again: Callable[[Scene], Plan],
    stopped: StreamError,
) -> Plan:
    """Plan from where the arm rests; when nothing leads on, raise `stopped` with what touches the arm and when.

    Args:
        resting: the scene from now on.
        departing: the scene from the next start on.
        now_and_lead_s: now, on the obstacles' clock, and how long until then.
        plan_again: the planner.
        stopped: the error that told of the stop.
    """
    now_s, lead_s = now_and_lead_s
    try:
        touch = rest_touch(resting, lead_s)
        if touch is not None:
            raise NoPathError(f"{resting.source}: {touch.words()}, before a new motion can begin")
        return plan_again(departing)
    except PlanarmError as problem:
        stopped.add_note(f"no motion leads on: {problem}")
        stopped.add_note(_touch_words([resting], now_s))
        raise stopped from problem


def _tell_touch(error: StreamError, first: Scene, plan: Plan, now_s: float) -> None:
    """Note what touches the arm where it rests, or may rest, after a line that failed; nothing when it is lost."""
    position = error.position
    if position.certainty is Certainty.EXACT:
        error.add_note(_touch_words([_at_rest(first, _rest_rad(plan, error), now_s)], now_s))
    elif position.certainty is Certainty.BOUNDED:
        ends_s = np.append(0.0, np.cumsum([duration_ticks(s) for s in plan.segments.segments])) / TICKS_HZ
        fewest, most = position.executed_segments
        t_s = np.linspace(ends_s[fewest], ends_s[most], POSES_TO_LOOK_AT)
        poses = plan.trajectory.sample(t_s)[0]
        words = _touch_words([_at_rest(first, q_rad, now_s) for q_rad in poses], now_s)
        error.add_note(f"wherever it rests between what was executed and what was sent: {words}")


def _touch_words(resting: Sequence[Scene], now_s: float) -> str:
    """Say what touches first of all arms that may rest from now on, and when."""
    horizon_s = resting[0].moving.horizon_s if resting[0].moving else 0.0
    touches = [touch for scene in resting if (touch := rest_touch(scene, horizon_s)) is not None]
    first = min(touches, key=lambda touch: touch.after_s, default=None)
    if first is None:
        return f"nothing touches the resting arm for {horizon_s:g} s"
    return f"{first.words()}, {now_s + first.after_s:.2f} s on the obstacles' clock"


def _rest_rad(plan: Plan, error: StreamError) -> NDArray[np.float64]:
    """Return the pose that the ledger tells."""
    joints = len(plan.segments.start_usteps)
    usteps = np.add(plan.segments.start_usteps, error.position.moved_usteps[:joints])
    return Transmission.of(plan.scene).q_rad(usteps)


def _at_rest(scene: Scene, rest_rad: NDArray[np.float64], at_s: float) -> Scene:
    """Return the scene as it is at a time, with the arm at rest in a pose."""
    x, y = forward(Arm.from_spec(scene.arm), rest_rad)[-1]
    task = replace(scene.task, start_cm=(float(x), float(y)), start_rad=tuple(float(q) for q in rest_rad))
    return later(replace(scene, task=task), at_s)
