"""What holds a motion back: closed forms of one joint, and the braking share's cost."""

import re

import numpy as np
import pytest

from motion_paths import joint, joint_line, tip_path
from planarm.trajectory.binding import report_timing
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion


def test_a_long_move_is_held_back_by_the_speed_in_its_middle_and_the_acceleration_at_its_ends():
    # 3 rad at 2 rad/s and 0.8 x 10 rad/s^2: 0.25 s up, 1.25 s at speed, 0.25 s down; joint 2 goes half as far.
    limits = Limits.of_joints([joint(), joint()], 0.8)
    report = report_timing(fastest_motion(joint_line((0.0, 0.0), (3.0, 1.5)), limits), limits)
    assert [(b.joint, b.limit) for b in report.binding] == [(1, "speed"), (1, "acceleration")]
    assert [b.share for b in report.binding] == pytest.approx([1.25 / 1.75, 0.5 / 1.75], abs=0.01)
    # With all of the acceleration: 3 / 2 + 2 / 10 s.
    assert report.duration_s == pytest.approx(1.75, rel=1e-3)
    assert report.full_acceleration_s == pytest.approx(1.7, rel=1e-3)
    assert report.braking_cost == pytest.approx(1.75 / 1.7 - 1.0, abs=1e-3)
    assert re.fullmatch(
        r"held back by joint 1 speed 7\d %, joint 1 acceleration 2\d % of the time; "
        r"keeping a stop possible costs 2\.9 %",
        report.words(),
    )
    figures = report.figures()
    assert figures["binding_limits"][0] == {
        "joint": 1,
        "limit": "speed",
        "share_of_time": pytest.approx(0.714, abs=0.01),
    }
    assert figures["acceleration_share"] == pytest.approx(0.8)


def test_shares_add_up_and_all_of_the_acceleration_costs_nothing():
    limits = Limits.of_joints([joint(), joint()], 1.0)
    motion = fastest_motion(tip_path([(40.0, 0.0), (40.0, 20.0), (20.0, 20.0)]), limits)
    report = report_timing(motion, limits)
    assert sum(b.share for b in report.binding) == pytest.approx(1.0)
    assert report.full_acceleration_s == motion.duration_s
    assert report.braking_cost == 0.0
    assert report.words().endswith("% of the time"), report.words()


def test_where_nothing_moves_nothing_holds_back():
    limits = Limits.of_joints([joint(), joint()])
    report = report_timing(fastest_motion(joint_line((0.3, 0.4), (0.3, 0.4)), limits), limits)
    assert report.binding == ()
    assert report.words() == "nothing moves"
    assert np.isfinite(report.braking_cost)
