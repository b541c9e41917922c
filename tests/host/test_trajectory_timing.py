"""Timing: closed forms of single-joint moves, limits by differences of positions, scaling laws, and what is refused."""

from math import inf, nan, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motion_paths import JointCurve, joint, joint_line, tip_path, tip_points, waves
from planarm.errors import TimingError
from planarm.trajectory.check import limit_use
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion, time_path


def least_time_s(way, speed, acceleration):
    """Rest to rest in one joint: triangle or trapezoid of speed."""
    if way < speed**2 / acceleration:
        return 2.0 * sqrt(way / acceleration)
    return way / speed + speed / acceleration


def differences(trajectory, count=20_001):
    """Speeds and accelerations from positions alone: mean values over short times, so never above the true largest."""
    t_s = np.linspace(0.0, trajectory.duration_s, count)
    q = trajectory.sample(t_s)[0]
    return np.abs(np.diff(q, axis=0)) / t_s[1], np.abs(np.diff(q, n=2, axis=0)) / t_s[1] ** 2


@settings(max_examples=60, deadline=None)
@given(way=st.floats(1e-4, 6.0), speed=st.floats(0.1, 5.0), acceleration=st.floats(0.5, 50.0))
def test_one_joint_takes_the_time_of_the_closed_form(way, speed, acceleration):
    joints = [joint(speed, acceleration), joint(speed, acceleration)]
    made = time_path(joint_line((0.2, 0.1), (0.2 - way, 0.1 + 0.3 * way)), joints, share=1.0)
    assert made.duration_s == pytest.approx(least_time_s(way, speed, acceleration), rel=1e-3)
    assert made.duration_s >= least_time_s(way, speed, acceleration)


def test_the_share_applies_to_the_acceleration_only():
    line = joint_line((0.0, 0.0), (1.0, 0.0))
    assert time_path(line, [joint(), joint()], share=0.5).duration_s == pytest.approx(
        least_time_s(1.0, 2.0, 5.0), rel=1e-3
    )


def random_path(seed, cornered):
    rng = np.random.default_rng(seed)
    return tip_path(tip_points(rng, 6), float(rng.uniform(0.02, 2.0))) if cornered else waves(rng)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    cornered=st.booleans(),
    speeds=st.tuples(st.floats(0.2, 4.0), st.floats(0.2, 4.0)),
    accelerations=st.tuples(st.floats(1.0, 40.0), st.floats(1.0, 40.0)),
)
def test_no_limit_is_exceeded_and_the_motion_uses_one(seed, cornered, speeds, accelerations):
    path = random_path(seed, cornered)
    made = time_path(path, [joint(v, a) for v, a in zip(speeds, accelerations, strict=True)])
    speed, acceleration = differences(made)
    # The rounding of 1e-15 rad in the angles, over the squared step.
    noise = 1e-14 / (made.duration_s / 20_000) ** 2
    assert (speed.max(axis=0) <= speeds).all()
    assert (acceleration.max(axis=0) <= 0.8 * np.array(accelerations) + noise).all()
    # Fastest: nearly everywhere some limit is used up.
    use = limit_use(made, Limits(np.array(speeds), 0.8 * np.array(accelerations), 1.0))
    used = np.maximum(use.speed, use.acceleration).max(axis=1)
    assert np.median(used) > 0.99


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), cornered=st.booleans(), faster=st.floats(1.0, 3.0), stronger=st.floats(1.0, 3.0))
def test_higher_limits_never_take_longer(seed, cornered, faster, stronger):
    path = random_path(seed, cornered)
    slow = time_path(path, [joint(1.0, 5.0), joint(1.5, 8.0)])
    fast = time_path(path, [joint(faster, 5.0 * stronger), joint(1.5 * faster, 8.0 * stronger)])
    assert fast.duration_s <= slow.duration_s * (1.0 + 1e-4)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), cornered=st.booleans(), factor=st.floats(0.3, 3.0))
def test_running_the_clock_faster_is_the_same_motion(seed, cornered, factor):
    path = random_path(seed, cornered)
    one = time_path(path, [joint(1.0, 5.0), joint(1.5, 8.0)])
    other = time_path(path, [joint(factor, 5.0 * factor**2), joint(1.5 * factor, 8.0 * factor**2)])
    assert other.duration_s * factor == pytest.approx(one.duration_s, rel=1e-4)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), cornered=st.booleans())
def test_samples_are_one_motion(seed, cornered):
    path = random_path(seed, cornered)
    made = time_path(path, [joint(), joint()])
    assert (np.diff(made.t_s) > 0.0).all()
    assert (np.diff(made.s) > 0.0).all()
    t_s = np.sort(np.random.default_rng(seed).uniform(0.0, made.duration_s, 500))
    qd = made.sample(t_s)[1]
    h = 1e-5
    assert (made.sample(t_s + h)[0] - made.sample(t_s - h)[0]) / (2 * h) == pytest.approx(qd, abs=20 * h)
    assert made.sample(made.t_s)[0] == pytest.approx(made.q_rad, abs=1e-9)
    s = np.interp(t_s, made.t_s, made.s)  # any path parameters will do
    assert made.sample(made.time_at(s))[0] == pytest.approx(path.evaluate(s).q_rad, abs=1e-8)


def test_the_arm_rests_before_the_start_and_after_the_end():
    made = time_path(joint_line((0.0, 0.0), (1.0, -0.5)), [joint(), joint()])
    q, qd, qdd = made.sample([-1.0, made.duration_s, made.duration_s + 1.0])
    assert q == pytest.approx(np.array([(0.0, 0.0), (1.0, -0.5), (1.0, -0.5)]), abs=1e-12)
    assert not qd.any()
    assert not qdd.any()


def test_stops_are_stops_and_nothing_else_is():
    path = tip_path([(30.0, 0.0), (40.0, 0.0), (30.0, 0.1), (30.0, 20.0)])
    assert path.stops_s.tolist() == [10.0]
    made = time_path(path, [joint(), joint()])
    resting = made.s[made.s_dot == 0.0]
    assert resting.tolist() == [0.0, 10.0, path.length_cm]


def test_the_grid_holds_every_border():
    path = tip_path(tip_points(np.random.default_rng(3), 8))
    assert np.isin(path.borders_s, time_path(path, [joint(), joint()]).s).all()


def test_a_path_of_one_pose_is_a_trajectory_without_duration():
    made = time_path(tip_path([(30.0, 10.0)]), [joint(), joint()])
    assert made.duration_s == 0.0
    q, qd, _ = made.sample([0.0, 1.0])
    assert np.array_equal(q, np.repeat(made.q_rad, 2, axis=0))
    assert not qd.any()


def test_a_line_that_goes_nowhere_is_a_trajectory_without_duration():
    assert time_path(joint_line((0.3, 0.4), (0.3, 0.4)), [joint(), joint()]).duration_s == 0.0


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (joint(speed=0.0), r"joints\[2\].max_speed_deg_s is 0.0"),
        (joint(speed=nan), r"joints\[2\].max_speed_deg_s is nan"),
        (joint(acceleration=-1.0), r"joints\[2\].max_acceleration_deg_s2 is -57"),
        (joint(acceleration=inf), r"joints\[2\].max_acceleration_deg_s2 is inf"),
    ],
)
def test_impossible_limits_are_named(bad, words):
    with pytest.raises(TimingError, match=words):
        time_path(joint_line((0.0, 0.0), (1.0, 1.0)), [joint(), bad])


@pytest.mark.parametrize("share", [0.0, 1.5, nan])
def test_the_share_is_above_nothing_and_at_most_all(share):
    with pytest.raises(TimingError, match="share"):
        time_path(joint_line((0.0, 0.0), (1.0, 1.0)), [joint(), joint()], share)


def test_a_path_that_is_no_number_is_refused_with_its_place():
    path = JointCurve(lambda s: [s, np.where(s > 0.6, np.nan, s)], lambda s: [1.0, 1.0], lambda s: [0.0, 0.0])
    with pytest.raises(TimingError, match=r"joint 2 .* s = 0\.6"):
        time_path(path, [joint(), joint()])


def test_joints_and_path_must_agree_in_number():
    with pytest.raises(TimingError, match=r"2 joints, the scene 3"):
        time_path(joint_line((0.0, 0.0), (1.0, 1.0)), [joint()] * 3)


@pytest.mark.parametrize("borders", [(0.0, nan), (0.0, 0.5, 0.5, 1.0), (1.0, 0.0)])
def test_borders_must_ascend(borders):
    path = joint_line((0.0, 0.0), (1.0, 1.0))
    path.borders_s = np.array(borders)
    with pytest.raises(TimingError, match="borders"):
        time_path(path, [joint(), joint()])


@pytest.mark.parametrize("rounds", [0, 1, 2, 3])
def test_a_first_answer_keeps_the_limits_and_comes_near(rounds):
    limits = Limits.of_joints([joint(), joint()], 1.0)
    path = tip_path(tip_points(np.random.default_rng(8), 6))
    first, best = fastest_motion(path, limits, rounds=rounds), fastest_motion(path, limits)
    assert limit_use(first, limits).largest <= 1.0 + 1e-9
    assert first.duration_s >= best.duration_s * (1.0 - 1e-3)
    if rounds >= 2:
        assert first.duration_s <= 1.1 * best.duration_s
