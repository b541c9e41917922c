"""Every driver and rule: a waveform that keeps it just so is fine; one cycle less is told, and has its price."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_sim.board.pins import pin_place
from planarm_sim.drivers import DRIVERS, RULES, DriverBank, DriverWiring, driver_row
from planarm_sim.errors import UsageError

CYCLE_S = 62.5e-9
EDGE = np.dtype([("cycle", np.int64), ("pin", np.uint8), ("level", np.uint8)])
STEP, DIR, ENABLE, SLEEP = "D9", "D4", "D8", "D7"
MODES = ("D11", "D12", "D13")
START = 10_000_000


class Wave:
    """A waveform under construction; all inputs begin low, ENABLE high where it is to be switched on."""

    def __init__(self):
        self.edges = []

    def set(self, cycle, pin, level):
        self.edges.append((cycle, pin_place(pin).index, level))
        return self

    def pulse(self, cycle, high=400):
        return self.set(cycle, STEP, 1).set(cycle + high, STEP, 0)

    def array(self):
        return np.array(sorted(self.edges, key=lambda e: e[0]), EDGE)


def bank_for(row, **changes):
    highs = changes.pop("highs", ())
    levels = [0] * 24
    for pin in highs:
        levels[pin_place(pin).index] = 1
    wiring = replace(DriverWiring(row, STEP, DIR, ENABLE, microsteps=row.microsteps[0]), **changes)
    return DriverBank([wiring], levels, [0])


def least_cycles(row, rule):
    return math.ceil(round(row.limit_s(rule) / CYCLE_S, 6))


def made(bank, wave):
    """Steps taken, in steps of the size that holds at the end."""
    bank.see(wave.array(), START * 2)
    return bank.counts()[0].made


def wave_for(rule, gap):
    """Return a waveform that keeps `rule` by `gap` cycles, the wiring it needs, and its steps when all is well."""
    w = Wave()
    if rule == "step_high":
        return w.pulse(START, gap), {}, -1
    if rule == "step_low":
        return w.pulse(START).pulse(START + 400 + gap), {}, -2
    if rule == "step_period":
        return w.pulse(START, gap // 2).pulse(START + gap, gap // 2), {}, -2
    if rule == "dir_setup":
        return w.set(START - gap, DIR, 1).pulse(START), {}, 1
    if rule == "dir_hold":
        return w.pulse(START).set(START + gap, DIR, 1), {}, -1
    if rule == "enable_setup":
        return w.set(START - gap, ENABLE, 0).pulse(START), {"highs": (ENABLE,)}, -1
    if rule == "wake_up":
        return w.set(START - gap, SLEEP, 1).pulse(START), {"sleep": SLEEP}, -1
    assert rule == "mode_setup"
    return w.set(START - gap, MODES[0], 1).pulse(START), {"mode_pins": MODES}, -1


PRICE = {
    "step_high": "no step",
    "step_low": "one step for two pulses",
    "step_period": "one step for two pulses",
    "dir_setup": "a step the old way",
    "dir_hold": "a step the new way",
    "enable_setup": "no step",
    "wake_up": "no step",
    "mode_setup": "a step of the old size",
}
PRICED = {
    "no step": lambda right: 0,
    "one step for two pulses": lambda right: right / 2,
    "a step the old way": lambda right: -right,
    "a step the new way": lambda right: -right,
    # From full to half steps: the old size is two of the new.
    "a step of the old size": lambda right: 2 * right,
}
CASES = [(name, rule) for name, row in DRIVERS.items() for rule in RULES if row.limit_s(rule) is not None]


@pytest.mark.parametrize(("name", "rule"), CASES)
def test_just_inside_is_fine_and_just_outside_is_told_and_has_its_price(name, rule):
    row = DRIVERS[name]
    least = least_cycles(row, rule)
    wave, wiring, right = wave_for(rule, least)
    inside = bank_for(row, **wiring)
    assert made(inside, wave) == right
    assert inside.violations() == ()

    wave, wiring, right = wave_for(rule, least - 1)
    outside = bank_for(row, **wiring)
    assert made(outside, wave) == PRICED[PRICE[rule]](right)
    broken = outside.violations()
    assert [v.rule for v in broken] == [rule]
    assert broken[0].pin == STEP
    assert broken[0].measured_ns == pytest.approx((least - 1) * 62.5)
    assert broken[0].limit_ns == pytest.approx(1e9 * row.limit_s(rule))
    assert START <= broken[0].cycle <= START + 400 + least


def test_every_rule_is_some_driver_s_and_every_driver_has_rules():
    assert {rule for _, rule in CASES} == set(RULES)
    assert {name for name, _ in CASES} == set(DRIVERS) == {"a4988", "drv8825", "tmc2208", "tmc2209", "dm542", "tb6600"}
    assert all("all" in row.source for row in DRIVERS.values())


@pytest.mark.parametrize("name", DRIVERS)
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_of_a_waveform_that_keeps_every_rule_each_pulse_is_a_step(name, seed):
    """Also in any pieces: what is handed over in parts means the same."""
    row, rng = DRIVERS[name], np.random.default_rng(seed)
    high, low = least_cycles(row, "step_high"), least_cycles(row, "step_low")
    setup = least_cycles(row, "dir_setup")
    hold = 0 if row.dir_hold_s is None else least_cycles(row, "dir_hold")
    wave, cycle, level, net = Wave(), START, 0, 0
    for _ in range(60):
        if rng.random() < 0.3:
            level = 1 - level
            cycle += max(hold, 1)
            wave.set(cycle, DIR, level)
            cycle += setup
        wave.pulse(cycle, high)
        net += 1 if level else -1
        cycle += high + low + int(rng.integers(0, 50)) + (0 if row.step_period_s is None else 80)
    whole, pieces = bank_for(row), bank_for(row)
    edges = wave.array()
    assert made(whole, wave) == net == whole.counts()[0].wanted
    assert whole.violations() == ()
    events = []
    for part in np.array_split(edges, 17):
        events.append(pieces.see(part, int(part["cycle"][-1])))
    events.append(pieces.see(edges[:0], START * 2))
    assert pieces.counts() == whole.counts()
    assert len(np.concatenate(events)) == 60


def test_steps_are_told_in_order_with_the_phase_that_they_lead_to():
    bank = bank_for(DRIVERS["a4988"], microsteps=16)
    wave = Wave().set(START - 100, DIR, 1).pulse(START).pulse(START + 3200)
    events = bank.see(wave.array(), START + 10_000)
    assert events[:, 0].tolist() == [START + 16, START + 3216]  # taken when 1 us high
    assert events[:, 2].tolist() == [16, 32]  # 1/16 of a step is 16/256
    assert events[:, 3].tolist() == [1, 1]


def test_released_outputs_carry_no_current_and_the_phase_of_chips_goes_on():
    wave = Wave().set(START - 100, ENABLE, 1).pulse(START)
    chip, box = bank_for(DRIVERS["a4988"]), bank_for(DRIVERS["dm542"])
    for bank, steps in ((chip, -1), (box, 0)):
        events = bank.see(wave.array(), START + 10_000)
        assert events[0].tolist()[3] == 0
        assert bank.counts()[0].made == steps
        assert bank.counts()[0].wanted == -1


def test_when_motor_supply_returns_the_driver_is_at_home():
    """A4988: 45 electrical degrees, which is 128 of 1024; steps in the first millisecond are lost."""
    bank = bank_for(DRIVERS["a4988"], microsteps=16)
    bank.see(Wave().set(START - 100, DIR, 1).pulse(START).array(), START + 1000)
    off = bank.set_power(0, False, START + 1000)
    assert off[0].tolist() == [START + 1000, 0, 16, 0]
    bank.see(Wave().pulse(START + 2000).array(), START + 3000)
    on = bank.set_power(0, True, START + 4000)
    assert on[0].tolist() == [START + 4000, 0, 128, 1]
    bank.see(Wave().pulse(START + 4000 + 15_999).pulse(START + 4000 + 30_000).array(), START + 50_000)
    assert [v.rule for v in bank.violations()] == ["wake_up"]
    assert bank.counts()[0].made == 2
    assert bank.counts()[0].wanted == 4


def test_finer_steps_off_their_lattice_go_to_the_next_place_of_it():
    """One sixteenth, then full steps: the next full position, not one full step."""
    row = DRIVERS["a4988"]
    bank = bank_for(row, mode_pins=MODES, highs=MODES)
    wave = Wave().set(START - 100, DIR, 1).pulse(START)
    for pin in MODES:
        wave.set(START + 1000, pin, 0)
    bank.see(wave.pulse(START + 2000).array(), START + 10_000)
    assert bank.states[0, 0] == 256


def test_what_a_driver_cannot_do_is_refused():
    with pytest.raises(UsageError, match="no 32 micro-steps; it has 1, 2, 4, 8, 16"):
        DriverWiring(DRIVERS["a4988"], STEP, DIR, microsteps=32)
    with pytest.raises(UsageError, match="Closest: a4988"):
        driver_row("A4998")
    with pytest.raises(UsageError, match="3 mode pins"):
        DriverWiring(DRIVERS["a4988"], STEP, DIR, mode_pins=("D2",))
