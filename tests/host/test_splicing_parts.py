"""What a motion that is left at speed is made of: parts of paths, timing from a speed, segments that stay, borders."""

import re
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from live_runs import SCENE, CountedTime, by_time, circle, quiet, tip_at, with_jerk
from planarm.errors import CertificateError, NoPathError, TimingError
from planarm.link.packing import Packer
from planarm.link.session import Session
from planarm.link.stream import Stream
from planarm.model.shapes import shape_of
from planarm.model.transmission import motor_axes
from planarm.motions import motion
from planarm.motions.margin import planning_margin_cm
from planarm.operations.replanning import first_plan
from planarm.operations.splicing import Border, first_border, plan_from_border, why_not
from planarm.operations.tails import is_rounded, tails_along_tangents
from planarm.smoothing.joint_spline import part_of, run_on, scaled
from planarm.stepping.certify import certify
from planarm.stepping.schedule import with_first_steps
from planarm.stepping.segments import Coding, compress, expand
from planarm.trajectory.jerk import STEP_S, largest_jerks, mean_of
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import joint_world, prove_pieces
from planarm.workspace.proof import PROVED
from planarm_wire.messages import SLICE_TICKS, STARVING_TICKS, TICKS_HZ
from planarm_wire.steps import duration_ticks

LIMITS = Limits.of(SCENE)


@pytest.fixture(scope="module")
def first():
    return first_plan(SCENE, quiet)


@pytest.fixture(scope="module")
def plan(first):
    return first[1]


def test_parts_of_a_path_are_the_path(plan):
    path, end = plan.trajectory.path, float(plan.trajectory.path.borders_s[-1])
    rng = np.random.default_rng(1)
    for low, high in np.sort(rng.uniform(0.0, end, (20, 2))):
        part = part_of(path, low, high)
        s = np.linspace(0.0, high - low, 300)[1:-1]
        for made, wanted in zip(part.evaluate(s), path.evaluate(low + s), strict=True):
            assert np.abs(made - wanted).max() < 1e-9
        whole = run_on([part_of(path, 0.0, low), part, part_of(path, high, end)])
        s = np.linspace(0.0, end, 300)[1:-1]
        assert np.abs(whole.evaluate(s).q_rad - path.evaluate(s).q_rad).max() < 1e-12
        assert whole.stops_s == pytest.approx(path.stops_s)


@pytest.mark.parametrize("share", [0.1, 0.35, 0.5, 0.8, 0.95])
def test_from_a_speed_on_the_fastest_motion_is_the_rest_of_the_fastest_motion(plan, share):
    whole = plan.trajectory
    at_s, rate = whole.path_at(share * whole.duration_s)
    rest = fastest_motion(part_of(whole.path, at_s, float(whole.path.borders_s[-1])), LIMITS, start_rate=rate)
    assert rest.s_dot[0] == rate
    assert rest.duration_s == pytest.approx((1.0 - share) * whole.duration_s, rel=2e-3)
    both = whole.left_for(whole.path, share * whole.duration_s, rest)
    t_s = np.linspace(0.0, both.duration_s, 4000)
    q_rad, speeds, _ = both.sample(t_s)
    assert np.abs(np.diff(q_rad, axis=0) / t_s[1] - 0.5 * (speeds[1:] + speeds[:-1])).max() < 0.02


def test_a_speed_from_which_nothing_can_slow_down_in_time_is_told(plan):
    whole = plan.trajectory
    end_s = float(whole.path.borders_s[-1])
    at_s, _ = whole.path_at(0.98 * whole.duration_s)
    with pytest.raises(TimingError, match="cannot be slowed down in time"):
        fastest_motion(part_of(whole.path, at_s, end_s), LIMITS, start_rate=2.0)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.77, 0.97])
def test_segments_that_stay_stay_and_the_others_make_the_other_steps(plan, share):
    coding = Coding.of(motor_axes(SCENE.joints, SCENE.coupling))
    kept = plan.segments.segments[: int(share * len(plan.segments.segments))]
    made = compress(plan.train, coding, kept=kept)
    assert made.segments[: len(kept)] == kept
    assert made.duration_ticks == plan.segments.duration_ticks
    for wanted, steps in zip(plan.train.steps, expand(made).steps, strict=True):
        assert (steps.directions == wanted.directions).all()
        assert np.abs(steps.ticks - wanted.ticks).max() <= max(16, 0.02 * np.diff(wanted.ticks).max())


def test_a_motion_with_other_first_steps_is_refused(plan):
    train = plan.train
    late = replace(train, steps=tuple(replace(one, ticks=one.ticks + 1000) for one in train.steps))
    assert with_first_steps(train, [0, 0], late).steps[0].ticks[0] == late.steps[0].ticks[0]
    with pytest.raises(TimingError, match="joint 1 makes other steps than before"):
        with_first_steps(train, [10, 0], late)
    turned = replace(train, steps=tuple(replace(one, directions=-one.directions) for one in train.steps))
    with pytest.raises(TimingError, match="joint 2 makes other steps than before"):
        with_first_steps(train, [0, 3], turned)


@pytest.mark.parametrize("ready_s", [0.05, 0.3, 0.7, 1.1])
def test_a_border_leaves_the_device_enough_until_the_other_motion_is_there(plan, ready_s):
    """The firmware's own rule, slice by slice: no slice that it prepares by then is starving, with 15 ms to spare."""
    border = first_border(plan, 0, ready_s)
    needed, start = 0, 0
    for segment, allowance in zip(plan.segments.segments, plan.segments.allowances, strict=True):
        end = start + duration_ticks(segment)
        for path_at in range(start, end, SLICE_TICKS):
            if path_at <= ready_s * TICKS_HZ + 4 * SLICE_TICKS:
                needed = max(needed, min(path_at + SLICE_TICKS, end) + allowance.need_ticks + STARVING_TICKS + 240_000)
        start = end
    assert border.tick >= needed
    assert border.tick == sum(map(duration_ticks, plan.segments.segments[: border.segment]))
    before = border.tick - duration_ticks(plan.segments.segments[border.segment - 1])
    assert before < needed + 6 * SLICE_TICKS  # and not much more
    assert first_border(plan, border.segment + 5, ready_s).segment == border.segment + 5
    assert first_border(plan, 0, plan.trajectory.duration_s) is None


def test_a_way_that_is_no_way_in_joint_space_is_not_left(plan):
    assert why_not(plan) == ""
    assert "no way in joint space" in why_not(replace(plan, joint=None))


@pytest.mark.parametrize("share", [0.2, 0.35, 0.5, 0.8])
def test_a_mean_that_is_left_goes_on_with_the_same_speed_and_acceleration(plan, share):
    """Up to the step nothing changes, and behind it the jerk is bounded by both motions' accelerations."""
    whole, jerks = plan.trajectory, np.array([250.0, 250.0])
    mean = mean_of(whole, jerks)
    before, step = mean.trajectory(plan.trajectory.path.arm), int(share * whole.duration_s / STEP_S)
    at_s, rate = whole.path_at(step * STEP_S)
    end_s = float(whole.path.borders_s[-1])
    harder = replace(LIMITS, accelerations_rad_s2=1.15 * LIMITS.accelerations_rad_s2)
    rest = fastest_motion(part_of(whole.path, at_s, end_s), harder, start_rate=rate)
    other = mean.left_for(whole.left_for(whole.path, step * STEP_S, rest), step)
    after = other.trajectory(plan.trajectory.path.arm)
    t_s = np.linspace(0.0, step * STEP_S, 500)[:-1]
    for made, wanted in zip(after.sample(t_s), before.sample(t_s), strict=True):
        assert np.abs(made - wanted).max() < 1e-9
    near_s = np.array([step * STEP_S - 1e-6, step * STEP_S + 1e-6])
    for values in after.sample(near_s):
        assert np.abs(np.diff(values, axis=0)).max() < 1e-2
    assert after.sample(np.array([after.duration_s]))[0][0] == pytest.approx(whole.q_rad[-1], abs=1e-9)
    assert other.keeps(jerks) == bool((largest_jerks(after)[0] <= jerks).all())


def test_a_scaled_path_is_the_same_path(plan):
    path = plan.trajectory.path
    other = scaled(path, 3.0)
    s = np.linspace(0.0, float(other.borders_s[-1]), 200)
    state, wanted = other.evaluate(s), path.evaluate(3.0 * s)
    assert np.abs(state.q_rad - wanted.q_rad).max() < 1e-9
    assert np.abs(state.dq_rad - 3.0 * wanted.dq_rad).max() < 1e-9
    assert np.abs(state.ddq_rad - 9.0 * wanted.ddq_rad).max() < 1e-7


@pytest.mark.parametrize("at", [0.1, 0.35, 0.6])
def test_ways_along_tangents_leave_any_path_without_a_corner(first, at):
    """They begin where the path is left, in its direction and at its rate, are free, and end at the goal."""
    task, plan = first
    path, world = plan.trajectory.path, joint_world(SCENE, planning_margin_cm(SCENE))
    stretched = scaled(path, 2.5)  # dq/ds of another length
    at_s = at * float(stretched.borders_s[-1])
    found = list(islice(tails_along_tangents(SCENE, task, stretched, at_s, world), 4))
    assert found
    left = stretched.evaluate(np.array([at_s]))
    for tail in found:
        begin = tail.path.evaluate(np.zeros(1))
        assert begin.q_rad == pytest.approx(left.q_rad, abs=1e-9)
        assert begin.dq_rad == pytest.approx(left.dq_rad, abs=1e-9)
        end = tail.path.evaluate(tail.path.borders_s[-1:], "left").q_rad[0]
        assert end == pytest.approx(np.array(SCENE.task.goal_rad), abs=1e-9)
        assert prove_pieces(world, tail.path.borders_s, tail.path.coefficients)[0] == PROVED
        inner = tail.path.borders_s[1:-1]
        turns = tail.path.evaluate(inner, "left").dq_rad - tail.path.evaluate(inner).dq_rad
        assert np.abs(turns).max(initial=0.0) < 1e-9
    assert not is_rounded(stretched, plan.joint.poses_rad)
    assert is_rounded(path, plan.joint.poses_rad)


IN_THE_WAY = by_time(replace(SCENE, obstacles=(circle(8.4, 40.6, 6.0),)), 0.2)


@pytest.mark.parametrize("scene", [with_jerk(SCENE, 250.0), IN_THE_WAY], ids=["jerk", "time"])
def test_other_motions_are_left_at_speed_and_acceleration(scene, monkeypatch):
    """Around an obstacle: certified, the same up to the border, without a jump of speed, with limits of jerk of
    acceleration either; and where nothing leads on it says so."""
    monkeypatch.setattr(motion, "time", CountedTime())
    task, plan = first_plan(scene, quiet)
    border, margin_cm = first_border(plan, 0, 0.1), planning_margin_cm(scene)
    obstacle = circle(*tip_at(plan, 0.8), 2.0)
    _, changes = task.roadmap.add_obstacle(shape_of(obstacle))
    task.planner.change(changes)
    among = replace(scene, obstacles=(*scene.obstacles, obstacle))
    other = plan_from_border(among, task, plan, border, 0.0, margin_cm)
    assert other.certificate.ok
    assert not certify(among, plan.trajectory, plan.train, plan.segments).ok
    assert other.segments.segments[: border.segment] == plan.segments.segments[: border.segment]
    t_s = np.linspace(0.0, border.path_s, 300)[:-1]
    assert np.abs(other.trajectory.sample(t_s)[0] - plan.trajectory.sample(t_s)[0]).max() < 1e-7
    t_s = np.arange(0.0, other.trajectory.duration_s, 1e-3)
    _, speeds, accelerations = other.trajectory.sample(t_s)
    most = max(joint.max_acceleration_rad_s2 for joint in scene.joints)
    assert np.abs(np.diff(speeds, axis=0)).max() < 1.1e-3 * most
    if scene.joints[0].max_jerk_rad_s3 is not None:
        assert np.abs(np.diff(accelerations, axis=0)).max() < 1.05e-3 * scene.joints[0].max_jerk_rad_s3
    closed = circle(*tip_at(plan, 1.0), 3.0)
    with pytest.raises((NoPathError, TimingError, CertificateError)):
        plan_from_border(replace(scene, obstacles=(closed,)), task, plan, border, 0.0, margin_cm)


def test_clearance_is_looked_at_from_where_the_arm_is(plan):
    """What has been executed is past: an obstacle behind the arm is none."""
    behind = replace(plan.scene, obstacles=(circle(*tip_at(plan, 0.1), 2.0),))
    parts = plan.trajectory, plan.train, plan.segments
    assert not certify(behind, *parts).ok
    passed = certify(behind, *parts, from_ticks=int(0.6 * plan.segments.duration_ticks))
    assert passed.ok, passed.explain()
    assert len(passed.checks) == len(certify(behind, *parts).checks)


def test_a_new_motion_is_certified_or_refused(first):
    """Told allowances of segments that stay hold for the new motion, too, or there is none."""
    task, plan = first
    border = first_border(plan, 0, 0.3)
    same = plan_from_border(plan.scene, task, plan, border, 0.0, planning_margin_cm(SCENE))
    assert same.certificate.ok
    assert same.segments.allowances[: border.segment] == plan.segments.allowances[: border.segment]
    assert same.trajectory.duration_s == pytest.approx(plan.trajectory.duration_s, rel=0.05)
    with pytest.raises((TimingError, CertificateError)):
        weak = tuple(replace(joint, max_acceleration_rad_s2=3.0) for joint in SCENE.joints)
        plan_from_border(replace(SCENE, joints=weak), task, plan, border, 0.0, planning_margin_cm(SCENE))


def test_a_packer_keeps_segments_back_until_it_is_given_others(plan):
    segments, allowances = plan.segments.segments, plan.segments.allowances
    packer = Packer(Session(1, 0.0), segments, allowances)
    packer.next_message()
    packer.keep_back(3)
    taken = []
    while (message := packer.next_message()) is not None:
        taken += message.segments
        packer.take()
    assert tuple(taken) == segments[:3]
    with pytest.raises(ValueError, match="segment 2 cannot be kept back: 3 were taken"):
        packer.keep_back(2)
    packer.go_on_with(segments[:4], allowances[:4])
    assert packer.next_message().segments == segments[3:4]


def test_a_stream_takes_no_plan_that_begins_otherwise(plan):
    segments, allowances = plan.segments.segments, plan.segments.allowances
    stream = Stream(Session(1, 0.0), segments)
    stream._feed.join_at(2)
    other = (segments[0], segments[2], *segments[3:])
    with pytest.raises(CertificateError, match="other segments than the 2 that were sent"):
        stream.go_on_with(other, allowances[1:])
    with pytest.raises(CertificateError, match="the last of the motion"):
        stream.go_on_with(segments[:-1], allowances[:-1])
    shorter = (*segments[:5], segments[-1])
    stream.go_on_with(shorter, allowances[:6])
    assert stream.total_segments == 6


def test_a_border_tells_its_time():
    assert Border(3, TICKS_HZ // 2).path_s == 0.5


def test_how_much_the_device_wants_to_hold_is_written_once():
    """In messages.toml: firmware, margin of the line and borders of motions go by the same."""
    root = Path(__file__).resolve().parents[2]
    places = (
        *root.glob("firmware/core/*.cpp"),
        *root.glob("host/planarm/link/*.py"),
        *root.glob("host/planarm/operations/*.py"),
    )
    users = [path.name for path in places if "STARVING_TICKS" in path.read_text()]
    assert sorted(users) == ["margin.py", "motion.cpp", "splicing.py"]
    assert [path.name for path in places if re.search(r"\b65_?536\b", path.read_text())] == []
