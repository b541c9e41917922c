"""Rigid bodies of the plant: energy, an independent derivation, rest where it should be, friction, stops."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_sim.errors import UsageError
from planarm_sim.plant import Joint, LimitSwitch, Link, Motor, Plant, Rig, SwitchChange
from planarm_sim.plant.build import fastest_per_s
from planarm_sim.plant.rigid_body import inertia_constants
from two_link_reference import swing

S = 16_000_000
GRAVITY = 9.80665
ARM = (Link.rod(0.3, 0.12, 0.05), Link.rod(0.2, 0.08, 0.03))


def free(links=ARM, joints=None, start=None, gravity=GRAVITY, **settings):
    n = len(links)
    rig = Rig(links, joints or (Joint(),) * n, (), start or (0.3,) * n, gravity_m_s2=gravity)
    return Plant(rig, **settings)


def some_links(rng, n):
    return tuple(
        Link(
            float(rng.uniform(0.1, 0.5)),
            float(rng.uniform(0.05, 0.5)),
            float(rng.uniform(0.02, 0.1)),
            float(rng.uniform(1e-4, 1e-2)),
            float(rng.uniform(0.0, 0.3)),
        )
        for _ in range(n)
    )


@pytest.mark.parametrize("links", [1, 2, 3, 5])
def test_without_friction_and_drive_energy_is_kept(links):
    """Asked for: less than 1e-6 in 10 s, here as a share of the energy that swings to and fro."""
    rng = np.random.default_rng(links)
    plant = free(some_links(rng, links), start=tuple(rng.uniform(-1, 1, links)))
    before = plant.energy_j
    plant.set_motion(plant.q_rad, rng.uniform(-2, 2, links))
    moving = plant.energy_j
    plant.run_to(10 * S)
    assert abs(plant.energy_j - moving) < 1e-6 * (moving - before)
    assert np.abs(plant.q_rad - np.array(plant.rig.start_rad)).max() > 0.1  # it did swing


def test_with_gears_but_without_current_and_damping_energy_is_kept():
    motor = Motor(gear_ratio=5.0, detent_torque_nm=0.0, damping_nm_s=0.0, stiffness_damping_nm_s=0.0)
    plant = Plant(Rig(ARM, (Joint(),) * 2, (motor,) * 2, (0.3, 0.4), gravity_m_s2=GRAVITY), step_cycles=400)
    plant.set_motion((0.3, 0.4), (1.0, -2.0))
    before = plant.energy_j
    plant.run_to(10 * S)
    assert abs(plant.energy_j - before) < 1e-6 * 0.5


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), gravity=st.sampled_from([0.0, GRAVITY]))
def test_it_moves_as_an_independent_derivation_says(seed, gravity):
    rng = np.random.default_rng(seed)
    links = some_links(rng, 2)
    q, q_dot = rng.uniform(-1.0, 1.0, 2), rng.uniform(-2.0, 2.0, 2)
    plant = free(links, start=tuple(q), gravity=gravity, step_cycles=400, sample_cycles=S // 100)
    plant.set_motion(q, q_dot)
    plant.run_to(S // 2)
    motion = plant.motion()[1:]
    wanted = swing(links, gravity, q, q_dot, motion["cycle"] / S)
    np.testing.assert_allclose(motion["q_rad"], wanted[:, :2], atol=1e-8, rtol=0)
    np.testing.assert_allclose(motion["q_dot_rad_s"], wanted[:, 2:], atol=1e-8 * np.abs(wanted[:, 2:]).max() + 1e-8)


@pytest.mark.parametrize("links", [1, 3])
def test_with_friction_it_falls_to_rest_hanging_down(links):
    plant = free(ARM[:1] * links, (Joint(viscous_nm_s=0.2),) * links)
    plant.run_to(25 * S)
    np.testing.assert_allclose(plant.q_rad, [-math.pi / 2] + [0.0] * (links - 1), atol=1e-4)
    assert np.abs(plant.q_dot_rad_s).max() < 1e-4


def test_dry_friction_holds_what_it_can_hold_and_lets_go_of_more():
    """A level rod of 0.12 kg and 0.3 m pulls with m g l / 2 = 0.1765 N m."""
    rod, pull = (Link.rod(0.3, 0.12),), 0.12 * GRAVITY * 0.15
    held = free(rod, (Joint(coulomb_nm=1.01 * pull),), (0.0,))
    held.run_to(10 * S)
    assert abs(held.q_rad[0]) < 1e-6
    falling = free(rod, (Joint(coulomb_nm=0.99 * pull),), (0.0,))
    falling.run_to(5 * S)
    # It slips slowly, gathers speed, and rests where friction is enough: |cos q| <= 0.99, beyond the first such angle.
    assert falling.q_rad[0] < -math.acos(0.99)
    assert abs(falling.q_dot_rad_s[0]) < 1e-9
    assert abs(math.cos(falling.q_rad[0])) <= 0.99


def test_dry_friction_stops_a_turning_link_where_the_work_is_done():
    """Without gravity: w^2 J / 2 = friction x angle."""
    rod = (Link.rod(0.3, 0.12),)
    plant = free(rod, (Joint(coulomb_nm=0.01),), (0.0,), gravity=0.0)
    plant.set_motion([0.0], [4.0])
    plant.run_to(4 * S)
    inertia = 0.12 * 0.3**2 / 3
    assert plant.q_dot_rad_s[0] == 0.0
    assert plant.q_rad[0] == pytest.approx(0.5 * inertia * 16.0 / 0.01, rel=1e-3)


def test_hard_stops_stop_and_are_told():
    stop = math.radians(-30)
    plant = free(ARM[:1], (Joint(stops_rad=(stop, 9.0), viscous_nm_s=0.01),), (0.0,))
    plant.run_to(5 * S)
    assert plant.q_rad[0] == pytest.approx(stop, abs=1e-3)
    hit = plant.stop_hits()[0]
    assert hit.joint == 0
    # Falling freely from level to -30 degrees takes well under half a second.
    assert 0.05 < hit.cycle / S < 0.5


def test_outside_torque_turns_a_free_link_as_newton_says():
    plant = free((Link.rod(0.3, 0.12),), start=(0.0,), gravity=0.0)
    plant.set_outside_torque(0, 0.02)
    plant.run_to(S // 2)
    inertia = 0.12 * 0.3**2 / 3
    assert plant.q_dot_rad_s[0] == pytest.approx(0.5 * 0.02 / inertia, rel=1e-9)
    assert plant.q_rad[0] == pytest.approx(0.5 * 0.02 / inertia * 0.25, rel=1e-9)


def test_two_runs_are_the_same_and_a_snapshot_goes_back():
    first, second = free(), free()
    for plant in (first, second):
        plant.run_to(S)
    np.testing.assert_array_equal(first.motion(), second.motion())
    kept = first.snapshot()
    first.run_to(2 * S)
    after = first.q_rad
    first.restore(kept)
    np.testing.assert_array_equal(first.q_rad, second.q_rad)
    first.run_to(2 * S)
    np.testing.assert_array_equal(first.q_rad, after)


def test_switches_changes_are_told_once_and_a_snapshot_goes_back_behind_them():
    """A free link turns at 0.1 rad/s into its switch and, sent back, out of it."""
    switch = LimitSwitch(0, "D9", 0.1, above=True)
    plant = Plant(Rig(ARM[:1], (Joint(),), (), (0.0,), gravity_m_s2=0.0, switches=(switch,)), step_cycles=800)
    plant.set_motion((0.0,), (0.1,))
    plant.run_to(S // 2)
    kept = plant.snapshot()
    assert plant.switch_changes() == ()
    plant.run_to(3 * S // 2)
    (pressed,) = plant.switch_changes()
    assert pressed.pressed and abs(pressed.cycle - S) <= 800
    plant.set_motion(tuple(plant.q_rad), (-0.1,))
    plant.run_to(5 * S // 2)
    both = plant.switch_changes()
    assert both == (pressed, SwitchChange(both[1].cycle, 0, False)) and abs(both[1].cycle - 2 * S) <= 800
    assert plant.switch_changes(after=1) == both[1:] and plant.switch_changes(after=2) == ()
    plant.restore(kept)
    assert plant.switch_changes() == ()
    plant.run_to(3 * S // 2)
    assert plant.switch_changes() == (pressed,)


LIGHT = (Link.rod(0.104, 0.0085), Link.rod(0.268, 0.0108))


def light_behind_stiff(stiffness_nm_rad, damping=None, links=LIGHT):
    """Links of some grams, rotors of 480 g cm2 behind gears of 10: the links, not the rotors, vibrate fastest."""
    motor = Motor(
        rotor_inertia_kg_m2=4.8e-5,
        gear_ratio=10.0,
        detent_torque_nm=0.0,
        damping_nm_s=0.0,
        stiffness_nm_rad=stiffness_nm_rad,
        stiffness_damping_nm_s=damping,
    )
    return Rig(links, (Joint(),) * len(links), (motor,) * len(links), (0.3, 0.0)[: len(links)])


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 3e6])
def test_light_links_behind_stiff_gears_are_computed_in_shorter_steps(stiffness):
    plant = Plant(light_behind_stiff(stiffness))
    plant.set_motion((0.3, 0.0), (3.0, -2.0))
    before = plant.energy_j
    for k in range(1, 11):
        plant.run_to(k * S // 100)
        assert plant.energy_j < 1.001 * before


def test_a_step_that_is_too_long_tells_which_setting_of_a_scene_would_help():
    plant = Plant(light_behind_stiff(1e5), step_cycles=800)
    plant.set_motion((0.3, 0.0), (3.0, -2.0))
    with pytest.raises(UsageError, match=r"800 cycles is too long .* lower mechanics\.stiffness_nm_rad"):
        plant.run_to(S // 10)


def test_the_fastest_vibration_is_that_of_two_bodies_on_a_spring():
    rig = light_behind_stiff(1e5, damping=0.0, links=(Link.rod(0.2, 0.01),))
    rig = replace(rig, motors=(replace(rig.motors[0], current_a=1e-9),))
    link, rotor = 0.01 * 0.2**2 / 3.0, 4.8e-5 * 10.0**2
    assert fastest_per_s(rig) == pytest.approx(math.sqrt(1e5 * (1.0 / link + 1.0 / rotor)), rel=1e-6)
    damped = replace(rig, motors=(replace(rig.motors[0], stiffness_damping_nm_s=1e3),))
    assert fastest_per_s(damped) == pytest.approx(1e3 * (1.0 / link + 1.0 / rotor), rel=1e-3)


@pytest.mark.parametrize("links", [2, 3, 4])
def test_no_pose_vibrates_faster_than_the_step_allows_for(links):
    """Poses at random, and the joints' equations instead of the links' directions."""
    rng = np.random.default_rng(links)
    rods = some_links(rng, links)
    motor = Motor(
        stiffness_damping_nm_s=0.0, damping_nm_s=0.0, current_a=1e-9, detent_torque_nm=0.0, rotor_inertia_kg_m2=1e-3
    )
    most = fastest_per_s(Rig(rods, (Joint(),) * links, (motor,) * links, (0.0,) * links))
    a, _ = inertia_constants(rods)
    turns = np.tril(np.ones((links, links)))
    for q in rng.uniform(-math.pi, math.pi, (200, links)):
        phi = np.cumsum(q)
        inertia = turns.T @ (a * np.cos(phi[:, None] - phi)) @ turns
        inverse = np.linalg.inv(inertia) + np.eye(links) / motor.rotor_inertia_kg_m2
        assert math.sqrt(motor.stiffness_nm_rad * np.linalg.eigvalsh(inverse).max()) <= (1.0 + 1e-9) * most


def test_rigs_that_do_not_fit_are_refused():
    with pytest.raises(UsageError, match="as many joints"):
        Rig(ARM, (Joint(),), (), (0.0, 0.0))
    with pytest.raises(UsageError, match="no inverse"):
        Rig(ARM, (Joint(),) * 2, (Motor(),) * 2, (0.0, 0.0), coupling=((1.0, 0.0), (2.0, 0.0)))
    with pytest.raises(UsageError, match="last link has no inertia"):
        Rig((ARM[0], Link(0.2, 0.1, 0.0, 0.0)), (Joint(),) * 2, (), (0.0, 0.0))


def test_an_arm_that_somebody_holds_falls_only_after_its_drivers_let_go_of_it():
    """Held by hand until both drivers are on, by them from then on; by nobody once they are off."""
    motor = Motor(gear_ratio=20.0)
    rig = Rig(ARM, (Joint(0.01), Joint(0.01)), (motor,) * 2, (0.3, 0.4), gravity_m_s2=GRAVITY)
    phases = Plant(rig).start_phases
    dropped, held = Plant(rig), Plant(rig, propped=True)
    for plant in (dropped, held):
        plant.take(np.array([[0, m, phase, 0] for m, phase in enumerate(phases)]))
        plant.run_to(S)
    assert np.abs(dropped.q_rad - rig.start_rad).max() > 0.5
    assert held.q_rad == pytest.approx(rig.start_rad, abs=1e-12)
    held.take(np.array([[S + 1000, 0, phases[0], 1], [S + 60_000, 1, phases[1], 1]]))
    held.run_to(2 * S)
    assert np.abs(held.q_rad - rig.start_rad).max() < 0.01, "the load angle, and what play there is"
    again = held.snapshot()
    held.take(np.array([[2 * S + 1000, m, phase, 0] for m, phase in enumerate(phases)]))
    held.run_to(3 * S)
    assert np.abs(held.q_rad - rig.start_rad).max() > 0.5
    held.restore(again)
    assert np.abs(held.q_rad - rig.start_rad).max() < 0.01
