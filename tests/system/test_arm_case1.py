"""Paper C's first case on the emulated arm: within a millimetre at every instant; what happens when asked too much."""

import re
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from planarm.link.arm_record import ArmSetup
from planarm.link.transport import open_transport
from planarm.pipeline import plan_scene
from planarm.record.look import judge_emulated_arm, judge_pins
from planarm.scene import load_scene
from planarm.stepping.certificate import Certificate
from planarm.streaming.plan_stream import stream

CASE1 = load_scene(Path(__file__).resolve().parents[2] / "examples" / "table1_case1.toml")
BELT = ((1.0, 0.0), (1.0, 1.0))


def quiet(_stage, _share):
    return None


def on_the_bench(plan, scene):
    """Stream the plan to the arm of a scene; what the arm did."""
    with closing(open_transport("sim://", 250_000, ArmSetup(scene, plan.segments.start_usteps))) as line:
        stream(plan.segments, plan.certificate, line, None)
        return judge_emulated_arm(plan, judge_pins(plan.segments, line.pins), line.arm)


def test_with_sane_limits_the_tip_stays_within_a_millimetre_at_every_instant():
    plan = plan_scene(CASE1, quiet)
    arm = on_the_bench(plan, CASE1)
    assert arm.clean, arm.explain()
    assert arm.record.lost_full_steps == (0, 0)
    assert 0.05 < arm.tip_error_mm.max() < 1.0
    assert arm.t_s[-1] > plan.trajectory.duration_s
    assert len(arm.t_s) > 1900 * plan.trajectory.duration_s  # a sample each half millisecond


@pytest.mark.parametrize(("coupling", "changes"), [(BELT, {}), (((1.0, 0.0), (0.0, 1.0)), {"reversed": True})])
def test_a_belt_driven_elbow_and_a_reversed_motor_arrive_too(coupling, changes):
    joints = (replace(CASE1.joints[0], zero_offset_rad=0.2), replace(CASE1.joints[1], **changes))
    scene = replace(CASE1, coupling=coupling, joints=joints)
    arm = on_the_bench(plan_scene(scene, quiet), scene)
    assert arm.clean, arm.explain()
    assert arm.tip_error_mm.max() < 1.5


def test_acceleration_raised_until_it_fails_says_which_joint_lost_how_many_steps_and_where():
    """The plan believes in motors of twenty times the torque; the bench has those of the scene.

    Such motors on the same gears swing, and the certificate says so; the rest of it is green, and is streamed with.
    """
    for factor in (1, 2, 4, 8, 16, 32):
        joints = tuple(
            replace(
                joint,
                max_acceleration_rad_s2=factor * joint.max_acceleration_rad_s2,
                max_speed_rad_s=2.5 * joint.max_speed_rad_s,
                motor=replace(joint.motor, holding_torque_nm=20 * joint.motor.holding_torque_nm),
            )
            for joint in CASE1.joints
        )
        plan = plan_scene(replace(CASE1, joints=joints), quiet)
        rest = tuple(check for check in plan.certificate.checks if "lag of the rotor" not in check.name)
        plan = replace(plan, certificate=Certificate(rest))
        assert plan.certificate.ok, plan.certificate.explain()
        arm = on_the_bench(plan, CASE1)
        if not arm.clean:
            break
    assert factor > 1
    lost = arm.record.lost_full_steps
    assert any(lost)
    assert all(steps % 4 == 0 for steps in lost)
    for joint, steps in enumerate(lost, start=1):
        told = re.search(rf"joint {joint} lost (\d+) full steps.*?first at ([\d.]+) s, path ([\d.]+) of", arm.explain())
        assert (told is not None) == any(loss.motor == joint for loss in arm.record.lost)
        if told:
            assert int(told[1]) == abs(steps)
            assert 0.0 < float(told[2]) < plan.trajectory.duration_s + 0.1
            assert 0.0 < float(told[3]) <= plan.path.length_cm
    assert arm.tip_error_mm[-1] > 5.0


def test_an_obstacle_that_the_plan_does_not_know_is_hit_and_told():
    plan = plan_scene(replace(CASE1, obstacles=CASE1.obstacles[1:]), quiet)
    arm = on_the_bench(plan, CASE1)
    assert arm.record.touches[0].obstacle == 1
    assert "touched obstacles[1] at" in arm.explain()
