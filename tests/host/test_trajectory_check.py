"""The dense check of limits: both sides of borders, and what happens between its points."""

from itertools import pairwise

import numpy as np
import pytest

from motion_paths import JointCurve, joint_line, tip_path
from planarm.trajectory.check import between, limit_use
from planarm.trajectory.limits import Limits
from planarm.trajectory.motion import Trajectory


def run_at_constant_rate(path, points=2, rate=1.0):
    s = np.linspace(path.borders_s[0], path.borders_s[-1], points)
    return Trajectory(path, (s - s[0]) / rate, s, np.full(points, rate), path.evaluate(s).q_rad)


def bump(height):
    """q' has its peak of 1 at s = 0.55, in the middle between two dense points; q'' is steepest there, too."""
    at = 0.55
    return JointCurve(
        lambda s: [s - height * (s - at) ** 3 / 3.0, 0.0],
        lambda s: [1.0 - height * (s - at) ** 2, 0.0],
        lambda s: [-2.0 * height * (s - at), 0.0],
    )


def test_a_peak_of_speed_between_dense_points_is_covered():
    use = limit_use(run_at_constant_rate(bump(4.0)), Limits(np.array([1.0, 1.0]), np.array([100.0, 100.0]), 1.0))
    at_points = 1.0 - 4.0 * 0.05**2
    assert use.speed[0, 0] >= 1.0
    assert use.speed[0, 0] <= 1.0 + 2.0 * (1.0 - at_points)


def test_a_peak_of_acceleration_between_dense_points_is_covered():
    # q'' = 1 - 4 (s - 0.55)^2 at constant rate
    path = JointCurve(
        lambda s: [0.5 * s**2 - (s - 0.55) ** 4 / 3.0, 0.0],
        lambda s: [s - 4.0 * (s - 0.55) ** 3 / 3.0, 0.0],
        lambda s: [1.0 - 4.0 * (s - 0.55) ** 2, 0.0],
    )
    use = limit_use(run_at_constant_rate(path), Limits(np.array([100.0, 100.0]), np.array([1.0, 1.0]), 1.0))
    assert 1.0 <= use.acceleration[0, 0] <= 1.02


def test_use_is_that_of_the_closed_form_for_constant_acceleration():
    line = joint_line((0.0, 0.0), (1.0, -0.5))
    s = np.array([0.0, 0.5, 1.0])
    # s = t^2 for the first half second's sqrt(0.5), then the same to rest: s_ddot = +2, -2.
    s_dot = np.array([0.0, np.sqrt(2.0), 0.0])
    t_s = np.array([0.0, np.sqrt(0.5), 2.0 * np.sqrt(0.5)])
    use = limit_use(
        Trajectory(line, t_s, s, s_dot, line.evaluate(s).q_rad), Limits(np.array([2.0, 1.0]), np.array([4.0, 4.0]), 1.0)
    )
    assert use.acceleration == pytest.approx(np.array([[0.5, 0.25]] * 2))
    assert use.speed == pytest.approx(np.sqrt([[0.5, 0.5]] * 2))
    assert use.slack == pytest.approx([0.5, 0.5])


def test_each_interval_sees_its_own_side_of_a_border():
    # A corner blend of 2 cm between straight legs: q'' jumps at both its ends.
    path = tip_path([(40.0, 0.0), (40.0, 10.0), (30.0, 10.0)], tolerance_cm=0.5)
    made = Trajectory(path, path.borders_s, path.borders_s, np.ones(4), path.evaluate(path.borders_s).q_rad)
    use = limit_use(made, Limits(np.array([1.0, 1.0]), np.array([1.0, 1.0]), 1.0)).acceleration
    for k, (a, b) in enumerate(pairwise(path.borders_s)):
        inside = np.abs(path.evaluate(np.linspace(a + 1e-9, b - 1e-9, 2001)).ddq_rad).max(axis=0)
        assert use[k] == pytest.approx(inside, rel=0.02)
    assert use[1].max() > 3.0 * use[[0, 2]].max()


def test_rounding_at_rest_makes_no_negative_square():
    # 0.0017598... / 10 * 10 rounds past 0 with some starts; the root of a negative number would be NaN.
    starts = np.random.default_rng(0).uniform(0.0, 0.01, 20_000)
    assert min(between(start, 0.0, p / 10) for start in starts for p in (9, 10)) >= 0.0
