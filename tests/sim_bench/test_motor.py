"""Stepper motors: torque by load angle, losses in fours, resonance, and pull-out as supply and inductance have it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from planarm_sim.plant import Joint, Link, Motor, Plant, Rig
from planarm_sim.plant.pull_out import pull_out_steps_s

S = 16_000_000
BARE = Motor(detent_torque_nm=0.0)


def one_motor(motor, coulomb_nm=0.0, viscous_nm_s=0.0, inertia_kg_m2=2e-5):
    link = Link(0.05, 1e-6, 0.0, inertia_kg_m2)
    return Plant(Rig((link,), (Joint(coulomb_nm, viscous_nm_s),), (motor,), (0.0,)))


def hold(plant, phase=0, on=1, cycle=0):
    plant.take(np.array([[cycle, 0, phase, on]]))


def steps_at(rate_hz, count, size=256, begin=0):
    events = np.zeros((count + 1, 4), np.int64)
    events[:, 0] = begin + np.rint(np.arange(count + 1) * S / rate_hz)
    events[:, 2] = np.arange(count + 1) * size
    events[:, 3] = 1
    return events


def test_a_load_turns_the_rotor_by_the_angle_that_balances_it():
    """T = T_peak sin(N delta), N = 50 teeth."""
    plant = one_motor(BARE, viscous_nm_s=0.01)
    hold(plant)
    plant.run_to(S // 10)
    for share in (0.3, 0.6, 0.9):
        plant.set_outside_torque(0, share * BARE.peak_torque_nm)
        plant.run_to(plant.cycle + S)
        assert plant.rotors_rad[0] == pytest.approx(math.asin(share) / 50, rel=1e-3)
    assert plant.slips() == ()


def test_a_load_beyond_the_holding_torque_takes_the_rotor_along_in_fours():
    plant = one_motor(BARE, viscous_nm_s=0.02)
    hold(plant)
    plant.run_to(S // 10)
    plant.set_outside_torque(0, -1.05 * BARE.peak_torque_nm)
    plant.run_to(plant.cycle + S // 2)
    plant.set_outside_torque(0, 0.0)
    plant.run_to(plant.cycle + 2 * S)
    lost = plant.lost_full_steps(np.zeros(1, np.int64))[0]
    assert lost > 3.9
    assert lost / 4 == pytest.approx(round(lost / 4), abs=1e-3)
    assert sum(slip.full_steps for slip in plant.slips()) == round(lost)
    assert {slip.full_steps for slip in plant.slips()} == {4}


def test_the_holding_torque_is_that_of_the_data_sheet_at_the_rated_current_in_both_phases():
    """Micro-steps of a peak of sqrt(2) times the rated current have that current in both phases at 45 degrees."""
    motor = replace(BARE, current_a=BARE.rated_current_a * math.sqrt(2))
    assert motor.peak_torque_nm == pytest.approx(motor.holding_torque_nm)
    for share, slips in ((0.99, False), (1.01, True)):
        plant = one_motor(motor, viscous_nm_s=0.05)
        hold(plant, 128)
        plant.run_to(S // 2)
        plant.set_outside_torque(0, share * motor.holding_torque_nm)
        plant.run_to(plant.cycle + 2 * S)
        assert bool(plant.slips()) is slips


def test_currents_rise_as_the_winding_lets_them():
    """A blocked rotor: i(t) = V / R (1 - exp(-t R / L)) until the reference."""
    motor = replace(BARE, coulomb_nm=1e3)
    plant = one_motor(motor)
    hold(plant)
    tau_s = motor.inductance_h / motor.resistance_ohm
    for t_s in (50e-6, 100e-6):
        plant.run_to(round(t_s * S))
        wanted = motor.supply_v / motor.resistance_ohm * (1 - math.exp(-t_s / tau_s))
        assert plant.currents_a[0, 0] == pytest.approx(wanted, rel=0.03)  # the step is 50 us
    plant.run_to(S // 100)
    assert plant.currents_a[0].tolist() == [motor.current_a, 0.0]


def test_without_current_only_the_detent_torque_holds():
    detent = Motor(detent_torque_nm=0.03)
    plant = one_motor(detent, viscous_nm_s=0.05)
    hold(plant, on=0)
    plant.set_outside_torque(0, 0.029)
    plant.run_to(S)
    assert abs(plant.rotors_rad[0]) < math.pi / 2 / 50 / 4
    plant.set_outside_torque(0, 0.031)
    plant.run_to(2 * S)
    assert plant.rotors_rad[0] > 0.1  # on its way at sqrt(0.031^2 - 0.030^2) / 0.05 rad/s, past 12 detent positions


def test_full_steps_at_the_natural_frequency_swing_far_and_micro_steps_do_not():
    """omega^2 = N T / J: the rotor rings there, and full steps in its time drive it (field notes: resonance)."""
    motor = replace(BARE, current_a=0.4, damping_nm_s=1e-4)
    inertia = 2e-5
    natural_hz = math.sqrt(50 * motor.peak_torque_nm / (inertia + motor.rotor_inertia_kg_m2)) / (2 * math.pi)

    def swing(rate_hz, size):
        plant = one_motor(motor, inertia_kg_m2=inertia)
        plant.take(steps_at(rate_hz, int(0.6 * rate_hz), size))
        plant.run_to(int(0.55 * S))
        motion = plant.motion()
        late = motion["cycle"] > 0.2 * S
        wanted = motion["cycle"] / S * rate_hz * size / 256 * (2 * math.pi / 200)
        error = motion["rotor_rad"][:, 0] - wanted
        return np.ptp(error[late]) / (2 * math.pi / 200), len(plant.slips())

    resonant, lost = swing(natural_hz, 256)
    calm, calm_lost = swing(0.37 * natural_hz, 256)
    fine, fine_lost = swing(16 * natural_hz, 16)
    assert lost > 0 or resonant > 2.0 * calm
    assert calm_lost == fine_lost == 0
    assert fine < 0.3 * resonant


REAL = [(2.8e-3, 1.7), (4.2e-3, 1.5)]


@pytest.mark.parametrize(("inductance_h", "current_a"), REAL)
@pytest.mark.parametrize("supply_v", [12.0, 24.0, 36.0])
def test_torque_begins_to_fall_at_the_corner_speed(inductance_h, current_a, supply_v):
    """V / (2 L I) full steps a second (docs of the driver makers; field notes 3.2), within 20 %.

    The rule is about currents, so the rotor's own damping is a load like any other. "Begins": 5 % less than at rest.
    Below that speed no step is lost: it is that of the first loss.
    """
    motor = Motor(
        supply_v=supply_v,
        inductance_h=inductance_h,
        current_a=current_a,
        rated_current_a=current_a,
        detent_torque_nm=0.0,
    )
    corner = supply_v / (2 * inductance_h * current_a)
    load_nm = 0.95 * motor.peak_torque_nm - motor.damping_nm_s * corner * 2 * math.pi / motor.steps_per_rev
    assert pull_out_steps_s(motor, load_nm) == pytest.approx(corner, rel=0.2)


def test_more_load_pulls_out_sooner_and_twice_the_turns_need_twice_the_supply():
    """A winding of twice the turns: 4 L, 4 R, half the current for the same field. Twice the supply, the same motor."""
    motor = Motor()
    speeds = [pull_out_steps_s(motor, share * motor.peak_torque_nm) for share in (0.3, 0.5, 0.7)]
    assert speeds[0] > speeds[1] > speeds[2] > 500
    twice = replace(
        motor,
        inductance_h=4 * motor.inductance_h,
        resistance_ohm=4 * motor.resistance_ohm,
        current_a=motor.current_a / 2,
        rated_current_a=motor.rated_current_a / 2,
        supply_v=2 * motor.supply_v,
    )
    assert pull_out_steps_s(twice, 0.5 * motor.peak_torque_nm) == pytest.approx(speeds[1], rel=1e-6)


def test_backlash_lets_the_joint_move_by_the_play_and_no_more():
    motor = Motor(gear_ratio=5.0, backlash_rad=0.02, detent_torque_nm=0.0)
    plant = one_motor(motor, viscous_nm_s=0.05, inertia_kg_m2=1e-3)
    hold(plant)
    ends = []
    for torque in (0.01, -0.01):
        plant.set_outside_torque(0, torque)
        plant.run_to(plant.cycle + 2 * S)
        ends.append(plant.q_rad[0])
    assert ends[0] - ends[1] == pytest.approx(0.02, rel=0.02)


def test_a_belt_driven_elbow_turns_with_the_sum_of_the_joints():
    """Motor 2 stands still while joint 1 turns by a: then theta1 + theta2 stays, so joint 2 turns back by a."""
    motor = Motor(gear_ratio=5.0)
    links = (Link.rod(0.3, 0.12), Link.rod(0.2, 0.08))
    rig = Rig(links, (Joint(0.02, 0.05),) * 2, (motor, motor), (0.2, -0.4), coupling=((1.0, 0.0), (1.0, 1.0)))
    plant = Plant(rig)
    start = plant.start_phases
    plant.take(np.array([[0, 0, start[0], 1], [0, 1, start[1], 1]]))
    events = steps_at(800, 640, 16, S // 10)
    events[:, 2] += start[0]
    plant.take(events)
    plant.run_to(2 * S)
    turned = 640 / 16 / 200 * 2 * math.pi / 5
    assert plant.slips() == ()
    np.testing.assert_allclose(plant.q_rad, [0.2 + turned, -0.4 - turned], atol=2e-3)
