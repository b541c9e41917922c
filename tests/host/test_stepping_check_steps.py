"""The certificate's checks of the steps, each on the smallest train that can break it."""

import numpy as np
import pytest

from motion_paths import joint
from planarm.stepping.check_steps import check_counts, check_gaps
from planarm.stepping.train import JointSteps, StepTrain, least_reversal_ticks
from planarm_wire.messages import BOARDS, MIN_INTERVAL_TICKS
from segment_plans import verdict_of

MIN_REVERSAL_TICKS = least_reversal_ticks(BOARDS["uno"])
NO_STEPS = JointSteps(np.zeros(0, np.int64), np.zeros(0, np.int8))


def train_of(ticks, directions, duration=10**6):
    return StepTrain((0, 0), (JointSteps(np.array(ticks), np.array(directions, np.int8)), NO_STEPS), duration)


@pytest.mark.parametrize(("gap", "verdict"), [(MIN_REVERSAL_TICKS, "green"), (MIN_REVERSAL_TICKS - 1, "red")])
def test_reversing_takes_an_interval_and_the_dir_setup(gap, verdict):
    checks = check_gaps(train_of([1000, 1000 + gap], [1, -1]), (joint(), joint()), 1)
    assert verdict_of(checks, "reversal") == verdict


@pytest.mark.parametrize(
    ("gap", "speed", "verdict"),
    [
        (MIN_INTERVAL_TICKS, 100.0, "green"),
        (MIN_INTERVAL_TICKS - 1, 100.0, "red"),
        (3141, 2.0, "green"),
        (3140, 2.0, "red"),
    ],
)
def test_an_interval_keeps_the_firmwares_limit_and_the_joints_speed(gap, speed, verdict):
    # 2 rad/s at 16,000 micro-steps a turn are 3141.59 ticks a step.
    checks = check_gaps(train_of([1000, 1000 + gap], [1, 1]), (joint(speed), joint()), 1)
    assert verdict_of(checks, "interval") == verdict


@pytest.mark.parametrize(("acceleration", "verdict"), [(8.1, "green"), (7.9, "amber"), (7.7, "red")])
def test_acceleration_is_found_from_the_steps_alone(acceleration, verdict):
    # Steps of a joint that speeds up with 8 rad/s^2, x = a t^2 / 2.
    one = joint(acceleration=acceleration)
    t_s = np.sqrt(2.0 * (np.arange(400) + 0.5) / one.usteps_per_rad / 8.0)
    checks = check_gaps(train_of(np.round(t_s * 16e6).astype(np.int64), np.ones(400)), (one, joint()), 1)
    found = next(check for check in checks if "acceleration" in check.name)
    assert found.value == pytest.approx(8.0, rel=2e-3)
    assert found.verdict == verdict


@pytest.mark.parametrize(("error", "verdict"), [(40, "green"), (41, "red")])
def test_a_step_may_be_late_by_a_share_of_the_shorter_interval(error, verdict):
    wanted = train_of([1000, 3000, 6000], [1, 1, 1])
    made = train_of([1000, 3000 + error, 6000], [1, 1, 1])
    assert verdict_of(check_counts(wanted, made, 1), "timing") == verdict


@pytest.mark.parametrize(("error", "verdict"), [(16, "green"), (17, "red")])
def test_a_lone_step_may_be_late_by_1_us(error, verdict):
    checks = check_counts(train_of([1000], [1]), train_of([1000 + error], [1]), 1)
    assert verdict_of(checks, "timing") == verdict


def test_a_step_that_is_missing_is_told_apart_from_one_that_is_turned():
    wanted = train_of([1000, 3000, 6000], [1, 1, 1])
    checks = check_counts(wanted, train_of([1000, 3000, 6000], [1, -1, 1]), 1)
    differ = next(check for check in checks if "differ" in check.name)
    assert (differ.value, differ.where, differ.verdict) == (1, "step 1", "red")
    checks = check_counts(wanted, train_of([1000, 3000], [1, 1]), 1)
    assert [check.verdict for check in checks] == ["red", "red"]
