"""The certificate's checks of the motion: limits from positions alone, and steps that are late or early."""

from dataclasses import replace

import numpy as np
import pytest

from host_scenes import make_scene
from motion_paths import joint, joint_line
from planarm.model.arm import Arm
from planarm.stepping.check_motion import Planned, check_deviation, check_limits
from planarm.stepping.poses import motor_positions
from planarm.stepping.quantise import quantise
from planarm.stepping.train import JointSteps
from planarm.trajectory.jerk import averaged
from planarm.trajectory.timing import time_path

JOINTS = (joint(), joint(1.5, 8.0))
SCENE = replace(make_scene(), joints=JOINTS)


@pytest.fixture(scope="module")
def motion():
    return time_path(joint_line((0.0, 0.3), (1.0, -0.9)), JOINTS)


def test_planned_speeds_and_accelerations_are_those_of_the_motion(motion):
    # Joint 2 goes 1.2 rad, joint 1 the same motion scaled by 1 / 1.2; joint 2 has the lower limits: 1.5 and 0.8 x 8.
    values = {check.name: check.value for check in check_limits(Planned.of(motion), JOINTS)}
    assert values["joint 2 planned speed"] == pytest.approx(1.5, rel=1e-3)
    assert values["joint 2 planned acceleration"] == pytest.approx(6.4, rel=1e-3)
    assert values["joint 1 planned speed"] == pytest.approx(1.25, rel=1e-3)
    assert values["joint 1 planned acceleration"] == pytest.approx(6.4 / 1.2, rel=1e-3)


@pytest.mark.parametrize(("limit", "verdict"), [(90.0, "green"), (80.0, "green"), (79.0, "red")])
def test_jerk_is_looked_at_where_it_has_a_limit(motion, limit, verdict):
    smooth = averaged(motion, Arm((30.0, 20.0), (0.0, 0.0), ((-4.0, 4.0),) * 2), np.array([np.inf, 80.0]))
    joints = (JOINTS[0], replace(JOINTS[1], max_jerk_rad_s3=limit))
    checks = {check.name: check for check in check_limits(Planned.of(smooth), joints)}
    assert "joint 1 planned jerk" not in checks
    assert checks["joint 2 planned jerk"].verdict == verdict
    assert checks["joint 2 planned jerk"].value == pytest.approx(80.0, rel=5e-3)
    assert check_limits(Planned.of(motion), joints)[-1].verdict == "red"  # the motion itself jumps


@pytest.mark.parametrize(("shift_ticks", "verdict"), [(0, "green"), (1000, "red"), (-1000, "red")])
def test_steps_that_are_late_or_early_are_found(motion, shift_ticks, verdict):
    # At 1.25 rad/s a step of joint 1 takes 5027 ticks; 1000 of them are 0.2 micro-steps.
    train = quantise(motion, JOINTS)
    first, second = train.steps
    middle = (first.ticks > 0.4 * train.duration_ticks) & (first.ticks < 0.6 * train.duration_ticks)
    made = replace(train, steps=(JointSteps(first.ticks + middle * shift_ticks, first.directions), second))
    one, two = check_deviation(motion, SCENE, made, motor_positions(made))
    assert one.verdict == verdict
    assert one.value == pytest.approx(0.5 + abs(shift_ticks) / 5027, abs=0.01)
    assert two.verdict == "green"


def test_a_motion_without_steps_must_not_go_far(motion):
    train = quantise(motion, JOINTS)
    still = JointSteps(np.zeros(0, np.int64), np.zeros(0, np.int8))
    made = replace(train, steps=(still, still))
    checks = check_deviation(motion, SCENE, made, motor_positions(made))
    assert [check.verdict for check in checks] == ["red", "red"]
