"""The board's clock and the computer's: the truth lies within what is told, whatever the delays, and little more."""

import random

import numpy as np
import pytest

from link_model import motion
from planarm.link.clock_sync import SPAN_S, ClockSync
from planarm.link.path_time import PathTime
from planarm.link.plan_steps import PlanSteps
from planarm_wire.messages import TICKS_HZ
from planarm_wire.steps import duration_ticks, expand_moves, signed_steps


class Clocks:
    """A board whose clock runs at a rate of its own, and a line with delays; `at` is the computer's time."""

    def __init__(self, seed, slowness, begin_ticks=0):
        self.dice = random.Random(seed)
        self.slowness, self.begin_ticks = slowness, begin_ticks
        self.least_s = (self.dice.uniform(0.0, 0.003), self.dice.uniform(0.0, 0.008))

    def ticks(self, at_s):
        return round(self.begin_ticks + TICKS_HZ * at_s / (1.0 + self.slowness))

    def exchange(self, at_s):
        """(sent, ticks modulo 2^32, received, when it was made) of one question that is handled at `at_s`."""
        there, back = (least + self.dice.expovariate(300.0) * self.dice.random() for least in self.least_s)
        return at_s - there, self.ticks(at_s) % 2**32, at_s + back, at_s


@pytest.mark.parametrize("seed", range(30))
def test_the_truth_is_within_what_is_told(seed):
    slowness = random.Random(seed).uniform(-0.0055, 0.0055)
    clocks, sync = Clocks(seed, slowness, begin_ticks=seed * 10**9), ClockSync()
    at_s = 1000.0
    for n in range(1500):
        at_s += clocks.dice.choice((0.002, 0.02, 0.05))
        sent, ticks, received, made = clocks.exchange(at_s)
        told = sync.take(sent, ticks, received)
        assert told.least - 1e-6 <= made <= told.most + 1e-6
        assert sent - 1e-9 <= told.least
        assert told.most <= received + 1e-9
        if n > 50:
            drift = sync.reading().drift_ppm
            assert drift.least - 0.1 <= 1e6 * (1.0 / (1.0 + slowness) - 1.0) <= drift.most + 0.1
    reading = sync.reading()
    assert reading.restarts == 0
    assert reading.replies == 1500
    # The quickest way there and back leaves so much open, whatever anyone computes; ten more percent at most.
    assert reading.moment_s <= 0.55 * sum(clocks.least_s) + 1e-4
    assert reading.drift_ppm.plus_minus <= 1e6 * (1.2 * sum(clocks.least_s) + 2e-4) / (0.5 * SPAN_S)


def test_ticks_are_told_apart_over_turns_of_the_counter_and_long_silences():
    clocks, sync = Clocks(1, 0.004, begin_ticks=2**32 - 1000), ClockSync()
    at_s = 0.0
    for pause_s in (0.01, 0.01, 300.0, 0.01, 2000.0, 5.0, 9000.0):
        at_s += pause_s
        sent, ticks, received, made = clocks.exchange(at_s)
        told = sync.take(sent, ticks, received)
        assert told.least <= made <= told.most
    assert sync.reading().restarts == 0


def test_a_clock_that_jumps_begins_anew_and_is_counted():
    clocks, sync = Clocks(2, 0.0), ClockSync()
    for n in range(100):
        sync.take(*clocks.exchange(0.02 * n)[:3])
    clocks.begin_ticks += TICKS_HZ // 2
    sent, ticks, received, made = clocks.exchange(2.5)
    told = sync.take(sent, ticks, received)
    assert told.least <= made <= told.most
    assert sync.reading().restarts == 1


def test_before_the_first_reply_nothing_is_known():
    assert ClockSync().reading() is None


def ledgers(segments):
    """Yield (path tick, whole segments executed, moved) a tick before each step and border, and at it."""
    starts = np.cumsum([0, *map(duration_ticks, segments)])
    joints = len(segments[0].moves)
    steps = [[], []]
    for start, segment in zip(starts[:-1].tolist(), segments, strict=True):
        for joint, ticks in enumerate(expand_moves(segment)):
            sign = 1 if signed_steps(segment.moves[joint]) > 0 else -1
            steps[joint] += [(start + tick, sign) for tick in ticks]
    moments = sorted({tick - back for joint in steps for tick, _ in joint for back in (0, 1)} | set(starts.tolist()))
    for tick in moments:
        executed = int(np.searchsorted(starts, tick, side="right")) - 1
        moved = [sum(sign for at, sign in steps[j] if at <= tick) for j in range(joints)]
        yield tick, executed, moved


@pytest.mark.parametrize("seed", [1, 2])
def test_the_place_on_the_path_is_between_the_steps(seed):
    """Also when the ledger is a segment behind the steps, as it is told a moment after they were counted."""
    segments = motion(12, seed=seed)
    ends = np.cumsum([0, *map(duration_ticks, segments)]).tolist()
    path = PathTime(segments, ends, PlanSteps.of(segments))
    widths = []
    for tick, executed, moved in ledgers(segments):
        for behind in (0, 1):
            told = path.span_s(max(0, executed - behind), moved)
            assert told.least <= tick / TICKS_HZ <= told.most
        told = path.span_s(executed, moved)
        widths.append(told.most - told.least)
    assert np.median(widths) < 0.5 * np.median([duration_ticks(s) for s in segments]) / TICKS_HZ
