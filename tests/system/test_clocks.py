"""The released image on a board whose resonator is fast or slow: start, place and drift as the pins have them."""

from dataclasses import replace
from pathlib import Path

import pytest

from planarm.link.exchange import stream_plan
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm.pipeline import plan_scene
from planarm.scene import load_scene
from planarm.stepping.expand import expand
from planarm.streaming.moving_run import EARLY_S, Room, Timekeeper
from planarm.streaming.plan_stream import options_for
from planarm_wire.messages import STEP_PINS, TICKS_HZ
from skewed_line import SkewedLine

SCENE = Path(__file__).resolve().parents[2] / "examples/table1_case1.toml"
PPM = 1e-6


@pytest.fixture(scope="module")
def plan():
    return plan_scene(load_scene(SCENE), lambda _stage, _share: None)


def line_with(drift_ppm, usb="direct"):
    """A board that is so many millionths fast, behind a computer whose clock is at 5000 s when the board starts."""
    return SkewedLine(SimTransport(released_image(), usb=usb), 1.0 / (1.0 + drift_ppm * PPM), 5000.0)


def rises(line):
    """Cycles of the rising edges of each joint."""
    edges = [line.inner.pins.edges(pin) for pin in STEP_PINS]
    return [one["cycle"][one["level"] == 1] for one in edges]


@pytest.mark.parametrize("usb", ["direct", "16u2"])
@pytest.mark.parametrize("drift_ppm", [-5000, 0, 3000])
def test_start_place_and_drift_are_within_what_is_told(plan, drift_ppm, usb):
    line, told = line_with(drift_ppm, usb), []
    result = stream_plan(line, plan.segments.segments, told.append, options_for(plan.scene, plan.segments))
    drift = result.board_clock.drift_ppm
    assert drift.least <= drift_ppm <= drift.most
    assert drift.plus_minus < 3000.0, "two seconds, and a millisecond or two of which nobody knows whose delay it is"
    assert result.board_clock.restarts == 0
    assert result.board_clock.moment_s < (0.002 if usb == "direct" else 0.006)
    planned, made = [joint.ticks for joint in expand(plan.segments).steps], rises(line)
    start_cycle = made[0][0] - planned[0][0]
    assert result.began_s.least <= line.host_s(start_cycle / TICKS_HZ) <= result.began_s.most
    assert result.began_s.most - result.began_s.least < (0.003 if usb == "direct" else 0.008)
    looked = 0
    for one in told:
        if 0 < one.executed_segments < one.total_segments:
            # Where the motion was at both ends of the time in which the status was made.
            least, most = ((at_s - line.zero_s) / line.rate * TICKS_HZ - start_cycle for at_s in _ends(one.made_s))
            assert least / TICKS_HZ <= one.path_span_s.most + 1e-6
            assert most / TICKS_HZ >= one.path_span_s.least - 1e-6
            looked += 1
    assert looked > 20


def _ends(span):
    return span.least, span.most


def arrival(plan, drift_ppm, steered):
    """How late the last step came by the computer's clock, in seconds, and the timekeeper."""
    line = line_with(drift_ppm)
    start_s = line.now_s() + 0.4
    keeper = Timekeeper(line.clock, start_s, Room(2.0, 0.5))
    options = replace(options_for(plan.scene, plan.segments), start_at_s=start_s)
    steer = keeper.steer if steered else None
    stream_plan(line, plan.segments.segments, keeper.watch, options, steer=steer)
    last = max(int(cycles[-1]) for cycles in rises(line))
    due_s = start_s + max(int(joint.ticks[-1]) for joint in expand(plan.segments).steps) / TICKS_HZ
    return line.host_s(last / TICKS_HZ) - due_s, keeper


def test_a_board_that_runs_fast_is_braked_to_the_computers_time(plan):
    """0.5 % of case 1's two seconds are ten milliseconds."""
    unsteered_s, _ = arrival(plan, 5000, steered=False)
    assert unsteered_s < -0.008
    steered_s, keeper = arrival(plan, 5000, steered=True)
    assert abs(steered_s) < EARLY_S + 0.004
    assert keeper.early_s < EARLY_S + 0.002
    assert not keeper.stopping


def test_a_board_that_runs_slow_is_told_late_by_what_it_is(plan):
    late_s, keeper = arrival(plan, -5000, steered=True)
    assert 0.009 < late_s < keeper.late_s + 1e-4 < late_s + 0.01
    assert keeper.early_s == 0.0


def test_without_drift_the_path_clock_is_left_alone(plan):
    late_s, keeper = arrival(plan, 0, steered=True)
    assert 0.0 <= late_s < 0.003
    assert keeper.early_s <= EARLY_S
