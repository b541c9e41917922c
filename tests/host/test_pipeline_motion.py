"""From a scene to a certified plan: corners as the scene says, and tasks at full stretch."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from host_scenes import make_scene
from planarm.pipeline import plan_scene
from planarm.scene import MotionSpec, load_scene

CASE_1 = load_scene(Path(__file__).resolve().parents[2] / "examples" / "table1_case1.toml")


def planned(scene):
    return plan_scene(scene, lambda _stage, _share: None)


def test_corners_are_blended_or_stops_as_the_scene_says():
    blended = planned(CASE_1)
    stopped = planned(replace(CASE_1, motion=MotionSpec(corners="stop")))
    assert blended.certificate.ok
    assert stopped.certificate.ok
    assert len(blended.smooth_path.stops_s) == 0
    assert len(stopped.smooth_path.stops_s) > 0
    assert stopped.trajectory.duration_s > 1.5 * blended.trajectory.duration_s


@pytest.mark.parametrize(("start", "goal"), [((50.0, 0.0), (30.0, 25.0)), ((30.0, 25.0), (0.0, 50.0))])
def test_tasks_at_full_stretch_are_planned_to_a_green_certificate(start, goal):
    plan = planned(make_scene(start=start, goal=goal, y=(0.0, 50.0)))
    assert plan.certificate.ok, plan.certificate.explain()
    q = plan.trajectory.q_rad[[0, -1], 1]
    assert np.abs(q).min() == pytest.approx(0.0, abs=1e-6)


def test_a_plan_that_is_slowed_down_for_its_stops_tells_each_try():
    slow = [replace(joint, max_acceleration_rad_s2=0.25 * joint.max_acceleration_rad_s2) for joint in CASE_1.joints]
    told = []
    plan_scene(replace(CASE_1, joints=tuple(slow)), lambda stage, share: told.append((stage, share)))
    shares = [share for _, share in told]
    assert {stage for stage, _ in told} == {"plan"}
    assert shares == sorted(shares) and (shares[0], shares[-1]) == (0.0, 1.0)
    assert sum(0.6 < share < 0.8 for share in shares) >= 2
