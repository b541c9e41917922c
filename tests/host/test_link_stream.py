"""Streaming against a model of the device, on good lines and bad ones, in virtual time."""

import re
from dataclasses import replace
from itertools import accumulate

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from link_model import USB_FLUSH_S, Damage, ModelLine, motion
from planarm.errors import CertificateError, DeviceFault, LinkError, StepsDifferError
from planarm.link.clock_sync import Span
from planarm.link.exchange import open_session, request, stream_plan
from planarm.link.margin import SeenLine, line_margin
from planarm.link.plan_steps import planned_usteps
from planarm.link.position import Certainty, StreamError, StreamFault
from planarm.link.remaining import Remaining, words_of
from planarm.link.session import SessionLimits
from planarm.link.stream import StreamOptions, StreamProgress
from planarm_wire.codec import decode, encoded_bytes
from planarm_wire.framing import Frame, FrameDecoder, encode_frame
from planarm_wire.messages import (
    BOARDS,
    HOST_WINDOW_BYTES,
    QUEUE_BYTES,
    QUEUE_FRAME_BYTES,
    TICKS_HZ,
    Enable,
    Fault,
    MessageType,
    Query,
    Result,
    Segments,
    Start,
    State,
)
from planarm_wire.rates import Allowance, head_of
from planarm_wire.steps import duration_ticks

HARMLESS = Damage()
REAL_USB = Damage(delay_s=0.001, flush_s=USB_FLUSH_S)


def frames_written(line: ModelLine) -> list[Frame]:
    return [frame for frame in FrameDecoder().feed(bytes(line.written)) if isinstance(frame, Frame)]


def after(line: ModelLine, t_s: float, action) -> None:
    line.events.at(t_s, action)


# -- a good line ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("to_host", [HARMLESS, REAL_USB], ids=["direct", "through the USB bridge"])
@pytest.mark.parametrize("count", [1, 31, 32, 33, 300])
def test_a_plan_is_executed_once_in_order_and_checked(count, to_host):
    line, plan = ModelLine(to_host=to_host), motion(count)
    result = stream_plan(line, plan)
    assert tuple(line.device.segments_executed) == plan
    assert result.segments == count
    assert result.ledger_after.executed_segments - result.ledger_before.executed_segments == count
    assert tuple(line.device.position) == planned_usteps(plan) == result.ledger_after.position_usteps
    assert line.device.state is State.READY  # enabled: a loaded arm must not fall
    assert result.crc_errors == result.bytes_lost == result.damaged_replies == 0
    assert result.path_clock_percent >= (100 if to_host is HARMLESS else 75)
    assert result.motion_s == pytest.approx(count * 0.2 / result.path_clock_percent, abs=0.02)


def test_two_plans_follow_one_another_without_letting_go_of_the_arm():
    line, first, second = ModelLine(), motion(40), motion(50, seed=2)
    stream_plan(line, first)
    began = len(line.written)
    result = stream_plan(line, second)
    assert tuple(line.device.segments_executed) == first + second
    assert result.ledger_before.executed_segments == 40
    sent = {frame.type_code for frame in FrameDecoder().feed(bytes(line.written[began:]))}
    assert not sent & {MessageType.CLEAR, MessageType.ENABLE}


def test_the_drivers_are_released_when_asked():
    line = ModelLine()
    stream_plan(line, motion(3), options=StreamOptions(release_when_done=True))
    assert line.device.state is State.IDLE


def test_the_queue_is_full_before_the_start_and_stays_nearly_full():
    line, plan = ModelLine(to_host=REAL_USB), motion(200, ticks=48_000)
    result = stream_plan(line, plan)
    kinds = [frame.type_code for frame in frames_written(line)]
    before_start = [f for f in frames_written(line)[: kinds.index(MessageType.START)] if f.type_code == Segments.TYPE]
    assert sum(len(f.payload) + QUEUE_FRAME_BYTES for f in before_start) > 0.9 * QUEUE_BYTES
    assert result.least_queued >= 24


def test_two_messages_fit_the_window_and_are_as_full_as_that_allows():
    line, plan = ModelLine(), motion(300)
    stream_plan(line, plan)
    messages = [f for f in frames_written(line) if f.type_code == MessageType.SEGMENTS]
    lengths = [len(encode_frame(f.seq, f.type_code, f.payload)) for f in messages]
    assert max(lengths) <= HOST_WINDOW_BYTES // 2
    assert len(messages) < 0.6 * len(plan)


def test_progress_counts_up_to_the_end():
    seen = []
    plan = motion(120)
    stream_plan(ModelLine(), plan, seen.append)
    assert [p.executed_segments for p in seen] == sorted(p.executed_segments for p in seen)
    for progress in seen:
        done = plan[: progress.executed_segments]
        assert progress.path_s == pytest.approx(sum(duration_ticks(segment) for segment in done) / TICKS_HZ)
    assert seen[-1].executed_segments == seen[-1].total_segments == 120
    assert seen[-1].path_s == seen[-1].total_s == pytest.approx(0.24)
    assert seen[-1].moved_usteps == planned_usteps(plan)
    assert max(p.queued_segments for p in seen) > 30


def test_a_long_segment_keeps_progress_alive_without_filling_the_line():
    seen, line = [], ModelLine()
    result = stream_plan(line, motion(3, ticks=16_000_000), seen.append)
    assert result.duration_s == pytest.approx(3.0, abs=0.1)
    assert 50 <= len(seen) <= 80  # 20 a second


# -- what an earlier session left behind ------------------------------------------------------------------------------


def test_segments_left_by_an_earlier_session_are_dropped_first():
    line, plan = ModelLine(), motion(20)
    session = open_session(line)
    request(line, session, Enable(1))
    request(line, session, Segments(0, 0, 0, motion(2, seed=9)[:1]))
    stream_plan(line, plan)
    assert tuple(line.device.segments_executed) == plan


def test_an_earlier_fault_is_cleared_and_told():
    line, plan = ModelLine(), motion(20)
    line.device.latch(Fault.UNDERRUN)
    assert stream_plan(line, plan).cleared_fault is Fault.UNDERRUN
    assert tuple(line.device.segments_executed) == plan


def test_a_motion_under_way_is_not_disturbed():
    line, first = ModelLine(), motion(20, ticks=160_000)
    session = open_session(line)
    request(line, session, Enable(1))
    for segment in first:
        request(line, session, Segments(0, 0, 0, (segment,)))
    request(line, session, Start(16_000))
    with pytest.raises(LinkError, match="executing the motion of an earlier session; wait"):
        stream_plan(line, motion(3))
    line.wait_until(1.0)
    assert tuple(line.device.segments_executed) == first


# -- bad lines --------------------------------------------------------------------------------------------------------

PATIENT = SessionLimits(hello_s=30.0, silence_s=30.0)
probabilities = st.sampled_from([0.0, 0.0005, 0.002])
damages = st.builds(
    Damage,
    drop=probabilities,
    flip=probabilities,
    duplicate=probabilities,
    delay_s=st.sampled_from([0.0, 0.002, 0.016]),
    flush_s=st.sampled_from([0.0, USB_FLUSH_S]),
)


@given(damages, damages, st.integers(0, 2**32 - 1), st.integers(1, 80))
@settings(max_examples=40, deadline=None)
def test_whatever_the_line_does_no_segment_is_lost_doubled_or_swapped(to_device, to_host, seed, count):
    """A third of the frames may be lost either way; 3.2 s of buffered motion outlast that."""
    line, plan = ModelLine(to_device, to_host, seed), motion(count, ticks=1_600_000, seed=seed)
    result = stream_plan(line, plan, limits=PATIENT)
    assert tuple(line.device.segments_executed) == plan
    assert tuple(line.device.position) == planned_usteps(plan) == result.ledger_after.position_usteps


@given(damages, damages, st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_a_plan_that_underruns_on_a_bad_line_executed_a_whole_beginning_of_it(to_device, to_host, seed):
    line, plan = ModelLine(to_device, to_host, seed), motion(200, ticks=20_000, seed=seed)
    try:
        stream_plan(line, plan)
    except (LinkError, DeviceFault):
        assert line.device.state is State.FAULT or not line.device.segments_executed
    executed = tuple(line.device.segments_executed)
    assert list(executed) == list(plan[: len(executed)])


def test_damage_is_counted():
    line = ModelLine(Damage(drop=0.002), Damage(flip=0.002), seed=3)
    result = stream_plan(line, motion(100, ticks=320_000))
    assert result.crc_errors == line.device.crc_errors > 0
    assert result.retransmissions > 0
    assert result.damaged_replies > 0


def test_numbers_wrap_in_a_long_plan():
    line, plan = ModelLine(), motion(1500, ticks=24_000)
    result = stream_plan(line, plan)
    assert result.frames_sent > 2 * 256
    assert result.retransmissions == 0
    assert tuple(line.device.segments_executed) == plan


def test_a_slow_device_never_overflows_its_ring():
    """The window is smaller than the ring, so a main loop at a quarter of the line's speed loses nothing."""
    line = ModelLine()
    line.device.main_byte_s = 160e-6
    result = stream_plan(line, motion(100, ticks=320_000))
    assert result.bytes_lost == 0
    assert 56 < line.device.deepest_ring <= 112 + 1


def test_a_device_without_room_is_asked_again_until_it_has():
    """Busy leaves the expected number where it is, so the frame comes again and is carried out once."""
    line, crowd = ModelLine(), motion(80, ticks=1_600_000)
    room = [encoded_bytes(Segments(0, 0, 0, (segment,))) + QUEUE_FRAME_BYTES for segment in crowd]
    fitting = sum(total <= QUEUE_BYTES for total in accumulate(room))
    crowd = crowd[: fitting + 1]
    session = open_session(line)
    request(line, session, Enable(1))
    for segment in crowd[:-1]:
        request(line, session, Segments(0, 0, 0, (segment,)))
    request(line, session, Start(16_000))
    request(line, session, Segments(0, 0, 0, (crowd[-1],)))
    assert line.now_s() > 0.1  # the first segment had to end
    assert session.arq_counters.busy_replies > 0
    line.wait_until(10.0)
    assert tuple(line.device.segments_executed) == crowd


# -- breaks -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("deaf_s", [0.0, 1.5], ids=["at once", "after a bootloader"])
@pytest.mark.parametrize("moment_s", [0.012, 0.03, 0.3])
def test_a_restart_in_a_motion_loses_the_position(moment_s, deaf_s):
    line, plan = ModelLine(), motion(300)
    after(line, moment_s, lambda: line.device.reset(deaf_s))
    with pytest.raises(StreamError, match=r"position lost: the board restarted.*home the arm") as caught:
        stream_plan(line, plan)
    assert caught.value.position.certainty is Certainty.LOST
    assert caught.value.exit_code == 5
    assert line.device.state is State.IDLE
    executed = tuple(line.device.segments_executed)
    assert list(executed) == list(plan[: len(executed)])  # nothing after the restart


def test_a_restarted_device_that_somebody_enabled_again_is_still_another_boot():
    def restart_and_enable() -> None:
        line.device.reset()
        line.device.state = State.READY

    line = ModelLine()
    after(line, 0.2, restart_and_enable)
    with pytest.raises(StreamError, match=r"the device restarted: its count .*position lost") as caught:
        stream_plan(line, motion(300))
    assert caught.value.position.certainty is Certainty.LOST


def test_the_keyboard_holds_first_and_stops_second():
    line, plan = ModelLine(), motion(300)
    pressed, held = [], []

    def press(told):
        if told.executed_segments >= 40 and not pressed:
            pressed.append(line.now_s())
            raise KeyboardInterrupt
        if told.state is State.HELD:
            held.append(line.now_s())
            if len(held) == 20:
                raise KeyboardInterrupt

    with pytest.raises(StreamError, match=r"stopped as asked.*position exact") as stopped:
        stream_plan(line, plan, press)
    executed = line.device.segments_executed
    assert 40 <= len(executed) < len(plan)
    assert list(executed) == list(plan[: len(executed)])
    assert line.device.holds == 1
    assert held[-1] - held[0] > 0.05, "held, it waits"
    assert stopped.value.position.executed_segments == (len(executed), len(executed))
    assert stopped.value.position.moved_usteps == tuple(line.device.position)


def test_a_hold_that_nobody_asked_for_is_taken_back():
    line, plan = ModelLine(), motion(300)
    after(line, 0.2, line.device.hold)
    result = stream_plan(line, plan)
    assert line.device.holds == 1
    assert tuple(line.device.segments_executed) == plan
    assert result.segments == 300


def test_messages_carry_the_least_allowances_of_their_segments():
    line, plan = ModelLine(), motion(60)
    allowances = tuple(Allowance(2.0 + k % 7, 1.0 + k % 5, 32_768.0 * (k % 9)) for k in range(60))
    stream_plan(line, plan, options=StreamOptions(allowances=allowances, start_stop_ticks=(40_000, 50_000)))
    assert [config.start_stop_ticks for config in line.device.configs] == [(40_000, 50_000)]
    sent = [decode(f.type_code, f.payload) for f in frames_written(line) if f.type_code == MessageType.SEGMENTS]
    at = 0
    for message in sent:
        part = allowances[at : at + len(message.segments)]
        assert (message.slow, message.fast, message.need) == head_of(part)
        at += len(message.segments)
    assert at == 60


def test_the_keyboard_before_the_motion_is_just_that():
    line = ModelLine()
    line.write = raise_keyboard_interrupt
    with pytest.raises(KeyboardInterrupt):
        stream_plan(line, motion(3))


def raise_keyboard_interrupt(_data):
    raise KeyboardInterrupt


def test_a_cut_line_bounds_the_position():
    line, plan = ModelLine(), motion(300)
    after(line, 0.2, lambda: setattr(line, "cut", True))
    with pytest.raises(StreamError, match=r"no reply for 1\.0\d s; check the cable.*position bounded") as caught:
        stream_plan(line, plan)
    fewest, most = caught.value.position.executed_segments
    assert fewest <= len(line.device.segments_executed) <= most
    assert most - fewest <= 45


def test_a_line_that_comes_back_after_an_underrun_gives_the_exact_position():
    line, plan = ModelLine(), motion(300)
    after(line, 0.2, lambda: setattr(line, "cut", True))
    after(line, 2.0, lambda: setattr(line, "cut", False))
    with pytest.raises(StreamError, match="position exact") as caught:
        stream_plan(line, plan)
    executed = line.device.segments_executed
    assert caught.value.position.executed_segments == (len(executed), len(executed))
    assert caught.value.position.moved_usteps == planned_usteps(executed)


def test_a_device_that_hears_but_cannot_be_heard_is_silent():
    line = ModelLine()
    after(line, 0.2, lambda: setattr(line.to_host, "drop", 1.0))
    with pytest.raises(StreamError, match="no reply for") as caught:
        stream_plan(line, motion(300))
    assert caught.value.position.certainty is Certainty.BOUNDED


def test_a_port_with_nobody_there():
    line = ModelLine()
    line.cut = True
    with pytest.raises(LinkError, match="no answer to HELLO within 5 s"):
        stream_plan(line, motion(3))
    assert line.now_s() == pytest.approx(5.0)


def test_a_bootloader_that_swallows_the_first_hello_is_waited_for():
    line, plan = ModelLine(), motion(10)
    line.device.reset(deaf_s=1.45)
    result = stream_plan(line, plan)
    assert tuple(line.device.segments_executed) == plan
    assert result.duration_s < 2.5


@pytest.mark.parametrize("fault", [Fault.MISSED_DEADLINE, Fault.BAD_SEGMENT])
def test_a_fault_in_a_motion_is_told_with_the_exact_position(fault):
    line, plan = ModelLine(), motion(300)
    after(line, 0.2, lambda: line.device.latch(fault))
    with pytest.raises(StreamFault, match=r"the device stopped: .*position exact") as caught:
        stream_plan(line, plan)
    executed = line.device.segments_executed
    assert caught.value.exit_code == 6
    assert caught.value.position.executed_segments == (len(executed), len(executed))
    assert caught.value.position.moved_usteps == tuple(line.device.position)


def test_a_line_that_cannot_carry_the_plan_carries_it_slowly():
    """800 ticks is 20,000 segments a second; 25,000 bytes a second do not carry them."""
    line, plan = ModelLine(), motion(300, ticks=1600)
    result = stream_plan(line, plan)
    assert tuple(line.device.segments_executed) == plan
    assert result.path_clock_percent < 20


def test_a_line_that_gets_too_slow_in_a_motion_ends_in_an_underrun_with_the_exact_position():
    line, plan = ModelLine(), motion(300, ticks=20_000)
    after(line, 0.15, lambda: setattr(line.to_device, "delay_s", 0.1))
    with pytest.raises(StreamFault, match=r"ran empty.*raise the baud rate.*position exact"):
        stream_plan(line, plan)
    executed = tuple(line.device.segments_executed)
    assert list(executed) == list(plan[: len(executed)])


def test_another_version_or_specification_is_refused_before_anything_is_sent():
    for changed in ({"protocol_version": 1}, {"spec_hash": 1}):
        line = ModelLine()
        for name, value in changed.items():
            setattr(line.device, name, value)
        with pytest.raises(LinkError, match="flash the released image"):
            stream_plan(line, motion(3))
        assert {frame.type_code for frame in frames_written(line)} == {MessageType.HELLO}


def test_a_refusal_is_a_device_fault():
    line = ModelLine()
    session = open_session(line)
    with pytest.raises(DeviceFault, match=r"refused START \(frame 1, state idle\): the command does not fit the state"):
        request(line, session, Start(16_000))


def test_a_refusal_that_leads_to_a_fault_is_told_as_the_fault():
    line, plan = ModelLine(), motion(300)
    after(line, 0.2, lambda: setattr(line.device, "_append", lambda _segments: Result.WRONG_STATE))
    with pytest.raises(StreamFault, match=r"the device stopped: the segment queue ran empty.*position exact") as caught:
        stream_plan(line, plan)
    assert "refused SEGMENTS" in str(caught.value.__cause__)
    assert caught.value.position.moved_usteps == planned_usteps(line.device.segments_executed)


def test_a_ledger_that_does_not_show_the_plan_is_told():
    line, plan = ModelLine(), motion(30)
    after(line, 0.05, lambda: line.device.position.__setitem__(1, line.device.position[1] + 3))
    with pytest.raises(StepsDifferError, match=r"joint 2 moved by .* the plan has .* \(\+3\); home the arm"):
        stream_plan(line, plan)


def test_a_device_that_stops_early_without_a_fault_is_told():
    line = ModelLine()
    after(line, 0.1, lambda: setattr(line.device, "state", State.READY))
    with pytest.raises(StreamError, match=r"ended its motion after \d+ of 300 segments without a fault"):
        stream_plan(line, motion(300))


def test_a_device_that_never_executes_is_told():
    line = ModelLine()
    after(line, 0.1, lambda: setattr(line.device, "_end_segment", lambda _end_s: None))
    with pytest.raises(StreamError, match=r"executes nothing: segment \d+ of 300 has not ended"):
        stream_plan(line, motion(300))


@pytest.mark.parametrize("marks", [[], [0, 2], [1]])
def test_only_a_whole_motion_is_streamed(marks):
    plan = [replace(s, duration_flags=s.duration_flags & ~1 | (i in marks)) for i, s in enumerate(motion(3))]
    line = ModelLine()
    with pytest.raises(CertificateError, match="only the very last one"):
        stream_plan(line, plan)
    assert line.written == b""


def test_asking_is_not_moving():
    line = ModelLine()
    session = open_session(line)
    assert request(line, session, Query()).state is State.IDLE
    assert line.device.segments_executed == []


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
            rates.append(stream.path_clock_percent)
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
