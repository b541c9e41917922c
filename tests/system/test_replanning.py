"""Obstacles that appear while the emulated arm moves: kept clear of, or the stop before them explained."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest

from planarm.link.arm_record import ArmSetup
from planarm.link.transport import open_transport
from planarm.model.arm import Arm
from planarm.model.collision import pose_clearance_cm
from planarm.model.kinematics import forward
from planarm.model.shapes import obstacle_set, shape_of
from planarm.operations.arrivals import Listed
from planarm.operations.replanning import GENTLE_SHARE, first_plan, judge, rest_time_s, run_live
from planarm.pipeline import planning_margin_cm
from planarm.scene import MechanicsSpec, Obstacle, load_scene
from planarm.scene.arrivals import Arrival
from planarm_wire.messages import TICKS_HZ

LENGTHS = (18.0, 26.0)
START, GOAL = (-0.3, 0.9), (2.2, 0.5)
SETTLE_S = 0.3


def scene_of():
    """The example's motors on a short inner link, so that the arm can fold past what stands in its way; fast joints.

    Motors follow their steps within about a millimetre, and swing after a stop: 3 mm of clearance are kept for that.
    """
    scene = load_scene(Path(__file__).resolve().parents[2] / "examples" / "energy_two_links.toml")
    arm = replace(scene.arm, link_lengths_cm=LENGTHS)
    tips = [tuple(map(float, forward(Arm.from_spec(arm), q)[-1])) for q in (START, GOAL)]
    return replace(
        scene,
        arm=arm,
        joints=tuple(replace(j, max_speed_rad_s=2.5, max_acceleration_rad_s2=12.0) for j in scene.joints),
        mechanics=MechanicsSpec.usual(LENGTHS),
        obstacles=(),
        workspace=replace(scene.workspace, clearance_cm=0.3),
        task=replace(scene.task, start_rad=START, goal_rad=GOAL, start_cm=tips[0], goal_cm=tips[1]),
        roadmap=replace(scene.roadmap, nodes=1500, cost="time"),
    )


SCENE = scene_of()
ARM = Arm.from_spec(SCENE.arm)


def quiet(_stage, _share):
    pass


@pytest.fixture(scope="module")
def plan():
    return first_plan(SCENE, quiet)[1]


class Outcome:
    """One run on the emulated Uno, and what its arm really did."""

    def __init__(self, arrivals, scene=SCENE):
        first = first_plan(scene, quiet)
        setup = ArmSetup(scene, first[1].segments.start_usteps)
        with closing(open_transport("sim://", 250_000, setup)) as line:
            self.result = run_live(scene, line, Listed(arrivals), quiet, perf_counter, first)
            line.arm.settle(SETTLE_S)
            self.record = line.arm.record()

    def least_clearance_cm(self, encounter):
        """Of the links' centre lines from the obstacle, from its appearing on, by the emulated arm's own angles."""
        appeared = (self.result.began_s + encounter.at_s) * TICKS_HZ
        poses = self.record.q_rad[self.record.ticks >= appeared]
        obstacles = obstacle_set([shape_of(encounter.obstacle)])
        return min(pose_clearance_cm(ARM, q, obstacles) for q in poses[::4])

    def inside_at_once(self, encounter):
        """Whether the obstacle appeared where the arm was."""
        appeared = (self.result.began_s + encounter.at_s) * TICKS_HZ
        pose = self.record.q_rad[np.searchsorted(self.record.ticks, appeared)]
        return (
            pose_clearance_cm(ARM, pose, obstacle_set([shape_of(encounter.obstacle)])) <= 0.5 * SCENE.arm.link_width_cm
        )


def tip_at(plan, share):
    q_rad, *_ = plan.trajectory.sample(np.array([share * plan.trajectory.duration_s]))
    return forward(ARM, q_rad)[0, -1]


def circle(x, y, diameter):
    return Obstacle("circle", (float(x), float(y)), float(diameter))


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


def test_random_obstacles_at_random_times(sized, plan, capsys):
    """No contact and no lost step, and the goal or a reason; the unavoidable ones are those that come too near.

    Prints the time from notice to the new plan being certified.
    """
    rng = np.random.default_rng(2)
    verdicts, waits_ms, reached = [], [], 0
    for number in range(sized(3, 100)):
        share = float(rng.uniform(0.05, 0.9))
        near = tip_at(plan, min(1.0, share + float(rng.uniform(0.05, 0.6)))) + rng.normal(0.0, 3.0, 2)
        arrival = Arrival(share * plan.trajectory.duration_s, circle(*near, rng.uniform(1.0, 5.0)))
        done = Outcome([arrival])
        (one,) = done.result.encounters
        verdicts.append(one.verdict)
        reached += done.result.reached
        waits_ms += [new.notice_to_certified_ms for new in done.result.new_plans]
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
        with capsys.disabled():
            middle, most = np.percentile(waits_ms, [50, 99])
            print(f"\n{counts}, goal reached {reached}; notice to certified {middle:.0f} ms median, {most:.0f} ms p99")
