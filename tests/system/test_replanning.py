"""Obstacles that appear while the emulated arm moves: kept clear of, or the stop before them explained."""

from time import process_time

import numpy as np
import pytest

from live_runs import GOAL, SCENE, Outcome, circle, quiet, tip_at
from planarm.model.shapes import shape_of
from planarm.motions.margin import planning_margin_cm
from planarm.operations.beside import AsLong
from planarm.operations.replanning import first_plan
from planarm.operations.verdicts import GENTLE_SHARE, judge, rest_time_s
from planarm.scene import Obstacle
from planarm.scene.arrivals import Arrival


@pytest.fixture(scope="module")
def plan():
    return first_plan(SCENE, quiet)[1]


def test_an_obstacle_far_from_the_rest_of_the_way_changes_nothing(plan):
    done = Outcome([Arrival(0.4, circle(0.0, -35.0, 4.0))])
    assert [one.verdict for one in done.result.encounters] == ["kept"]
    assert done.result.reached
    assert len(done.result.plans) == 1
    assert done.result.end_rad == pytest.approx(np.array(GOAL), abs=1e-3)


def test_an_obstacle_on_the_way_ahead_is_gone_around(plan):
    x, y = tip_at(plan, 0.85)
    done = Outcome([Arrival(0.3 * plan.trajectory.duration_s, circle(x, y, 2.0))])
    assert [one.verdict for one in done.result.encounters] == ["avoided"]
    assert done.result.reached, done.result.reason
    assert done.least_clearance_cm(done.result.encounters[0]) > 0.5 * SCENE.arm.link_width_cm
    assert done.result.end_rad == pytest.approx(np.array(GOAL), abs=1e-3)
    assert len(done.result.plans) == 2
    assert done.result.plans[1].certificate.ok
    assert len(done.result.plans[1].scene.obstacles) == 1
    assert not any(done.record.lost_full_steps)
    told = done.result.figures()
    assert told["encounters"][0]["obstacle"].startswith("circle at (")
    assert told["new_plans"][0]["rest_s"] < 0.6


def test_an_obstacle_in_the_arm_is_unavoidable_and_told(plan):
    at_s = 0.5 * plan.trajectory.duration_s
    x, y = tip_at(plan, 0.52)
    done = Outcome([Arrival(at_s, circle(x, y, 5.0))])
    assert [one.verdict for one in done.result.encounters] == ["unavoidable"]
    assert not done.result.reached
    assert "unavoidable" in done.result.reason
    assert not any(done.record.lost_full_steps)


def test_a_closed_way_is_a_stop_with_its_reason(plan):
    wall = Obstacle("polygon", vertices_cm=((-1, 5), (1, 5), (1, 60), (-1, 60)))
    other = Obstacle("polygon", vertices_cm=((-1, -60), (1, -60), (1, -5), (-1, -5)))
    done = Outcome([Arrival(0.1, wall), Arrival(0.1, other)])
    assert not done.result.reached
    assert "no way leads on from tip" in done.result.reason
    assert not any(done.record.lost_full_steps)


def test_two_obstacles_one_after_the_other(plan):
    (x, y), (u, v) = tip_at(plan, 0.9), tip_at(plan, 0.6)
    done = Outcome([Arrival(0.2, circle(x, y, 2.0)), Arrival(0.9, circle(u, v, 1.0))])
    assert len(done.result.encounters) == 2
    assert not any(done.record.lost_full_steps)
    for one in done.result.encounters:
        if one.verdict != "unavoidable":
            assert done.least_clearance_cm(one) > 0.5 * SCENE.arm.link_width_cm


def test_the_verdict_is_about_what_lies_ahead(plan):
    """The same obstacle: unavoidable just before the arm is there, avoided long before, kept once it has passed."""
    margin, end_s = planning_margin_cm(SCENE), plan.trajectory.duration_s
    x, y = tip_at(plan, 0.5)
    shape = shape_of(circle(x, y, 1.0))
    told = [judge(plan, shape, margin, share * end_s, share * end_s) for share in (0.05, 0.45, 0.8)]
    assert told == [("avoided", False), ("unavoidable", True), ("kept", False)]
    quick = [judge(plan, shape, margin, at_s, at_s) for at_s in np.linspace(0.05 * end_s, 0.45 * end_s, 60)]
    assert ("avoided", True) in quick


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_the_arm_rests_no_later_than_the_rule_says_and_not_much_sooner(plan, share):
    """Stopped by an obstacle on the goal; the path time at rest, by the emulated board's ledger."""
    done = Outcome([Arrival(share * plan.trajectory.duration_s, circle(*tip_at(plan, 1.0), 4.0))])
    (one,) = done.result.encounters
    t_s = np.linspace(0.0, plan.trajectory.duration_s, 5000)
    poses, *_ = plan.trajectory.sample(t_s)
    rested_s = float(t_s[np.argmin(np.abs(poses - done.result.end_rad).sum(axis=1))])
    latest_s = rest_time_s(plan, one.at_s, GENTLE_SHARE)
    assert (one.verdict, one.quick) == ("avoided", False)
    assert latest_s - 0.3 < rested_s < latest_s + 0.001


class Timed(AsLong):
    """Takes its processor time, which other programs do not lengthen, and is allowed a tenth of a second."""

    def allow_s(self, _known_s):
        return 0.1


def test_random_obstacles_at_random_times(sized, plan, capsys):
    """No contact and no lost step, and the goal or a reason; the unavoidable ones are those that come too near.

    Prints how many motions were left at speed, and the times from notice to the new plan being certified.
    """
    rng = np.random.default_rng(2)
    verdicts, reached, stops = [], 0, []
    waits_ms = {"at speed": [], "at rest": []}
    for number in range(sized(3, 100)):
        share = float(rng.uniform(0.05, 0.9))
        near = tip_at(plan, min(1.0, share + float(rng.uniform(0.05, 0.6)))) + rng.normal(0.0, 3.0, 2)
        arrival = Arrival(share * plan.trajectory.duration_s, circle(*near, rng.uniform(1.0, 5.0)))
        done = Outcome([arrival], beside=Timed(process_time))
        (one,) = done.result.encounters
        verdicts.append(one.verdict)
        reached += done.result.reached
        for new in done.result.new_plans:
            waits_ms["at rest" if new.spliced_at_s is None else "at speed"].append(new.notice_to_certified_ms)
        stops += [one.stopped_because] if one.stopped_because else []
        assert not any(done.record.lost_full_steps), (number, arrival)
        assert not done.record.broken_rules, (number, arrival)
        assert done.result.reached or done.result.reason, (number, arrival)
        if one.verdict != "unavoidable":
            assert done.least_clearance_cm(one) > 0.5 * SCENE.arm.link_width_cm, (number, arrival)
        if done.inside_at_once(one):
            assert one.verdict == "unavoidable", (number, arrival)
    counts = {verdict: verdicts.count(verdict) for verdict in ("kept", "avoided", "unavoidable")}
    if len(verdicts) >= 100:
        assert min(counts.values()) > 0, counts
        assert len(waits_ms["at speed"]) > 0.3 * counts["avoided"], stops
        with capsys.disabled():
            print(f"\n{counts}, goal reached {reached}; left at speed {len(waits_ms['at speed'])}")
            for how, values in waits_ms.items():
                middle, most = np.percentile(values, [50, 99])
                print(f"notice to certified, {how}: {middle:.0f} ms median, {most:.0f} ms p99")
