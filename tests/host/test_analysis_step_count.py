"""Steps are judged from waveforms: each defect that a driver would see is found, and only that."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planarm.analysis.step_count import MeasuredSteps, Waveform, compare_steps, measure_steps, start_tick_of

HIGH_TICKS = 48


def waveform(ticks, levels):
    return Waveform(np.array(ticks, np.int64), np.array(levels, np.uint8))


def pulses(rises):
    """A STEP waveform with one pulse of HIGH_TICKS at each rise."""
    ticks = [t + d for t in rises for d in (0, HIGH_TICKS)]
    return waveform(ticks, [1, 0] * len(rises))


@st.composite
def step_trains(draw):
    """Rises at least 800 ticks apart, each with a direction."""
    gaps = draw(st.lists(st.integers(800, 60_000), min_size=1, max_size=40))
    rises = np.cumsum(gaps).astype(np.int64)
    directions = np.array(draw(st.lists(st.sampled_from([-1, 1]), min_size=len(gaps), max_size=len(gaps))), np.int8)
    return rises, directions


def direction_waveform(rises, directions, setup_ticks=400):
    """DIR changes setup_ticks before the step that needs it; low before the first edge."""
    ticks, levels, level = [], [], 0
    for rise, direction in zip(rises, directions, strict=True):
        wanted = int(direction > 0)
        if wanted != level:
            ticks.append(rise - setup_ticks)
            levels.append(wanted)
            level = wanted
    return waveform(ticks, levels)


@given(step_trains(), st.integers(0, 10**9))
def test_a_faithful_waveform_agrees_whatever_its_start(train, start):
    rises, directions = train
    measured = measure_steps(pulses(rises + start), direction_waveform(rises + start, directions))
    found = compare_steps([(rises, directions)], [measured])
    assert found.agrees
    assert found.max_timing_error_ticks == 0
    assert measured.net_usteps == int(directions.sum())
    assert measured.min_high_ticks == HIGH_TICKS


@given(step_trains(), st.data())
def test_one_missing_step_is_found(train, data):
    rises, directions = train
    gone = data.draw(st.integers(0, len(rises) - 1))
    measured = measure_steps(pulses(np.delete(rises, gone)), direction_waveform(rises, directions))
    found = compare_steps([(rises, directions)], [measured])
    assert not found.agrees
    assert found.steps_at_pins == (len(rises) - 1,)
    assert found.max_timing_error_ticks is None


@given(step_trains())
def test_a_late_direction_turns_the_step_around(train):
    rises, directions = train
    late = direction_waveform(rises, directions, setup_ticks=-1)
    measured = measure_steps(pulses(rises), late)
    changes = len(late.ticks)
    assert compare_steps([(rises, directions)], [measured]).agrees == (changes == 0)


@given(step_trains(), st.data())
def test_one_late_step_is_measured_to_the_tick(train, data):
    rises, directions = train
    still = measure_steps(pulses(rises), direction_waveform(rises, directions))
    late = data.draw(st.integers(0, len(rises) - 1))
    shifted = rises.copy()
    shifted[late] += 7
    moved = MeasuredSteps(shifted, directions, None, None, None, None)
    found = compare_steps([(rises, directions), (rises, directions)], [still, moved])
    assert found.agrees
    assert found.max_timing_error_ticks == 7


def test_widths_are_the_least_of_all_pulses():
    step = waveform([1000, 1050, 2000, 2040, 4000, 4060], [1, 0, 1, 0, 1, 0])
    direction = waveform([300, 2100], [1, 0])
    measured = measure_steps(step, direction)
    assert measured.min_high_ticks == 40
    assert measured.min_low_ticks == 950
    assert measured.min_dir_setup_ticks == 700
    assert measured.min_dir_hold_ticks == 100
    assert measured.directions.tolist() == [1, 1, -1]


def test_a_motionless_plan_agrees_with_silent_pins():
    empty = (np.empty(0, np.int64), np.empty(0, np.int8))
    silent = measure_steps(waveform([], []), waveform([], []))
    found = compare_steps([empty], [silent])
    assert found.agrees
    assert found.max_timing_error_ticks == 0


def test_the_start_is_told_by_the_middle_of_the_first_steps():
    exact = np.arange(1000, 101_000, 1000, dtype=np.int64)
    early = np.array([900, 50_000], np.int64)  # by an interrupt that makes it 90 ticks early
    slowed = np.where(exact > 80_000, 4_000, 0)  # and the device slows the motion down towards its end
    assert start_tick_of([exact, early], [exact + 7_000 + slowed, early + 7_000 - 90]) == 7_000
    assert start_tick_of([exact, early], [exact[:3] + 7_000, early[:0]]) == 7_000, "it broke off"
    assert start_tick_of([early[:0]], [early[:0]]) == 0


@pytest.mark.parametrize("extra_ticks", [1, 500])
def test_two_joints_share_one_offset(extra_ticks):
    first = np.array([1000, 2000], np.int64)
    second = np.array([1500, 2500], np.int64)
    ahead = np.array([1, 1], np.int8)
    measured = [
        MeasuredSteps(first + 90_000, ahead, None, None, None, None),
        MeasuredSteps(second + 90_000 + extra_ticks, ahead, None, None, None, None),
    ]
    found = compare_steps([(first, ahead), (second, ahead)], measured)
    assert found.max_timing_error_ticks == extra_ticks
