"""Keeping appointments: the agreed start, lateness by the ledger, a stop, and a new plan from where the arm rests."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from link_model import ModelLine, motion
from moving_scenes import SAMPLE_S, clearance_at, random_motion, random_moving_scene
from planarm.errors import LinkError, NoPathError, SceneError
from planarm.link.clock_sync import Span
from planarm.link.exchange import stream_plan
from planarm.link.position import Certainty, MissedStartError, PositionReport, StreamError
from planarm.link.stream import StreamOptions
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.model.moving import later, shape_at
from planarm.model.transmission import Transmission
from planarm.routes.moving_route import find_moving_route, rest_touch
from planarm.run_folder.moving_picture import animate
from planarm.scene import Obstacle, ObstacleMotion
from planarm.streaming.moving_run import (
    FIRST_LEAD_S,
    LONGER,
    REACTION_S,
    REPLAN_S,
    Room,
    Timekeeper,
    stream_on_time,
)
from planarm.trajectory.motion import Trajectory


@dataclass
class FakeClock:
    at_s: float = 7.0

    def now_s(self):
        return self.at_s

    def wait_until(self, t_s):
        self.at_s = max(self.at_s, t_s)


def reached(path_s, at_s):
    return SimpleNamespace(path_span_s=Span(path_s, path_s + 0.001), made_s=Span(at_s - 0.002, at_s), at_s=at_s)


def test_a_motion_starts_at_the_agreed_time():
    line = ModelLine()
    seen = []
    stream_plan(line, motion(40), lambda told: seen.append((line.clock.now_s(), told)), StreamOptions(start_at_s=0.4))
    begun = [at for at, told in seen if told.executed_segments >= 1]
    assert begun[0] > 0.4
    assert 0.4 + 40 * 0.002 <= line.clock.now_s() < 0.4 + 40 * 0.002 + 0.02


def test_a_start_that_has_passed_is_refused_before_anything_moves():
    line = ModelLine()
    with pytest.raises(LinkError, match=r"due to start at 0\.001000 s, .* nothing has moved"):
        stream_plan(line, motion(40), options=StreamOptions(start_at_s=0.001))
    assert not line.device.segments_executed


def test_a_timekeeper_stops_a_motion_once_when_it_is_too_late():
    clock, stops = FakeClock(), []
    keeper = Timekeeper(clock, 8.0, Room(0.1 + REACTION_S, 0.0))
    stream = SimpleNamespace(stop=lambda: stops.append(clock.at_s), round_trip_s=0.01)
    for clock.at_s, path_s in ((8.5, 0.45), (9.0, 0.93), (9.5, 1.38), (9.6, 1.40)):
        keeper.watch(reached(path_s, clock.at_s))
        keeper.steer(stream)
    assert stops == [9.5]
    assert keeper.late_s == pytest.approx(0.2)


def test_later_is_the_same_scene_seen_from_then_on():
    rng = np.random.default_rng(4)
    looked = 0
    for _ in range(60):
        moving = random_motion(rng, 20)
        shape = Obstacle("square", (3.0, 4.0), 5.0, motion=moving) if rng.random() < 0.5 else None
        shape = shape or Obstacle("polygon", vertices_cm=((0.0, 0.0), (2.0, 0.0), (0.0, 3.0)), motion=moving)
        scene = replace(random_moving_scene(rng), obstacles=(shape,))
        by_s = float(rng.uniform(0.0, 25.0))
        (then,) = later(scene, by_s).obstacles
        for t in rng.uniform(0.0, 40.0, 12):
            ours, plain = shape_at(then, t), shape_at(shape, by_s + t)
            assert np.array(ours.vertices_cm) == pytest.approx(np.array(plain.vertices_cm), abs=1e-6)
            looked += moving is not None
    assert looked > 100


def scene_and_route():
    """A random scene with a way of more than eight samples."""
    for seed in range(1000):
        scene = random_moving_scene(np.random.default_rng(seed), count=3, samples=50)
        try:
            route = find_moving_route(scene, scene.margin_cm + 0.05)
        except (NoPathError, SceneError):
            continue
        if route.path.arrival > 8:
            return scene, route
    raise AssertionError("no scene")


def test_a_plan_leads_on_from_a_pose_that_is_no_node():
    scene, route = scene_and_route()
    arm = Arm.from_spec(scene.arm)
    rest = route.spline.evaluate(np.array([3.3 * SAMPLE_S])).q_rad[0]
    tip = forward(arm, rest)[-1]
    task = replace(scene.task, start_cm=tuple(map(float, tip)), start_rad=tuple(map(float, rest)))
    then = later(replace(scene, task=task), 3.3 * SAMPLE_S)
    onward = find_moving_route(then, scene.margin_cm + 0.05)
    assert onward.spline.evaluate(np.array([0.0])).q_rad[0] == pytest.approx(rest)
    assert onward.path.points_cm[-1] == pytest.approx(scene.task.goal_cm)
    times = np.linspace(0.0, onward.path.arrival * SAMPLE_S, 60)
    for t, q in zip(times, onward.spline.evaluate(times, "left").q_rad, strict=True):
        assert clearance_at(scene, q, 3.3 * SAMPLE_S + t) > scene.margin_cm


def position(certainty=Certainty.EXACT, moved=(12, -7)):
    return PositionReport(certainty, (3, 3), 9, moved, ((0, 20), (-9, 0)))


def a_plan(scene, margin_s=0.5):
    return SimpleNamespace(
        scene=scene,
        segments=SimpleNamespace(start_usteps=(100, 200), allowances=(SimpleNamespace(need_ticks=160_000.0),)),
        moving=SimpleNamespace(delay_margin_s=margin_s),
    )


def test_the_arm_may_be_late_by_the_margin_less_reaction_and_the_longest_stop():
    assert Room.of(a_plan(None)).most_late_s() == pytest.approx(0.5 - REACTION_S - 2 * 0.01)
    assert Room.of(a_plan(None, margin_s=0.0)).most_late_s() == REACTION_S


def late_once(clock, error):
    """A streamer whose first motion is 0.9 s late after 2 s of its path, and whose second arrives."""
    starts = []

    def streamer(_plan, keeper):
        starts.append(keeper.start_at_s)
        if len(starts) > 1:
            clock.at_s += 5.0
            return "arrived"
        clock.at_s = keeper.start_at_s + 2.9
        keeper.watch(reached(2.0, clock.at_s))
        keeper.steer(SimpleNamespace(stop=lambda: None, round_trip_s=0.01))
        clock.at_s += 0.1
        raise error

    return streamer, starts


def test_a_late_motion_is_planned_again_from_its_rest_among_the_obstacles_of_then():
    scene = random_moving_scene(np.random.default_rng(1))
    far = Obstacle("circle", (200.0, 0.0), 2.0, motion=ObstacleMotion((0.0, 10.0), ((0.0, 0.0), (50.0, 0.0)), False))
    scene, clock, asked = replace(scene, obstacles=(far,)), FakeClock(), []
    streamer, starts = late_once(clock, StreamError("stopped as asked", position()))

    def plan_again(then):
        asked.append(then)
        return a_plan(then)

    kept = stream_on_time(a_plan(scene), clock, streamer, plan_again)
    assert kept.streamed == "arrived"
    assert kept.zero_s == 7.0 + FIRST_LEAD_S == starts[0]
    (replan,) = kept.replans
    assert replan.at_s == pytest.approx(3.0)
    assert replan.late_s == pytest.approx(0.9)
    assert starts[1] == pytest.approx(kept.zero_s + 3.0 + REPLAN_S)
    (then,) = asked
    assert then.task.start_rad == pytest.approx(Transmission.of(scene).q_rad((112, 193)))
    assert then.obstacles[0].center_cm == pytest.approx((200.0 + 5.0 * (3.0 + REPLAN_S), 0.0))
    assert kept.figures()["replans"][0]["depart_s"] == pytest.approx(3.0 + REPLAN_S)


def test_when_nothing_leads_on_the_error_says_what_touches_the_arm_and_when():
    scene = random_moving_scene(np.random.default_rng(1))
    rest = Transmission.of(scene).q_rad((112, 193))
    tip = forward(Arm.from_spec(scene.arm), rest)[-1]
    # It is 20 cm beyond the tip when the arm stops after 3 s, and comes on at 4 cm/s.
    away = ObstacleMotion((0.0, 3.0, 13.0), ((0.0, 0.0), (0.0, 0.0), (-40.0, 0.0)), False)
    comer = Obstacle("circle", (float(tip[0]) + 20.0, float(tip[1])), 2.0, motion=away)
    scene, clock = replace(scene, obstacles=(comer,)), FakeClock()
    streamer, _ = late_once(clock, StreamError("stopped as asked", position()))

    def no_way(_scene):
        raise NoPathError("none")

    with pytest.raises(StreamError) as caught:
        stream_on_time(a_plan(scene), clock, streamer, no_way)
    notes = caught.value.__notes__
    assert "0.900 s behind its plan" in notes[0]
    assert notes[1] == "no motion leads on: none"
    # It touches when its edge and the margin reach the tip: (20 - 1 - 0.4) cm at 4 cm/s, told to 0.05 s.
    assert notes[2].startswith("obstacles[1] touches the resting arm after ")
    assert 4.59 <= float(notes[2].split()[6].rstrip("s,")) <= 4.66
    assert notes[2].endswith(" s on the obstacles' clock")


def test_a_missed_start_is_put_off_and_planned_for_from_where_the_arm_rests():
    scene, clock = replace(random_moving_scene(np.random.default_rng(1)), obstacles=()), FakeClock()
    starts, asked = [], []

    def streamer(_plan, keeper):
        starts.append(keeper.start_at_s)
        if len(starts) > 2:
            return "arrived"
        clock.at_s = keeper.start_at_s + 0.3
        missed = MissedStartError(keeper.start_at_s, clock.at_s, 0.01)
        raise StreamError(str(missed), position(moved=(0, 0))) from missed

    def plan_again(then):
        asked.append(then)
        return a_plan(then)

    kept = stream_on_time(a_plan(scene), clock, streamer, plan_again)
    assert kept.streamed == "arrived"
    assert [one.why for one in kept.replans] == ["missed start", "missed start"]
    leads = [one.depart_s - one.at_s for one in kept.replans]
    assert leads == pytest.approx([REPLAN_S + LONGER * 0.31, REPLAN_S + 2 * LONGER * 0.31])
    assert starts[1:] == pytest.approx([kept.zero_s + one.depart_s for one in kept.replans])
    assert asked[0].task.start_rad == pytest.approx(Transmission.of(scene).q_rad((100, 200)))


def test_a_line_that_fails_tells_what_touches_the_arm_wherever_it_may_rest():
    """Told last after 3 of 9 segments; a disc comes to where it would rest after 5 of them."""
    scene = random_moving_scene(np.random.default_rng(1))
    ends = np.array([Transmission.of(scene).q_rad(at) for at in ((100, 200), (900, -700))])
    share = 5 / 9
    tip = forward(Arm.from_spec(scene.arm), ends[0] + share * (ends[1] - ends[0]))[-1]
    away = ObstacleMotion((0.0, 5.0), ((0.0, 0.0), (-20.0, 0.0)), False)
    scene = replace(scene, obstacles=(Obstacle("circle", (float(tip[0]) + 20.0, float(tip[1])), 0.2, motion=away),))
    plan = a_plan(scene)
    plan.segments.segments = motion(9)
    plan.trajectory = SimpleNamespace(sample=lambda t_s: (ends[0] + np.outer(t_s / 0.018, ends[1] - ends[0]),))
    clock = FakeClock()

    def streamer(_plan, keeper):
        clock.at_s = keeper.start_at_s
        raise StreamError("no reply", replace(position(Certainty.BOUNDED), executed_segments=(3, 9)))

    with pytest.raises(StreamError) as caught:
        stream_on_time(plan, clock, streamer, None)
    (note,) = caught.value.__notes__
    assert note.startswith("wherever it rests between what was executed and what was sent: obstacles[1] touches")
    assert 4.0 < float(note.split("after ")[1].split()[0]) <= 5.0


@pytest.mark.parametrize("certainty", [Certainty.BOUNDED, Certainty.LOST])
def test_without_an_exact_position_nothing_is_planned_again(certainty):
    clock = FakeClock()
    streamer, starts = late_once(clock, StreamError("gone", position(certainty)))
    plan = a_plan(replace(random_moving_scene(np.random.default_rng(1)), obstacles=()))
    plan.segments.segments = motion(9)
    plan.trajectory = SimpleNamespace(sample=lambda t_s: (np.zeros((len(t_s), 2)),))
    with pytest.raises(StreamError, match="gone"):
        stream_on_time(plan, clock, streamer, None)
    assert len(starts) == 1


def test_a_pose_that_nothing_comes_near_has_no_problem():
    scene = replace(random_moving_scene(np.random.default_rng(1)), obstacles=())
    q = inverse_2r(Arm.from_spec(scene.arm), (25.0, 3.0), "up")
    resting = replace(scene, task=replace(scene.task, start_rad=tuple(map(float, q))))
    assert rest_touch(resting, 5.0) is None


def test_a_plan_is_animated_with_its_obstacles_in_real_time(tmp_path):
    scene, route = scene_and_route()
    trajectory = Trajectory.in_own_time(route.spline)
    plan = SimpleNamespace(
        scene=scene, moving=route, trajectory=trajectory, path=SimpleNamespace(length_cm=route.length_cm)
    )
    animate(tmp_path / "a.svg", plan)
    svg = ElementTree.parse(tmp_path / "a.svg").getroot()
    animations = list(svg.iter("{http://www.w3.org/2000/svg}animate"))
    arm = next(a for a in animations if a.get("attributeName") == "points")
    assert float(arm.get("dur").rstrip("s")) == pytest.approx(trajectory.duration_s)
    last = arm.get("values").split(";")[-1].split()[-1]
    assert tuple(map(float, last.split(","))) == pytest.approx(scene.task.goal_cm, abs=0.01)
    shifts = [a.get("values") for a in svg.iter("{http://www.w3.org/2000/svg}animateTransform")]
    assert len(shifts) <= len(scene.obstacles)
