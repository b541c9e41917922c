"""Planning again while the arm moves: an obstacle that appears is kept clear of, or the stop before it is explained.

The first plan and all later ones stand on one roadmap (`planarm.roadmap`), so that an obstacle costs a check of the
moves it can touch and a repair of the search. When one appears, the rest of the motion that streams is looked at, from
the least path time at which the arm can be:

- nothing of it comes too near: the stream is kept as it is;
- something does, far enough ahead: no segment from a border before it on is sent, another motion that leaves this one
  at that border is planned and certified beside the stream, and sent in the place of the rest
  (`planarm.operations.splicing`); the arm does not stop, unless planning takes longer than it was given;
- there is no such border or no such motion, but the arm can come to rest before: it slows down along its path, gently
  where there is room, and rests; a new plan is made from there, certified among all obstacles, and streamed;
- something comes too near before that: the quickest stop, and the obstacle is reported as unavoidable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import closing, nullcontext
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from planarm.errors import CertificateError, NoPathError, PlanarmError, SceneError, TimingError
from planarm.link.clock import RealClock
from planarm.link.exchange import stream_plan
from planarm.link.position import StreamError, moved_usteps
from planarm.link.stream import Stream
from planarm.link.transport import Transport
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.shapes import shape_of
from planarm.model.transmission import Transmission
from planarm.motions.margin import planning_margin_cm
from planarm.notice import Notice
from planarm.operations.beside import AsLong, Beside, InThread
from planarm.operations.splicing import Border, borders_from, first_border, plan_from_borders, why_not
from planarm.operations.verdicts import Verdict, contact_time_s, judge_contact, whereabouts_s
from planarm.pipeline import plan_scene
from planarm.plan import Plan
from planarm.roadmap.planning import RoadmapTask, way_from
from planarm.routes.route import SEARCHED, roadmap_told, route_through
from planarm.scene import Obstacle, Scene
from planarm.streaming.plan_stream import options_for
from planarm.workspace.joint_proof import joint_world

Floats = NDArray[np.float64]
MOST_LEGS = 20
LOOK_AGAIN_S = 0.005
"""So soon the sources of obstacles, and the work on another motion, are looked at again."""
LEAST_PLANNING_S = 0.03
AHEAD_S = 0.1
"""Path that the device holds beyond what a stop takes: what it holds cannot be changed any more."""


class Obstacles(Protocol):
    """Where new obstacles come from."""

    def new(self, motion_s: float) -> Sequence[Obstacle]:
        """Return those that were not told before; `motion_s` is the time since the first motion began."""


@dataclass(frozen=True, slots=True)
class Encounter:
    """One obstacle and what was done about it."""

    obstacle: Obstacle
    at_s: float
    """Since the first motion began."""
    verdict: Verdict
    quick: bool
    """Whether the stop had to be a quick one, with all of the allowed slowing."""
    closed_edges: int = 0
    repair_ms: float = 0.0
    """Checking the moves that it can touch, and telling the search."""
    stopped_because: str = ""
    """Why the motion was not left at speed; empty where it was, or where nothing had to be done."""


@dataclass(frozen=True, slots=True)
class NewPlan:
    """A plan that was made on the way."""

    rest_s: float
    """From the notice to rest, by the transport's clock; 0 where the arm went on."""
    plan_ms: float
    """From rest to the new plan being certified, by the host's clock; where the arm went on, from the notice, by the
    transport's."""
    spliced_at_s: float | None = None
    """The path time at which the motion was left for the new one at speed; None where the arm rested."""

    @property
    def notice_to_certified_ms(self) -> float:
        """From the notice to the new plan being certified."""
        return 1e3 * self.rest_s + self.plan_ms


@dataclass(frozen=True, slots=True, eq=False)
class LiveResult:
    """How it ended."""

    reached: bool
    reason: str
    """Why the goal was not reached; empty when it was."""
    encounters: tuple[Encounter, ...]
    new_plans: tuple[NewPlan, ...]
    plans: tuple[Plan, ...]
    end_rad: Floats
    """Where the arm rests, by the device's ledger."""
    began_s: float
    """When the first motion began, by the transport's clock."""

    def figures(self) -> dict[str, Any]:
        """Return it as one mapping."""
        return {
            "reached": self.reached,
            "reason": self.reason,
            "encounters": [
                {**asdict(one), "obstacle": _obstacle_words(one.obstacle), "at_s": round(one.at_s, 6)}
                for one in self.encounters
            ],
            "new_plans": [asdict(one) for one in self.new_plans],
            "end_deg": np.degrees(self.end_rad).round(4).tolist(),
        }


@dataclass
class _Splice:
    """A motion that is to be left, and the work on the one that follows."""

    border: Border
    """Nothing behind it is sent."""
    contact_s: float
    """Path time at which the old motion would meet an obstacle."""
    noticed_s: float
    work: Future[tuple[Plan, Border]]
    encounter: int
    """The one that it is for."""
    stale: bool = False
    """Another obstacle has come since the work began."""


@dataclass
class _Run:
    """What one live run knows, from leg to leg."""

    scene: Scene
    task: RoadmapTask
    plan: Plan
    """What streams."""
    obstacles: Obstacles
    transport: Transport
    host_s: Callable[[], float]
    beside: Beside
    margin_cm: float
    warn: Callable[[str], None] | None
    began_s: float | None = None
    noticed_s: float = 0.0
    stopping: Verdict | None = None
    splice: _Splice | None = None
    untold: list[int] = field(default_factory=list)
    """Encounters whose obstacles the roadmap does not know yet."""
    encounters: list[Encounter] = field(default_factory=list)
    plans: list[Plan] = field(default_factory=list)
    new_plans: list[NewPlan] = field(default_factory=list)

    def begin_leg(self) -> None:
        """Forget what stopped the leg before."""
        self.stopping = None

    def watch(self, stream: Stream) -> None:
        """Look for new obstacles and answer them; called while the stream runs."""
        now_s = self.transport.clock.now_s()
        if self.began_s is None:
            self.began_s = stream.started_s
        for obstacle in self.obstacles.new(now_s - self.began_s):
            self._meet(stream, obstacle, now_s)
        if self.splice is not None and self.stopping is None and self.beside.has_ended(self.splice.work, now_s):
            self._end_splice(stream, self.splice, now_s)
        stream.wake_s = now_s + LOOK_AGAIN_S

    def take(self, plan: Plan, new: NewPlan) -> None:
        """Go on with a new plan."""
        self.plan = plan
        self.plans.append(plan)
        self.new_plans.append(new)

    def rest(self) -> None:
        """Wait for work that nobody wants any more, and let the roadmap know all obstacles: the arm rests."""
        if self.splice is not None:
            _require_sound(self.splice.work)
            self.splice = None
        self._tell_roadmap()

    def _meet(self, stream: Stream, obstacle: Obstacle, now_s: float) -> None:
        least_s, most_s = whereabouts_s(stream, now_s)
        contact_s = contact_time_s(self.plan, shape_of(obstacle), self.margin_cm, least_s)
        verdict, quick = judge_contact(self.plan, contact_s, most_s)
        self.untold.append(len(self.encounters))
        self.encounters.append(Encounter(obstacle, now_s - (self.began_s or now_s), verdict, quick))
        self.scene = replace(self.scene, obstacles=(*self.scene.obstacles, obstacle))
        if self.splice is None:
            self._tell_roadmap()
        else:
            self.splice.stale = True
        if verdict == "kept":
            return
        if self.stopping is not None:
            self.stopping = "unavoidable" if verdict == "unavoidable" else self.stopping
            return
        because = "" if verdict == "unavoidable" else self._leave(stream, contact_s, least_s, most_s, now_s)
        if because or verdict == "unavoidable":
            self._stop(stream, verdict, quick, because, now_s, len(self.encounters) - 1)

    def _leave(self, stream: Stream, contact_s: float, least_s: float, most_s: float, now_s: float) -> str:
        """Begin to leave the motion at speed; return why not, empty when it is begun."""
        if self.splice is not None:  # it is being left already
            self.splice.contact_s = min(self.splice.contact_s, contact_s)
            return "" if contact_s > self.splice.border.path_s else "it is before where the motion is left"
        if problem := why_not(self.plan):
            return problem
        ready_s = most_s + self.beside.allow_s(self._planning_s())
        border = first_border(self.plan, stream.sent_segments, ready_s)
        if border is None:
            return "too little of the motion is left"
        if border.path_s >= contact_s:
            return "it is before where the motion could be left"
        stream.keep_back(border.segment)
        work = self._begin(border, contact_s, least_s, now_s)
        self.splice = _Splice(border, contact_s, now_s, work, len(self.encounters) - 1)
        return ""

    def _planning_s(self) -> float:
        """Return how long planning took last, without what an optimiser was given: nothing is while the arm moves."""
        made, planner = self.plans[-1], self.plan.scene.planner
        optimised = planner.objective == "time" and (not self.new_plans or self.new_plans[-1].spliced_at_s is None)
        return max(LEAST_PLANNING_S, 1e-3 * made.plan_ms - (planner.budget_s if optimised else 0.0))

    def _begin(self, first: Border, contact_s: float, from_s: float, now_s: float) -> Future[tuple[Plan, Border]]:
        """Begin to plan a motion that leaves the one that streams."""
        scene = replace(self.plan.scene, obstacles=self.scene.obstacles)  # it began where this leg began
        borders = borders_from(self.plan, first, contact_s)
        work = partial(plan_from_borders, scene, self.task, self.plan, borders, from_s, self.margin_cm)
        return self.beside.begin(work, now_s)

    def _end_splice(self, stream: Stream, splice: _Splice, now_s: float) -> None:
        """Take the motion that was planned, plan once more, or stop."""
        least_s, most_s = whereabouts_s(stream, now_s)
        self.splice = None
        self._tell_roadmap()
        if splice.stale:
            _require_sound(splice.work)
            work = self._begin(splice.border, splice.contact_s, least_s, now_s)
            self.splice = replace(splice, work=work, stale=False)
            return
        try:
            plan, border = splice.work.result()
        except (NoPathError, SceneError, TimingError, CertificateError) as error:
            _, quick = judge_contact(self.plan, splice.contact_s, most_s)
            self._stop(stream, "avoided", quick, str(error), splice.noticed_s, splice.encounter)
            return
        stream.go_on_with(plan.segments.segments, plan.segments.allowances)
        self.take(plan, NewPlan(0.0, 1e3 * (now_s - splice.noticed_s), border.path_s))

    def _stop(
        self, stream: Stream, verdict: Verdict, quick: bool, because: str, noticed_s: float, encounter: int
    ) -> None:
        stream.stop(quick=quick)
        self.stopping, self.noticed_s = verdict, noticed_s
        self.encounters[encounter] = replace(self.encounters[encounter], stopped_because=because)

    def _tell_roadmap(self) -> None:
        """Let the roadmap and the search know the obstacles that they do not know; nobody else uses them meanwhile."""
        for k in self.untold:
            began_s = self.host_s()
            _, changes = self.task.roadmap.add_obstacle(shape_of(self.encounters[k].obstacle))
            self.task.planner.change(changes)
            repair_ms = 1e3 * (self.host_s() - began_s)
            self.encounters[k] = replace(self.encounters[k], closed_edges=len(changes.edges), repair_ms=repair_ms)
        self.untold.clear()


def run_live(
    scene: Scene,
    transport: Transport,
    obstacles: Obstacles,
    notice: Notice,
    host_s: Callable[[], float],
    first: tuple[RoadmapTask, Plan] | None = None,
    beside: Beside | None = None,
    warn: Callable[[str], None] | None = None,
) -> LiveResult:
    """Carry a scene out on a board while obstacles may appear.

    Args:
        scene: one to four links, a planner on a roadmap.
        transport: to the board.
        obstacles: asked at every pass while the arm moves.
        notice: told the progress of planning.
        host_s: a clock of the host's.
        first: the roadmap and the plan, when they are there already (`first_plan`).
        beside: plans while the arm moves, the caller's to close; by default in a thread, or as long as that would take
            in an emulator's time.
        warn: told what will be otherwise than planned, as on a slow line.

    Raises:
        PlanarmError: the first plan cannot be made, or the line or the board fails.
    """
    task, plan = first or first_plan(scene, notice)
    margin_cm = planning_margin_cm(scene)
    with closing(_own_beside(transport, host_s)) if beside is None else nullcontext(beside) as works:
        run = _Run(scene, task, plan, obstacles, transport, host_s, works, margin_cm, warn, plans=[plan])
        end_rad, reason = _legs(run, notice)
    met, made, plans = tuple(run.encounters), tuple(run.new_plans), tuple(run.plans)
    return LiveResult(not reason, reason, met, made, plans, end_rad, run.began_s or 0.0)


def _own_beside(transport: Transport, host_s: Callable[[], float]) -> Beside:
    """Return what plans beside a stream when the caller brings nothing that does."""
    return InThread() if isinstance(transport.clock, RealClock) else AsLong(host_s)


def _legs(run: _Run, notice: Notice) -> tuple[Floats, str]:
    """Stream from rest to rest until the goal is reached; return where the arm rests, and why it is not the goal."""
    for _ in range(MOST_LEGS):
        end_rad, stopped = _stream_leg(run)
        run.rest()
        if stopped is None:
            return end_rad, ""
        rest_s, planning_s = run.transport.clock.now_s() - run.noticed_s, run.host_s()
        try:
            plan = plan_from(run.scene, run.task, end_rad, notice)
        except (NoPathError, SceneError, TimingError) as error:
            return end_rad, f"{stopped}: {error}"
        run.take(plan, NewPlan(rest_s, 1e3 * (run.host_s() - planning_s)))
        if not plan.certificate.ok:
            return end_rad, f"the new plan is not certified: {plan.certificate.explain()}"
    return end_rad, f"{MOST_LEGS} new plans were made from rest and none could be finished"


def first_plan(scene: Scene, notice: Notice) -> tuple[RoadmapTask, Plan]:
    """Return a scene's roadmap, ready for obstacles, and the first plan on it; errors as `plan_scene`.

    Its way is left as it was found: one without detours is driven so fast that it can seldom be left at speed.
    """
    margin_cm = planning_margin_cm(scene)
    task = RoadmapTask.of(scene, margin_cm, roadmap_told(notice))
    task.roadmap.prepare()
    answer = task.planner.solve()
    if not len(answer.nodes):
        raise task.no_way(scene)
    poses = task.roadmap.poses_rad[answer.nodes]
    route = route_through(scene, margin_cm, poses, answer.cost)
    return task, plan_scene(scene, partial(_after_the_roadmap, notice), route)


def _after_the_roadmap(notice: Notice, stage: str, share: float) -> None:
    """Tell a plan's progress, whose beginning was told while its roadmap was built."""
    notice(stage, max(SEARCHED, share) if stage == "plan" else share)


def plan_from(scene: Scene, task: RoadmapTask, rest_rad: Floats, notice: Notice) -> Plan:
    """Return a plan from where the arm rests to the scene's goal, among all of the scene's obstacles.

    Raises:
        NoPathError: the arm rests too near to an obstacle, or nothing joins it with the goal any more.
    """
    margin_cm = planning_margin_cm(scene)
    found = way_from(task, joint_world(scene, margin_cm), rest_rad)
    if found is None:
        raise NoPathError(f"{scene.source}: no way leads on from {_pose_words(scene, rest_rad)} to the goal")
    poses, cost = found
    x, y = forward(Arm.from_spec(scene.arm), rest_rad)[-1]
    start = replace(scene.task, start_cm=(float(x), float(y)), start_rad=tuple(map(float, rest_rad)))
    from_here = replace(scene, task=start)
    return plan_scene(from_here, notice, route_through(from_here, margin_cm, poses, cost))


def _require_sound(work: Future[tuple[Plan, Border]]) -> None:
    """Wait for work whose result nobody wants; a fault of the program is raised all the same."""
    error = work.exception()
    if error is not None and not isinstance(error, PlanarmError):
        raise error


def _stream_leg(run: _Run) -> tuple[Floats, Verdict | None]:
    """Stream the plan until it is done or stopped; return where the arm rests, and the verdict that stopped it."""
    run.begin_leg()
    plan = run.plan
    if not plan.certificate.ok:
        raise CertificateError(f"{plan.scene.source}: the plan is not certified: {plan.certificate.explain()}")
    options = replace(options_for(plan.scene, plan.segments), ahead_s=AHEAD_S)
    start = np.array(plan.segments.start_usteps)
    try:
        result = stream_plan(run.transport, plan.segments.segments, options=options, steer=run.watch, warn=run.warn)
        moved = moved_usteps(result.ledger_before, result.ledger_after)
    except StreamError as error:
        if run.stopping is None:
            raise
        moved = error.position.moved_usteps
    at: Floats = Transmission.of(plan.scene).q_rad(start + np.array(moved[: len(start)]))
    return at, run.stopping


def _obstacle_words(obstacle: Obstacle) -> str:
    if obstacle.center_cm is None:
        return f"{obstacle.shape} of {len(obstacle.vertices_cm or ())} corners"
    return f"{obstacle.shape} at ({obstacle.center_cm[0]:g}, {obstacle.center_cm[1]:g}) cm"


def _pose_words(scene: Scene, rest_rad: Floats) -> str:
    x, y = forward(Arm.from_spec(scene.arm), rest_rad)[-1]
    return f"tip ({x:.2f}, {y:.2f}) cm"
