"""Steps of a trajectory: closed forms, distance from the planned angle at all times, impossible reversals."""

from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motion_paths import JointCurve, joint, joint_line, tip_path, tip_points, waves
from planarm.errors import TimingError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.stepping.quantise import hysteresis_usteps, quantisation_bound_cm, quantise
from planarm.stepping.train import JointSteps, StepTrain, least_reversal_ticks, nearest_usteps, require_steppable
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.timing import time_path
from planarm_wire.messages import BOARDS

TICKS_HZ = 16_000_000
UNO = BOARDS["uno"]
MIN_REVERSAL_TICKS = least_reversal_ticks(UNO)


def position_usteps(train, j, ticks):
    """Joint j's micro-step after all steps up to each tick."""
    done = np.searchsorted(train.steps[j].ticks, ticks, side="right")
    return train.start_usteps[j] + np.concatenate([[0], np.cumsum(train.steps[j].directions, dtype=np.int64)])[done]


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), cornered=st.booleans(), usteps_per_rev=st.sampled_from([3200, 16_000, 51_200]))
def test_the_arm_always_stands_on_the_nearest_micro_step(seed, cornered, usteps_per_rev):
    rng = np.random.default_rng(seed)
    path = tip_path(tip_points(rng, 5)) if cornered else waves(rng)
    joints = [joint(1.5, 8.0, usteps_per_rev), joint(2.0, 10.0, usteps_per_rev)]
    made = time_path(path, joints)
    train = quantise(made, joints)
    t_s = np.linspace(0.0, made.duration_s, 30_011)
    ticks = np.round(t_s * TICKS_HZ).astype(np.int64)
    q, qd, _ = made.sample(ticks / TICKS_HZ)
    for j, one in enumerate(joints):
        planned = q[:, j] * one.usteps_per_rad
        # Half a tick of rounding at the joint's speed, and the bound for steps that were left out.
        allowed = (
            0.5 + 0.5 / TICKS_HZ * np.abs(qd[:, j]).max() * one.usteps_per_rad + hysteresis_usteps(one, UNO) + 1e-6
        )
        assert np.abs(position_usteps(train, j, ticks) - planned).max() <= allowed
        assert train.start_usteps[j] == int(
            np.floor(path.evaluate(path.borders_s[:1]).q_rad[0, j] * one.usteps_per_rad + 0.5)
        )
        assert train.end_usteps[j] == int(np.floor(made.q_rad[-1, j] * one.usteps_per_rad + 0.5))


def test_ticks_are_those_of_constant_acceleration():
    # From rest with 8 rad/s^2 over 0.1 rad, then as long to rest: x = a t^2 / 2, mirrored.
    one = joint(5.0, 8.0)
    made = time_path(joint_line((0.0, 0.0), (0.1, 0.0)), [one, one], share=1.0)
    train = quantise(made, [one, one])
    count = int(np.floor(0.1 * one.usteps_per_rad + 0.5))
    x_rad = (np.arange(count) + 0.5) / one.usteps_per_rad
    half = x_rad[x_rad < 0.05]
    # The planner keeps 1e-4 of the acceleration in hand; its own duration tells exactly how much.
    acceleration = 0.1 / (0.5 * made.duration_s) ** 2
    assert acceleration == pytest.approx(8.0, rel=2e-4)
    wanted = np.sqrt(2.0 * half / acceleration) * TICKS_HZ
    assert np.abs(train.steps[0].ticks[: len(half)] - wanted).max() <= 1.0
    mirrored = train.duration_ticks - np.sqrt(2.0 * (0.1 - x_rad[len(half) :]) / acceleration) * TICKS_HZ
    assert np.abs(train.steps[0].ticks[len(half) :] - mirrored).max() <= 2.0
    assert len(train.steps[1].ticks) == 0


def there_and_back(peak_usteps, one, duration_s=0.2):
    """Joint 1 goes from micro-step 0 to a peak and back in a parabola, the path parameter at constant speed."""
    peak = peak_usteps / one.usteps_per_rad
    path = JointCurve(
        lambda s: [4.0 * peak * s * (1.0 - s), 0.001 * s],
        lambda s: [4.0 * peak * (1.0 - 2.0 * s), 0.001],
        lambda s: [-8.0 * peak, 0.0],
    )
    s = np.linspace(0.0, 1.0, 9)
    rate = np.full(9, 1.0 / duration_s)
    return Trajectory(path, s * duration_s, s, rate, path.evaluate(s).q_rad)


def test_a_step_forth_and_back_that_is_too_short_is_left_out():
    one = joint()
    # Above 1/2 for a time T: the excess is a T^2 / 8 with the acceleration a = 8 peak / duration^2 of the parabola.
    for gap_ticks, steps in ((MIN_REVERSAL_TICKS + 40, 2), (MIN_REVERSAL_TICKS - 40, 0)):
        share = gap_ticks / TICKS_HZ / 0.2  # of the duration; 4 p s (1 - s) > 1/2 between (1 -+ share) / 2
        peak = 0.5 / (1.0 - share**2)
        train = quantise(there_and_back(peak, one), [one, one])
        assert len(train.steps[0].ticks) == steps
        assert train.end_usteps[0] == 0
        if steps:
            assert np.diff(train.steps[0].ticks)[0] == pytest.approx(gap_ticks, abs=2)
            assert train.steps[0].directions.tolist() == [1, -1]
        else:
            assert 0.0 < peak - 0.5 < hysteresis_usteps(one, UNO)


def test_reversals_are_found_between_gridpoints():
    one = joint()
    train = quantise(there_and_back(40.3, one, duration_s=1.0), [one, one])
    assert train.steps[0].directions.tolist() == [1] * 40 + [-1] * 40
    assert train.steps[0].ticks + train.steps[0].ticks[::-1] == pytest.approx(np.full(80, TICKS_HZ), abs=1)


@pytest.mark.parametrize(
    ("speed_rad_s", "words"),
    [
        (30.0, r"joint 2 would step after \d+ ticks \(7\d{4} steps/s\) .* 225 \(71111 steps/s\)"),
        (60.0, r"joint 2 would make \d{6} steps/s at .* can make 71111"),
    ],
)
def test_a_joint_that_is_too_fast_is_named_with_its_limit_and_setting(speed_rad_s, words):
    """2546 micro-steps a radian: 76 k steps/s are found at the step, 153 k before any step is located."""
    fast = joint(speed=speed_rad_s, acceleration=2000.0)
    made = time_path(joint_line((0.0, 0.0), (0.1, 2.0)), [fast, fast])
    with pytest.raises(TimingError, match=words + r": lower joints\[2\].max_speed_deg_s to at most 1600"):
        quantise(made, [fast, fast])


def test_no_motion_makes_no_steps():
    one = joint()
    train = quantise(time_path(tip_path([(30.0, 10.0)]), [one, one]), [one, one])
    assert train.duration_ticks == 0
    assert train.start_usteps == train.end_usteps
    assert all(len(steps.ticks) == 0 for steps in train.steps)


def test_a_motion_below_half_a_micro_step_makes_no_steps_but_lasts():
    one = joint()
    made = time_path(joint_line((0.0, 0.0), (0.4 / one.usteps_per_rad, 0.0)), [one, one])
    train = quantise(made, [one, one])
    assert train.end_usteps == (0, 0)
    assert train.duration_ticks == round(made.duration_s * TICKS_HZ)


def test_a_start_on_the_edge_of_a_micro_step_waits_for_the_dir_line():
    one = joint()
    start = (0.5 - 1e-9) / one.usteps_per_rad
    train = quantise(time_path(joint_line((start, 0.0), (0.1, 0.1)), [one, one]), [one, one])
    assert train.start_usteps[0] == 0
    assert train.steps[0].ticks[0] == 320


def test_half_way_values_go_up():
    assert nearest_usteps([0.5, -0.5, 1.49, -1.51]).tolist() == [1, 0, 1, -2]


@pytest.mark.parametrize(
    ("ticks", "directions", "words"),
    [
        ([1000, 1224], [1, 1], "224 ticks .*71429 steps/s.*max_speed_deg_s"),
        ([1000, 1544], [1, -1], "reverse within 544 ticks .*max_acceleration_deg_s2"),
        ([319, 2000], [1, 1], "319 ticks after .* DIR"),
        ([1000, 9000], [1, 1], "tick 9000, the motion ends at 9000"),
    ],
)
def test_what_the_firmware_cannot_step_is_refused(ticks, directions, words):
    steps = JointSteps(np.array(ticks, np.int64), np.array(directions, np.int8))
    none = JointSteps(np.zeros(0, np.int64), np.zeros(0, np.int8))
    with pytest.raises(TimingError, match=words):
        require_steppable(StepTrain((0, 0), (steps, none), 9000))


def test_the_bound_of_quantisation_covers_poses_off_by_half_a_micro_step():
    arm = Arm((30.0, 20.0), (0.0, 0.0), ((-pi, pi), (-pi, pi)))
    joints = [joint(), joint(usteps_per_rev=3200)]
    bound = quantisation_bound_cm(arm, joints)
    assert bound == pytest.approx(0.545 * (50.0 / joints[0].usteps_per_rad + 20.0 / joints[1].usteps_per_rad))
    rng = np.random.default_rng(1)
    q = rng.uniform(-pi, pi, (2000, 2))
    off = q + rng.choice([-0.5, 0.5], (2000, 2)) / [one.usteps_per_rad for one in joints]
    moved = np.linalg.norm(forward(arm, off) - forward(arm, q), axis=2)
    assert moved.max() <= bound
    assert moved.max() > 0.9 * bound * 0.5 / 0.545


def test_arms_that_no_board_steps_have_a_bound_too():
    arm = Arm((12.0,) * 6, (0.0,) * 6, ((-pi, pi),) * 6)
    joints = [joint()] * 6
    levers_cm = 12.0 * sum(range(1, 7))
    assert quantisation_bound_cm(arm, joints) == pytest.approx(0.605 * levers_cm / joints[0].usteps_per_rad)


def test_hysteresis_is_the_way_in_half_the_reversal_time():
    one = joint(acceleration=10.0)
    t_s = 0.5 * MIN_REVERSAL_TICKS / TICKS_HZ
    assert sqrt(2.0 * hysteresis_usteps(one, UNO) / (10.0 * one.usteps_per_rad)) == pytest.approx(t_s)
