"""A scene with a limit of jerk, planned to its certificate: the limit is a check of its own, and all checks hold."""

from dataclasses import replace
from pathlib import Path

from planarm.pipeline import plan_scene
from planarm.scene import load_scene

CASE_1 = load_scene(Path(__file__).resolve().parents[2] / "examples" / "table1_case1.toml")


def test_the_certificate_holds_the_jerk():
    scene = replace(CASE_1, joints=tuple(replace(joint, max_jerk_rad_s3=200.0) for joint in CASE_1.joints))
    plan = plan_scene(scene, lambda _stage, _share: None)
    checks = {check.name: check for check in plan.certificate.checks}
    assert plan.certificate.ok, plan.certificate.explain()
    for number in (1, 2):
        assert 150.0 < checks[f"joint {number} planned jerk"].value <= 200.0
    assert plan.timing.duration_s == plan.trajectory.duration_s > plan.timing.full_acceleration_s
