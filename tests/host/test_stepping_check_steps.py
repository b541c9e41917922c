"""The certificate's checks of the steps, each on the smallest plan that can break it."""

import numpy as np
import pytest

from motion_paths import joint
from planarm.stepping.check_steps import check_counts, check_gaps, check_wire
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.train import MIN_REVERSAL_TICKS, JointSteps, StepTrain
from planarm_wire.messages import BAUD, MIN_INTERVAL_TICKS, Move, Segment

REST = Move(0)
NO_STEPS = JointSteps(np.zeros(0, np.int64), np.zeros(0, np.int8))


def plan_of(*segments):
    """A plan of (duration, move of joint 1, move of joint 2); the last one is flagged."""
    last = len(segments) - 1
    made = tuple(Segment(2 * duration + (k == last), tuple(moves)) for k, (duration, *moves) in enumerate(segments))
    return SegmentPlan(made, sum(s.duration_flags >> 1 for s in made), (0, 0))


def verdict_of(checks, name):
    (found,) = (check.verdict for check in checks if name in check.name)
    return found


def train_of(ticks, directions, duration=10**6):
    return StepTrain((0, 0), (JointSteps(np.array(ticks), np.array(directions, np.int8)), NO_STEPS), duration)


@pytest.mark.parametrize(("first_ticks", "verdict"), [(320, "green"), (319, "red")])
def test_dir_setup_counts_from_the_start_of_the_segment_that_turns(first_ticks, verdict):
    forth, back, on = Move(3, 500), Move(2, first_ticks), Move(2, 10)
    checks = check_wire(plan_of((5000, forth, REST), (5000, back, REST), (5000, on, REST)))
    assert verdict_of(checks, "DIR setup") == verdict
    assert verdict_of(checks, "wire limits") == "green"


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


@pytest.mark.parametrize(("acceleration", "verdict"), [(8.1, "green"), (7.9, "red")])
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


@pytest.mark.parametrize("slower", [True, False])
def test_segments_must_not_be_shorter_than_the_line_takes_to_bring_them(slower):
    # A segment of one step of one joint: duration (2 or 3 bytes), steps, first (2 bytes), 0: 6 or 7 bytes, and a frame
    # of its own around it: 3 of header, two checks of 2, delimiter. 10 bits a byte at 250,000 baud, 16 MHz.
    frame_bytes = 7 + 3 + 2 * 2 + 1
    ticks = frame_bytes * 10 * 16_000_000 // BAUD
    duration = ticks + 200 if slower else ticks - 800
    checks = check_wire(plan_of(*[(duration, Move(3, 1000), REST)] * 2000))
    assert verdict_of(checks, "ahead of the line") == ("green" if slower else "red")


@pytest.mark.parametrize(
    ("interval_ticks", "segments_hz", "verdict"),
    [
        (320, 333, "red"),  # the rate at which the board only just keeps up with both joints at 50 k steps/s
        (320, 250, "green"),
        (800, 800, "red"),  # the same at 20 k
        (800, 600, "green"),
        (8_000, 900, "green"),
    ],
)
def test_the_board_needs_time_to_read_segments(interval_ticks, segments_hz, verdict):
    """firmware/README.md: sustained segments a second fall with the step rate; the check keeps below them."""
    duration = 16_000_000 // segments_hz
    move = Move(2 * (duration // interval_ticks) + 1, 0, interval_ticks << 16)
    checks = check_wire(plan_of(*[(duration, move, move)] * 2000))
    assert verdict_of(checks, "ahead of the board") == verdict


def test_a_burst_of_short_segments_cannot_be_sent_before_there_is_room():
    # The line is idle for seconds, but the device holds 32 segments and no more.
    long, short = (10**6, Move(3, 1000), REST), (4000, Move(3, 1000), REST)
    assert verdict_of(check_wire(plan_of(*[long] * 40, *[short] * 31)), "ahead of the line") == "green"
    assert verdict_of(check_wire(plan_of(*[long] * 40, *[short] * 100)), "ahead of the line") == "red"


@pytest.mark.parametrize(
    ("segment", "words"),
    [
        ((0, REST, REST), "duration 0"),
        ((1 << 30, REST, REST), "duration"),
        ((5000, Move(3, 5000), REST), "outside"),
        ((5000, REST, Move(5, 1000, (MIN_INTERVAL_TICKS << 16) - 1)), "intervals of joint 2"),
        ((200_000, REST, Move(5, 1000, 60_001 << 16)), "intervals of joint 2"),
        ((200_000, REST, Move(9, 1000, (MIN_INTERVAL_TICKS + 100) << 16, -(60 << 16))), "intervals of joint 2"),
        ((5000, REST, Move(7, 100, 900 << 16, 1 << 31)), "add of joint 2"),
        ((1 << 29, Move(2 * 32_768, 500, 1000 << 16), REST), "32768 steps of joint 1"),
    ],
)
def test_each_limit_of_the_wire_is_kept(segment, words):
    check = next(check for check in check_wire(plan_of(segment)) if "wire limits" in check.name)
    assert check.verdict == "red"
    assert words in check.where


def test_the_plans_own_duration_is_that_of_its_segments():
    plan = plan_of((5000, REST, REST))
    longer = SegmentPlan(plan.segments, 5001, plan.start_usteps)
    assert verdict_of(check_wire(longer), "duration") == "red"
