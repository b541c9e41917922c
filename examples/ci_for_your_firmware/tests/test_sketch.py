"""The sketch on the emulated bench: a driver that minds its timing, a motor that can lose steps, an arm."""

import math

import pytest

DRIVER = {"driver": "a4988", "step": "D2", "direction": "D5", "enable": "D8", "microsteps": 16}


@pytest.mark.uno(firmware="../build/sketch.elf")
@pytest.mark.bench(drivers=[DRIVER])
def test_the_arm_turns_once_there_and_back(bench):
    start = bench.q_rad[0]
    bench.run(seconds=1.9)
    assert bench.q_rad[0] - start == pytest.approx(2 * math.pi, abs=0.02)
    bench.run(seconds=2.2)
    assert bench.q_rad[0] == pytest.approx(start, abs=0.02)
    assert bench.report().clean


@pytest.mark.uno(firmware="../build/buggy.elf")
@pytest.mark.bench(drivers=[DRIVER])
def test_the_bug_is_found_at_its_pulse(bench):
    bench.run(seconds=0.1)
    first = bench.report().violations[0]
    assert (first.pin, first.rule, first.measured_ns, first.limit_ns) == ("D2", "step_high", 125.0, 1000.0)
