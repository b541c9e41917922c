"""A motion is left for another at speed while the emulated arm runs: it goes on without a stop, step for step."""

from dataclasses import replace
from time import perf_counter

import numpy as np
import pytest

from live_runs import SCENE, CountedTime, Outcome, by_time, circle, quiet, scene_with_links, tip_at, with_jerk
from planarm.motions import motion
from planarm.operations.beside import AsLong
from planarm.operations.replanning import first_plan
from planarm.scene.arrivals import Arrival
from planarm.stepping.segments import expand
from planarm.trajectory.jerk import largest_jerks
from planarm_wire.messages import TICKS_HZ

PLANNING_S = 0.08
"""What planning is said to take: runs are the same each time."""
PIN_TICKS = 64
"""By how much a step at the pins may differ from its time."""
INTERRUPT_TICKS = 192
"""And one of joints 3 and 4, and of those beside them, which are stepped by interrupt."""


def prompt():
    return AsLong(perf_counter, PLANNING_S)


class Slow(AsLong):
    """Takes longer than it is allowed."""

    def allow_s(self, _known_s):
        return PLANNING_S


@pytest.fixture(scope="module")
def plan():
    return first_plan(SCENE, quiet)[1]


@pytest.mark.parametrize(("appears", "at"), [(0.1, 0.7), (0.2, 0.85), (0.3, 0.85)])
def test_the_arm_goes_on_while_another_motion_is_planned(plan, appears, at):
    """Every step at its certified time, so the path clock was never slowed; and the arm never rests in between."""
    x, y = tip_at(plan, at)
    done = Outcome([Arrival(appears * plan.trajectory.duration_s, circle(x, y, 2.0))], beside=prompt())
    assert [(one.verdict, one.stopped_because) for one in done.result.encounters] == [("avoided", "")]
    assert done.result.reached, done.result.reason
    (new,) = done.spliced
    assert new.notice_to_certified_ms == pytest.approx(1e3 * PLANNING_S, abs=10.0)
    first, last = done.result.plans
    kept = [
        new.spliced_at_s * TICKS_HZ > np.cumsum([s.duration_flags >> 1 for s in p.segments.segments]) - 1
        for p in (first, last)
    ]
    count = int(kept[0].sum())
    assert 0 < count == kept[1].sum()
    assert first.segments.segments[:count] == last.segments.segments[:count]
    assert first.segments.segments != last.segments.segments[: len(first.segments.segments)]
    assert last.certificate.ok and len(last.scene.obstacles) == 1
    told = done.comparison()
    assert told.agrees, told.explain()
    assert told.max_timing_error_ticks <= PIN_TICKS
    every = np.sort(np.concatenate([joint.ticks for joint in expand(last.segments).steps]))
    assert done.longest_pause_s() == pytest.approx(np.diff(every).max() / TICKS_HZ, abs=PIN_TICKS / TICKS_HZ)
    _, speeds, _ = last.trajectory.sample(np.linspace(0.02, last.trajectory.duration_s - 0.02, 4000))
    assert np.abs(speeds).max(axis=1).min() > 0.05
    assert done.result.end_rad == pytest.approx(np.array(SCENE.task.goal_rad), abs=1e-3)
    assert not any(done.record.lost_full_steps)
    done.require_clear()


def test_planning_that_takes_too_long_lets_the_arm_rest_on_its_path_and_go_on(plan):
    """The device holds nothing behind the border, so it rests before it by itself, and goes on when more comes."""
    x, y = tip_at(plan, 0.85)
    arrival = Arrival(0.2 * plan.trajectory.duration_s, circle(x, y, 2.0))
    done = Outcome([arrival], beside=Slow(perf_counter, 1.5))
    assert done.result.reached, done.result.reason
    assert len(done.spliced) == 1
    told = done.comparison()
    assert told.agrees, told.explain()
    assert done.longest_pause_s() > 0.5
    assert not any(done.record.lost_full_steps)
    done.require_clear()


def test_where_nothing_leads_on_the_arm_stops_and_says_why(plan):
    x, y = tip_at(plan, 1.0)
    done = Outcome([Arrival(0.2 * plan.trajectory.duration_s, circle(x, y, 4.0))], beside=prompt())
    (one,) = done.result.encounters
    assert one.verdict == "avoided"
    assert one.stopped_because
    assert not done.result.reached
    assert done.spliced == []
    assert not any(done.record.lost_full_steps)
    done.require_clear()


def test_an_obstacle_before_the_border_is_stopped_for(plan):
    x, y = tip_at(plan, 0.38)
    done = Outcome([Arrival(0.2 * plan.trajectory.duration_s, circle(x, y, 1.0))], beside=prompt())
    (one,) = done.result.encounters
    assert (one.verdict, one.stopped_because) == ("avoided", "it is before where the motion could be left")
    assert done.spliced == []
    assert not any(done.record.lost_full_steps)
    done.require_clear()


def test_an_obstacle_that_comes_while_another_is_planned_around(plan):
    """What is planned then is of no use; it is planned once more, among both."""
    x, y = tip_at(plan, 0.9)
    at_s = 0.2 * plan.trajectory.duration_s
    done = Outcome([Arrival(at_s, circle(x, y, 1.0)), Arrival(at_s + 0.04, circle(0.0, -35.0, 4.0))], beside=prompt())
    assert len(done.result.encounters) == 2
    assert done.result.reached, done.result.reason
    (new,) = done.spliced
    assert new.notice_to_certified_ms == pytest.approx(2e3 * PLANNING_S, abs=20.0)
    assert len(done.result.plans[-1].scene.obstacles) == 2
    assert all(one.closed_edges > 0 for one in done.result.encounters)
    told = done.comparison()
    assert told.agrees, told.explain()
    done.require_clear()


def test_two_splices_in_one_motion(plan):
    """The second leaves the motion that the first went on with."""
    x, y = tip_at(plan, 0.7)
    begin = Arrival(0.1 * plan.trajectory.duration_s, circle(x, y, 2.0))
    second = Outcome([begin], beside=prompt()).result.plans[-1]
    u, v = tip_at(second, 0.9)
    done = Outcome([begin, Arrival(0.4 * second.trajectory.duration_s, circle(u, v, 2.0))], beside=prompt())
    assert done.result.reached, done.result.reason
    assert len(done.spliced) == 2, done.result.encounters
    told = done.comparison()
    assert told.agrees, told.explain()
    assert told.max_timing_error_ticks <= PIN_TICKS
    assert not any(done.record.lost_full_steps)
    done.require_clear()


def test_a_motion_from_where_the_arm_was_stopped_is_left_at_speed_too(plan):
    """Its start is another than the scene's."""
    x, y = tip_at(plan, 0.38)
    stopping = Arrival(0.2 * plan.trajectory.duration_s, circle(x, y, 1.0))
    stopped = Outcome([stopping], beside=prompt())
    (one,), (rested,), second = stopped.result.encounters, stopped.result.new_plans, stopped.result.plans[-1]
    assert one.stopped_because
    assert rested.spliced_at_s is None
    u, v = tip_at(second, 0.85)
    done = Outcome([stopping, Arrival(one.at_s + rested.rest_s + 0.3, circle(u, v, 2.0))], beside=prompt())
    assert [new.spliced_at_s is None for new in done.result.new_plans] == [True, False], done.result.encounters
    assert done.result.reached, done.result.reason
    assert done.result.plans[-1].scene.task.start_rad == second.scene.task.start_rad
    assert not any(done.record.lost_full_steps)
    done.require_clear()


def test_where_the_arm_rested_on_the_way_is_known_when_the_next_obstacle_comes(plan):
    """The path clock stood still for a second, so the arm is not where it would be by the time since the start."""
    x, y = tip_at(plan, 0.85)
    begin = Arrival(0.2 * plan.trajectory.duration_s, circle(x, y, 2.0))
    second = Outcome([begin], beside=Slow(perf_counter, 1.5)).result.plans[-1]
    u, v = tip_at(second, 0.95)
    done = Outcome([begin, Arrival(begin.at_s + 1.55, circle(u, v, 1.0))], beside=Slow(perf_counter, 1.5))
    assert [one.verdict for one in done.result.encounters] == ["avoided", "avoided"], done.result.encounters
    assert not any(done.record.lost_full_steps)
    done.require_clear()


@pytest.mark.parametrize("links", [3, 4])
def test_arms_of_three_and_four_links_go_on_at_speed(links, sized, capsys):
    """Random obstacles at random times on uno_four: no lost step and no contact; the goal, or a reason."""
    scene = scene_with_links(links)
    first = first_plan(scene, quiet)[1]
    assert first.certificate.ok, first.certificate.explain()
    rng = np.random.default_rng(links)
    verdicts, reached, spliced, on_time = [], 0, 0, 0
    for number in range(sized(2, 40)):
        share = float(rng.uniform(0.05, 0.5))
        near = tip_at(first, min(1.0, share + float(rng.uniform(0.25, 0.6)))) + rng.normal(0.0, 2.0, 2)
        arrival = Arrival(share * first.trajectory.duration_s, circle(*near, rng.uniform(1.0, 3.0)))
        done = Outcome([arrival], scene, prompt())
        verdicts += [one.verdict for one in done.result.encounters]
        reached += done.result.reached
        assert done.result.reached or done.result.reason, (number, arrival)
        assert not any(done.record.lost_full_steps), (number, arrival)
        assert not done.record.broken_rules, (number, arrival)
        done.require_clear()
        if done.spliced and len(done.spliced) == len(done.result.new_plans):
            spliced += 1
            told = done.comparison()
            assert told.agrees, (number, told.explain())
            on_time += told.max_timing_error_ticks <= INTERRUPT_TICKS
            assert done.longest_pause_s() < 0.1, (number, arrival)
    if len(verdicts) >= 40:
        assert spliced > 0.2 * len(verdicts)
        with capsys.disabled():
            counts = {verdict: verdicts.count(verdict) for verdict in ("kept", "avoided", "unavoidable")}
            print(f"\n{links} links: {counts}, goal reached {reached}, left at speed {spliced}, on time {on_time}")


JERK_RAD_S3 = 250.0
IN_THE_WAY = replace(SCENE, obstacles=(circle(8.4, 40.6, 6.0),))
"""The fastest path around it is no rounded polyline."""
KINDS = {
    "jerk": with_jerk(SCENE, JERK_RAD_S3),
    "time": by_time(IN_THE_WAY, 0.2),
    "time and jerk": by_time(with_jerk(IN_THE_WAY, JERK_RAD_S3), 0.2),
}


@pytest.mark.parametrize("kind", KINDS)
def test_motions_with_a_limit_of_jerk_or_optimised_for_time_go_on_at_speed(kind, sized, capsys, monkeypatch):
    """Random obstacles at random times: no lost step and no contact; the goal, or a reason for the stop.

    What is left at speed makes every step at its certified time, and keeps the jerk across the border. The small run
    goes on until there is one: some kinds seldom are.
    """
    scene = KINDS[kind]
    monkeypatch.setattr(motion, "time", CountedTime())  # however busy the computer is, the plan is the same
    first = first_plan(scene, quiet)[1]
    assert first.certificate.ok, first.certificate.explain()
    rng = np.random.default_rng(len(kind))
    verdicts, reached, spliced, stops = [], 0, 0, []
    for number in range(sized(20, 100)):
        if number >= sized(3, 100) and spliced:
            break
        share = float(rng.uniform(0.05, 0.4))
        near = tip_at(first, min(1.0, share + float(rng.uniform(0.3, 0.6)))) + rng.normal(0.0, 1.5, 2)
        arrival = Arrival(share * first.trajectory.duration_s, circle(*near, rng.uniform(1.0, 3.0)))
        done = Outcome([arrival], scene, prompt())
        (one,) = done.result.encounters
        verdicts.append(one.verdict)
        stops += [one.stopped_because] if one.stopped_because else []
        reached += done.result.reached
        assert done.result.reached or done.result.reason, (number, arrival)
        assert not any(done.record.lost_full_steps), (number, arrival)
        assert not done.record.broken_rules, (number, arrival)
        assert one.verdict != "avoided" or one.stopped_because or done.spliced, (number, arrival)
        done.require_clear()
        if done.spliced and len(done.spliced) == len(done.result.new_plans):
            spliced += 1
            told = done.comparison()
            assert told.agrees, (number, told.explain())
            assert told.max_timing_error_ticks <= PIN_TICKS, (number, arrival)
            last = done.result.plans[-1]
            assert last.certificate.ok
            assert "jerk" not in kind or (largest_jerks(last.trajectory)[0] <= JERK_RAD_S3).all()
    assert spliced, stops
    if len(verdicts) >= 100:
        counts = {verdict: verdicts.count(verdict) for verdict in ("kept", "avoided", "unavoidable")}
        with capsys.disabled():
            print(f"\n{kind}: {counts}, goal reached {reached}, left at speed {spliced}")
        assert spliced > (0.4 if kind == "jerk" else 0.1) * counts["avoided"], stops
