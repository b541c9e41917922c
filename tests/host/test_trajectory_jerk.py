"""The moving mean of a motion: its jerk, its limits, its ends, and how far it is from the motion."""

import numpy as np
import pytest

from motion_paths import joint, joint_line, tip_path, tip_points
from planarm.errors import TimingError
from planarm.model.arm import Arm
from planarm.trajectory.check import limit_use
from planarm.trajectory.jerk import averaged, largest_jerks
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion

ARM = Arm((30.0, 20.0), (0.0, 0.0), ((-10.0, 10.0), (-10.0, 10.0)))
JOINTS = (joint(2.0, 10.0), joint(3.0, 8.0))
LIMITS = Limits.of_joints(JOINTS)


@pytest.mark.parametrize("seed", range(6))
def test_jerk_and_limits_are_kept_and_the_ends_are_the_motion_s(seed):
    motion = fastest_motion(tip_path(tip_points(np.random.default_rng(seed), 6)), LIMITS)
    jerks = np.array([60.0, np.inf]) if seed % 2 else np.array([40.0, 90.0])
    made = averaged(motion, ARM, jerks)
    assert (largest_jerks(made)[0] <= jerks).all()
    assert limit_use(made, LIMITS).largest <= 1.0 + 1e-9
    ends, speeds, accelerations = made.sample([0.0, made.duration_s])
    np.testing.assert_allclose(ends, motion.q_rad[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(speeds[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(accelerations[0], 0.0, atol=1e-9)
    window_s = made.duration_s - motion.duration_s
    t_s = np.linspace(0.0, made.duration_s, 2000)
    off_rad = np.abs(made.sample(t_s)[0] - motion.sample(t_s - 0.5 * window_s)[0]).max(axis=0)
    # a T^2 / 24 inside the motion; at its ends, where the mean looks beyond them, a T^2 / 8 at most.
    assert (off_rad <= LIMITS.accelerations_rad_s2 * window_s**2 / 8.0).all()


def test_a_straight_move_takes_the_shortest_window():
    """The joint runs at its top speed in between for longer than T, so acceleration changes by a at once: T = a / J."""
    motion = fastest_motion(joint_line((0.0, 0.0), (1.0, 0.5)), LIMITS)
    made = averaged(motion, ARM, np.array([100.0, 1e9]))
    window_s = made.duration_s - motion.duration_s
    assert window_s == pytest.approx(LIMITS.accelerations_rad_s2[0] / 100.0, abs=2e-3)


def test_too_little_jerk_is_told_with_its_joint():
    motion = fastest_motion(joint_line((0.0, 0.0), (1.0, 0.5)), LIMITS)
    with pytest.raises(TimingError, match=r"joint 2 .*max_jerk_deg_s3"):
        averaged(motion, ARM, np.array([np.inf, 0.1]))
