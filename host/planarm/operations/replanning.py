"""Planning again while the arm moves: an obstacle that appears is kept clear of, or the stop before it is explained.

The first plan and all later ones stand on one roadmap (`planarm.roadmap`), so that an obstacle costs a check of the
moves it can touch and a repair of the search. When one appears, the rest of the motion that streams is looked at, from
the least path time at which the arm can be:

- nothing of it comes too near: the stream is kept as it is;
- something does, but later than the arm can come to rest: the arm slows down along its path, gently where there is
  room, and rests; a new plan is made from there, certified among all obstacles, and streamed;
- something does before that: the quickest stop, and the obstacle is reported as unavoidable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from planarm.errors import NoPathError, SceneError, TimingError
from planarm.link.clock_sync import MOST_SLOWNESS
from planarm.link.exchange import stream_plan
from planarm.link.position import StreamError, moved_usteps
from planarm.link.stream import Stream
from planarm.link.transport import Transport
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.shapes import Circle, Polygon, obstacle_set, shape_of
from planarm.model.transmission import Transmission
from planarm.pipeline import Notice, plan_scene, planning_margin_cm
from planarm.plan import Plan
from planarm.roadmap.planning import RoadmapTask, way_from
from planarm.roadmap.recheck import first_contact
from planarm.routes.route import route_through
from planarm.scene import Obstacle, Scene
from planarm.stepping.stopping import stops
from planarm.streaming.plan_stream import options_for
from planarm.trajectory.motion import Trajectory
from planarm.workspace.joint_proof import joint_world
from planarm_wire.messages import SLICE_TICKS, TICKS_HZ
from planarm_wire.steps import duration_ticks

Floats = NDArray[np.float64]
Verdict = Literal["kept", "avoided", "unavoidable"]

LOOK_S = 0.001
"""The rest of a motion is looked at this densely, with a bound for what lies between."""
ORDER_S = 0.03
"""From a notice to a stop that takes effect: a message waits for at most one other on the line, 10 ms each."""
GENTLE_SHARE = 0.5
"""Of the allowed slowing that the device uses for a stop that is not a quick one."""
MOST_LEGS = 20


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
    closed_edges: int
    repair_ms: float
    """Checking the moves that it can touch, and telling the search."""


@dataclass(frozen=True, slots=True)
class NewPlan:
    """A plan that was made while the arm rested on its path."""

    rest_s: float
    """From the notice to rest, by the transport's clock."""
    plan_ms: float
    """From rest to the new plan being certified, by the host's clock."""

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
class _Run:
    """What one live run knows, from leg to leg."""

    scene: Scene
    task: RoadmapTask
    obstacles: Obstacles
    transport: Transport
    host_s: Callable[[], float]
    margin_cm: float
    began_s: float | None = None
    noticed_s: float = 0.0
    stopping: Verdict | None = None
    encounters: list[Encounter] = field(default_factory=list)

    def begin_leg(self) -> None:
        """Forget what stopped the leg before."""
        self.stopping = None

    def watch(self, plan: Plan, stream: Stream) -> None:
        """Look for new obstacles and answer them; called while the stream runs."""
        now_s = self.transport.clock.now_s()
        if self.began_s is None:
            self.began_s = stream.started_s
        for obstacle in self.obstacles.new(now_s - self.began_s):
            self._meet(plan, stream, obstacle, now_s)

    def _meet(self, plan: Plan, stream: Stream, obstacle: Obstacle, now_s: float) -> None:
        shape = shape_of(obstacle)
        least_s, most_s = whereabouts_s(plan, stream, now_s)
        verdict, quick = judge(plan, shape, self.margin_cm, least_s, most_s)
        began_s = self.host_s()
        _, changes = self.task.roadmap.add_obstacle(shape)
        self.task.planner.change(changes)
        repair_ms = 1e3 * (self.host_s() - began_s)
        self.scene = replace(self.scene, obstacles=(*self.scene.obstacles, obstacle))
        at_s = now_s - (self.began_s or now_s)
        self.encounters.append(Encounter(obstacle, at_s, verdict, quick, len(changes.edges), repair_ms))
        if verdict != "kept" and self.stopping is None:
            self.noticed_s = now_s
            stream.stop(quick=quick)
        if verdict != "kept" and self.stopping != "unavoidable":
            self.stopping = verdict


def run_live(
    scene: Scene,
    transport: Transport,
    obstacles: Obstacles,
    notice: Notice,
    host_s: Callable[[], float],
    first: tuple[RoadmapTask, Plan] | None = None,
) -> LiveResult:
    """Carry a scene out on a board while obstacles may appear.

    Args:
        scene: two links, a planner on a roadmap.
        transport: to the board.
        obstacles: asked at every pass while the arm moves.
        notice: told the progress of planning.
        host_s: a clock of the host's.
        first: the roadmap and the plan, when they are there already (`first_plan`).

    Raises:
        PlanarmError: the first plan cannot be made, or the line or the board fails.
    """
    task, plan = first or first_plan(scene, notice)
    run = _Run(scene, task, obstacles, transport, host_s, planning_margin_cm(scene))
    plans = [plan]
    new_plans: list[NewPlan] = []

    def ended(reason: str) -> LiveResult:
        met, made, all_plans = tuple(run.encounters), tuple(new_plans), tuple(plans)
        return LiveResult(not reason, reason, met, made, all_plans, end_rad, run.began_s or 0.0)

    while len(plans) <= MOST_LEGS:
        end_rad, stopped = _stream_leg(run, plan)
        if stopped is None:
            return ended("")
        rest_s, planning_s = transport.clock.now_s() - run.noticed_s, host_s()
        try:
            plan = plan_from(run.scene, task, end_rad, notice)
        except (NoPathError, SceneError, TimingError) as error:
            return ended(f"{stopped}: {error}")
        plans.append(plan)
        new_plans.append(NewPlan(rest_s, 1e3 * (host_s() - planning_s)))
        if not plan.certificate.ok:
            return ended(f"the new plan is not certified: {plan.certificate.explain()}")
    return ended(f"{MOST_LEGS} new plans were made and none could be finished")


def first_plan(scene: Scene, notice: Notice) -> tuple[RoadmapTask, Plan]:
    """Return a scene's roadmap, ready for obstacles, and the first plan on it; errors as `plan_scene`."""
    margin_cm = planning_margin_cm(scene)
    task = RoadmapTask.of(scene, margin_cm)
    task.roadmap.prepare()
    answer = task.planner.solve()
    if not len(answer.nodes):
        raise task.no_way(scene)
    poses = task.roadmap.poses_rad[answer.nodes]
    return task, plan_scene(scene, notice, route_through(scene, margin_cm, poses, answer.cost))


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


def judge(plan: Plan, shape: Circle | Polygon, margin_cm: float, least_s: float, most_s: float) -> tuple[Verdict, bool]:
    """Tell what a new obstacle means for a motion, and whether its stop has to be a quick one.

    Args:
        plan: the motion.
        shape: the obstacle.
        margin_cm: to keep from the links' centre lines.
        least_s: the path time is now at least this,
        most_s: and at most this.
    """
    contact_s = contact_time_s(plan, shape, margin_cm, least_s)
    if contact_s == np.inf:
        return "kept", False
    if contact_s > rest_time_s(plan, most_s, GENTLE_SHARE):
        return "avoided", False
    return ("avoided" if contact_s > rest_time_s(plan, most_s, 1.0) else "unavoidable"), True


def contact_time_s(plan: Plan, shape: Circle | Polygon, margin_cm: float, from_s: float) -> float:
    """Return the first path time from `from_s` on at which a link may be nearer than that; infinite when none is."""
    trajectory: Trajectory = plan.trajectory
    t_s = np.linspace(
        min(from_s, trajectory.duration_s), trajectory.duration_s, 2 + int(trajectory.duration_s / LOOK_S)
    )
    q_rad = np.ascontiguousarray(trajectory.sample(t_s)[0])
    world = joint_world(plan.scene)
    # Between two samples no joint turns farther than from one to the other and a little: both count half of it.
    turns = np.abs(np.diff(q_rad, axis=0)) @ np.cumsum(world.lengths_cm[::-1])[::-1]
    sway = np.zeros(len(t_s))
    np.maximum(sway[:-1], turns, out=sway[:-1])
    np.maximum(sway[1:], turns, out=sway[1:])
    index = first_contact(world, obstacle_set([shape]), margin_cm, q_rad, sway)
    return float(t_s[index]) if index >= 0 else float("inf")


def rest_time_s(plan: Plan, from_s: float, share: float) -> float:
    """Return a path time at which the arm rests at the latest when a stop is sent at `from_s`.

    `share` of the allowed slowing is what the stop uses: 1 for a quick one, else `GENTLE_SHARE`.
    """
    segments = plan.segments
    durations = [duration_ticks(segment) for segment in segments.segments]
    starts_s, needs_s = stops(plan.trajectory, plan.scene, durations, segments.allowances, share)
    ordered_s = from_s + ORDER_S
    first = max(0, int(np.searchsorted(starts_s, from_s, side="right")) - 1)
    last = int(np.searchsorted(starts_s, ordered_s, side="right")) + 1  # the slice that runs is ended as it was begun
    return min(ordered_s + SLICE_TICKS / TICKS_HZ + float(needs_s[first:last].max()), sum(durations) / TICKS_HZ)


def whereabouts_s(plan: Plan, stream: Stream, now_s: float) -> tuple[float, float]:
    """Return the least and the largest path time of the arm: by the ledger, and by the fastest board's clock."""
    segments = plan.segments.segments[: stream.executed_segments]
    least_s = sum(map(duration_ticks, segments)) / TICKS_HZ
    began_s = stream.began_s.least if stream.began_s else stream.started_s
    return least_s, max(least_s, (now_s - began_s) * (1.0 + MOST_SLOWNESS))


def _stream_leg(run: _Run, plan: Plan) -> tuple[Floats, Verdict | None]:
    """Stream one plan until it is done or stopped; return where the arm rests, and the verdict that stopped it."""
    run.begin_leg()
    scene = plan.scene
    options = options_for(scene, plan.segments)
    start = np.array(plan.segments.start_usteps)
    try:
        result = stream_plan(
            run.transport, plan.segments.segments, options=options, steer=lambda stream: run.watch(plan, stream)
        )
        moved = moved_usteps(result.ledger_before, result.ledger_after)
    except StreamError as error:
        if run.stopping is None:
            raise
        moved = error.position.moved_usteps
    at: Floats = Transmission.of(scene).q_rad(start + np.array(moved))
    return at, run.stopping


def _obstacle_words(obstacle: Obstacle) -> str:
    if obstacle.center_cm is None:
        return f"{obstacle.shape} of {len(obstacle.vertices_cm or ())} corners"
    return f"{obstacle.shape} at ({obstacle.center_cm[0]:g}, {obstacle.center_cm[1]:g}) cm"


def _pose_words(scene: Scene, rest_rad: Floats) -> str:
    x, y = forward(Arm.from_spec(scene.arm), rest_rad)[-1]
    return f"tip ({x:.2f}, {y:.2f}) cm"
