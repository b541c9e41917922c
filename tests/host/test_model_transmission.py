"""Joint angles to micro-steps: signs, zeros, gears, and a belt-driven elbow, down to the planned steps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host_scenes import make_scene
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.transmission import Transmission, motor_axes
from planarm.pipeline import plan_scene
from planarm.scene import JointSpec
from planarm.stepping.segments import expand

BELT = ((1.0, 0.0), (1.0, 1.0))


def one_joint(**changes):
    return replace(JointSpec(200, 16, 5.0, "a4988", 2.0, 10.0), **changes)


def random_transmission(rng, joints):
    specs = [
        one_joint(
            gear_ratio=float(rng.uniform(0.5, 20)),
            reversed=bool(rng.integers(2)),
            zero_offset_rad=float(rng.uniform(-3, 3)),
        )
        for _ in range(joints)
    ]
    coupling = np.eye(joints) + np.tril(rng.integers(0, 2, (joints, joints)), -1)
    return Transmission.from_joints(specs, tuple(map(tuple, coupling.tolist())))


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 10**6), joints=st.integers(1, 5))
def test_there_and_back_is_the_same_angle(seed, joints):
    rng = np.random.default_rng(seed)
    transmission = random_transmission(rng, joints)
    q = rng.uniform(-3, 3, (20, joints))
    np.testing.assert_allclose(transmission.q_rad(transmission.usteps(q)), q, atol=1e-12)


def test_each_setting_does_what_its_key_says():
    """16,000 micro-steps a turn: 90 degrees are 4000; by hand from docs/scene.md."""
    quarter = np.pi / 2
    plain = Transmission.from_joints([one_joint(), one_joint()])
    np.testing.assert_allclose(plain.usteps([quarter, -quarter]), [4000, -4000])
    mixed = Transmission.from_joints([one_joint(reversed=True), one_joint(zero_offset_rad=quarter)])
    np.testing.assert_allclose(mixed.usteps([quarter, 0.0]), [-4000, -4000])
    belt = Transmission.from_joints([one_joint(), one_joint()], BELT)
    np.testing.assert_allclose(belt.usteps([quarter, quarter]), [4000, 8000])
    np.testing.assert_allclose(belt.q_rad([4000, 0]), [quarter, -quarter])


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10**6), joints=st.integers(1, 4))
def test_no_point_of_the_arm_moves_farther_than_the_lever_says(seed, joints):
    rng = np.random.default_rng(seed)
    transmission = random_transmission(rng, joints)
    arm = Arm(tuple(rng.uniform(5, 30, joints).tolist()), (0.0, 0.0), ((-9.0, 9.0),) * joints)
    levers = transmission.levers_cm(arm.link_lengths_cm)
    usteps = rng.integers(-4000, 4000, (50, joints)).astype(float)
    for m in range(joints):
        moved = usteps.copy()
        moved[:, m] += 1.0
        before, after = forward(arm, transmission.q_rad(usteps)), forward(arm, transmission.q_rad(moved))
        assert np.hypot(*np.moveaxis(after - before, -1, 0)).max() <= levers[m] * (1 + 1e-9)


def test_the_lever_of_an_uncoupled_motor_is_all_links_from_it_on():
    levers = Transmission.from_joints([one_joint(), one_joint()]).levers_cm((30.0, 20.0))
    np.testing.assert_allclose(levers, np.array([50.0, 20.0]) * 2 * np.pi / 16_000)


def test_a_belt_s_motor_must_be_able_to_do_what_both_joints_do():
    axes = motor_axes([one_joint(), one_joint(max_speed_rad_s=3.0)], BELT)
    assert [axis.max_speed_rad_s for axis in axes] == pytest.approx([2.0, 5.0])
    assert [axis.max_acceleration_rad_s2 for axis in axes] == pytest.approx([10.0, 20.0])


@pytest.mark.parametrize(
    ("coupling", "changes"),
    [
        (((1.0, 0.0), (0.0, 1.0)), ({"reversed": True}, {"zero_offset_rad": -0.3})),
        (BELT, ({}, {})),
        (BELT, ({"zero_offset_rad": 0.1}, {"reversed": True})),
    ],
)
def test_planned_steps_lead_the_tip_from_start_to_goal_through_any_transmission(coupling, changes):
    scene = replace(make_scene(), coupling=coupling, joints=tuple(one_joint(**change) for change in changes))
    plan = plan_scene(scene, lambda _stage, _share: None)
    assert plan.certificate.ok, plan.certificate.explain()
    made = expand(plan.segments)
    arm, transmission = Arm.from_spec(scene.arm), Transmission.of(scene)
    bound_cm = 0.5 * transmission.levers_cm(scene.arm.link_lengths_cm).sum()
    for usteps, wanted in ((made.start_usteps, scene.task.start_cm), (made.end_usteps, scene.task.goal_cm)):
        tip = forward(arm, transmission.q_rad(usteps))[-1]
        assert np.hypot(*(tip - wanted)) <= bound_cm
    assert np.allclose(plan.trajectory.q_rad[0], transmission.q_rad(made.start_usteps), atol=1e-3)


def test_a_reversed_motor_makes_the_same_steps_the_other_way():
    plain = make_scene()
    turned = replace(plain, joints=(replace(plain.joints[0], reversed=True), plain.joints[1]))
    one, other = (plan_scene(scene, lambda _stage, _share: None).train.steps for scene in (plain, turned))
    # At exactly half a micro-step rounding goes up in either sense, so a step may differ there; times do not.
    np.testing.assert_array_equal(one[0].ticks, other[0].ticks)
    np.testing.assert_array_equal(one[0].directions, -other[0].directions)
    np.testing.assert_array_equal(one[1].ticks, other[1].ticks)
