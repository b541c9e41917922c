"""Streaming against a model of the device, on good lines and bad ones, in virtual time."""

from itertools import accumulate

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from link_model import USB_FLUSH_S, Damage, ModelLine, frames_written, motion
from planarm.errors import DeviceFault, LinkError
from planarm.link.exchange import open_session, request, stream_plan
from planarm.link.plan_steps import planned_usteps
from planarm.link.session import SessionLimits
from planarm.link.stream import StreamOptions
from planarm_wire.codec import encoded_bytes
from planarm_wire.framing import FrameDecoder, encode_frame
from planarm_wire.messages import (
    HOST_WINDOW_BYTES,
    QUEUE_BYTES,
    QUEUE_FRAME_BYTES,
    TICKS_HZ,
    Enable,
    Fault,
    MessageType,
    Segments,
    Start,
    State,
)
from planarm_wire.steps import duration_ticks

HARMLESS = Damage()
REAL_USB = Damage(delay_s=0.001, flush_s=USB_FLUSH_S)


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
