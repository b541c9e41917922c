"""A line too slow for its plan, the hand on a running stream, and the time that remains."""

import re
from dataclasses import replace

import pytest

from link_model import Damage, ModelLine, frames_written, motion
from planarm.link.clock_sync import Span
from planarm.link.exchange import stream_plan
from planarm.link.margin import SeenLine, line_margin
from planarm.link.remaining import Remaining, words_of
from planarm.link.stream import StreamProgress
from planarm_wire.messages import (
    BOARDS,
    MessageType,
    State,
)
from planarm_wire.rates import Allowance

# -- a line that is too slow ------------------------------------------------------------------------------------------


def test_a_line_too_slow_for_the_plan_slows_the_motion_and_says_so_before_it_starts():
    """40 ms there and back let 112 bytes pass: 2,800 a second, which is less than this plan asks for."""
    line, plan, said = ModelLine(Damage(delay_s=0.02), Damage(delay_s=0.02)), motion(300, ticks=64_000), []

    def warn(text):
        assert MessageType.START not in [frame.type_code for frame in frames_written(line)]
        said.append(text)

    result = stream_plan(line, plan, warn=warn)
    assert re.fullmatch(
        r"the line was seen to carry \d+ bytes/s and to answer after \d+\.\d ms, the plan asks for \d+ bytes/s and some"
        r" to spare: the motion runs at \d+ % of its speed and takes \d+\.\d s instead of 1\.2 s",
        said[0],
    )
    assert len(said) == 1
    assert 5 < result.path_clock_percent < 60
    assert line.device.override_percent == result.path_clock_percent
    assert tuple(line.device.segments_executed) == plan


def test_a_good_line_changes_nothing_and_takes_an_earlier_override_back():
    line, said = ModelLine(), []
    line.device.override_percent = 30
    result = stream_plan(line, motion(300, ticks=64_000), warn=said.append)
    assert (said, result.path_clock_percent, line.device.override_percent) == ([], 100, 100)


@pytest.mark.parametrize(("first", "then"), [(320_000, 64_000), (64_000, 320_000)])
@pytest.mark.parametrize("asked", [100, 10])
def test_a_motion_that_goes_on_otherwise_is_held_against_the_line_again(first, then, asked):
    """The same line of 2,800 bytes a second, to which a calm motion and a dense one follow one another."""
    line, said, rates = ModelLine(Damage(delay_s=0.02), Damage(delay_s=0.02)), [], []
    plan = motion(200, ticks=first)
    new = []

    def steer(stream):
        if stream.executed_segments > 10 and not new:
            rates.append(stream.pace.percent)
            if asked < 100:
                stream.override(asked)
            new.extend((*plan[: stream.sent_segments], *motion(200, ticks=then, seed=2)))
            allowances = (Allowance(1e-6, 1e-6, 0.0),) * len(new)
            stream.go_on_with(new, allowances)

    result = stream_plan(line, plan, steer=steer, warn=said.append)
    assert line.device.segments_executed == new
    calm, dense = (rates[0], result.path_clock_percent)[:: 1 if first > then else -1]
    assert calm == 100
    assert 5 < dense < 60
    assert [text.startswith("from here on the line was seen") for text in said] == [first > then]
    assert line.device.override_percent == min(asked, result.path_clock_percent)


@pytest.mark.parametrize("from_segment", [-1, 10], ids=["at START", "in motion"])
@pytest.mark.parametrize("asked", [100, 60, 3])
def test_an_override_never_asks_for_more_than_a_slow_line_carries(from_segment, asked):
    """The same line; what the owner asks for counts where it is slower."""
    line, plan, told = ModelLine(Damage(delay_s=0.02), Damage(delay_s=0.02)), motion(300, ticks=64_000), []

    def steer(stream):
        if stream.executed_segments > from_segment and not told:
            stream.override(asked)
            told.append(stream.executed_segments)

    result = stream_plan(line, plan, steer=steer)
    assert from_segment < told[0] < 150
    assert 5 < result.path_clock_percent < 60
    orders = [frame for frame in frames_written(line) if frame.type_code == MessageType.OVERRIDE]
    assert max(frame.payload[0] for frame in orders) <= result.path_clock_percent
    assert line.device.override_percent == min(asked, result.path_clock_percent)


def margin_of(segments, sent, seen, allowances=()):
    return line_margin(segments, sent, seen, BOARDS["uno"], allowances)


def test_what_a_plan_asks_of_the_line_is_what_has_to_arrive_in_time():
    plan, seen = motion(300, ticks=64_000), SeenLine.of(1000, 0.1, 0.002)
    result = stream_plan(ModelLine(), plan)
    whole = margin_of(plan, 40, seen)
    assert whole.seen.bytes_s == pytest.approx(10_000.0)
    assert whole.asked_bytes_s < result.bytes_sent / result.motion_s, "what the queue holds need not be sent in time"
    busy = margin_of((*motion(100, ticks=320_000)[:-1], *motion(300, ticks=20_000)), 40, seen)
    assert busy.asked_bytes_s > margin_of(motion(400, ticks=320_000), 40, seen).asked_bytes_s
    assert margin_of(plan, 300, seen).percent == 100, "all of it is in the queue"
    assert margin_of(plan, 40, SeenLine.of(299, 10.0, 0.002)).percent == 100, "too little was seen"
    assert margin_of(plan, 40, SeenLine.of(1000, 100.0, 0.002)).percent == 1
    rates = [margin_of(plan, 40, SeenLine.of(1000, 1000.0 / r, 0.002)).percent for r in range(500, 10_000, 500)]
    assert rates == sorted(rates)
    assert 1 < rates[1] < rates[4] < 100
    # What comes late asks for a slower motion, and so does a stop that takes more of the path that is held.
    assert margin_of(plan, 40, SeenLine.of(1000, 0.1, 0.15)).percent < margin_of(plan, 40, seen).percent
    long_stops = (Allowance(1e-6, 1e-6, 800_000.0),) * 300
    slow = SeenLine.of(1000, 0.4, 0.002)
    assert margin_of(plan, 40, slow, long_stops).percent < margin_of(plan, 40, slow).percent


# -- the hand on a running stream -------------------------------------------------------------------------------------


def test_a_running_stream_is_steered():
    line, plan, done = ModelLine(), motion(300), []

    def steer(stream):
        if stream.executed_segments > 50 and not done:
            stream.hold()
            done.append(line.now_s())
        if len(done) == 1 and line.now_s() > done[0] + 0.3:
            stream.resume()
            done.append(line.now_s())

    result = stream_plan(line, plan, steer=steer)
    assert tuple(line.device.segments_executed) == plan
    assert line.device.holds == 1
    assert result.motion_s > 0.3 + 300 * 0.002


# -- the remaining time -----------------------------------------------------------------------------------------------


def test_the_remaining_time_is_the_walls_and_honest():
    line, told = ModelLine(), []
    remaining = Remaining(lambda: 3.0 * line.now_s())  # a line whose clock runs three times as slow as the wall's
    stream_plan(line, motion(1000), lambda progress: told.append((line.now_s(), remaining.after(progress))))
    end_s = told[-1][0]
    late = [(at_s, left_s) for at_s, left_s in told if at_s > 0.5]
    for at_s, left_s in late:
        assert left_s == pytest.approx(3.0 * (end_s - at_s), abs=0.2)
    then = Span(1.0, 1.0)
    progress = StreamProgress(1.0, 2.0, 5, 10, 5, 0.25, (0, 0), State.HELD, 1.0, 800, 0, 0, then, then)
    assert remaining.after(progress) is None
    assert words_of(progress, None) == "1.00 of 2.00 s, 0.25 s queued, the arm stands (held)"
    slow = replace(progress, state=State.RUNNING, rate_percent=50)
    assert remaining.after(slow) > 1.9
    assert words_of(slow, 2.0) == "1.00 of 2.00 s, 0.25 s queued, at 50 %, about 2.0 s left"
    assert words_of(slow, 2.0, short=True) == "0.2 s queued, at 50 %, 2 s left"
    assert words_of(progress, None, short=True) == "0.2 s queued, held"
