"""Streams that break off, or are broken off: what is told of where the arm is, and why."""

from dataclasses import replace

import pytest

from link_model import ModelLine, after, frames_written, motion
from planarm.errors import CertificateError, DeviceFault, LinkError, StepsDifferError
from planarm.link.exchange import open_session, request, stream_plan
from planarm.link.plan_steps import planned_usteps
from planarm.link.position import Certainty, StreamError, StreamFault
from planarm.link.stream import StreamOptions
from planarm.link.stream_values import plain_config
from planarm_wire.codec import decode
from planarm_wire.messages import (
    BOARDS,
    Fault,
    MessageType,
    Query,
    Result,
    Start,
    State,
)
from planarm_wire.rates import Allowance, head_of


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
    config = replace(plain_config(BOARDS["uno"]), start_stop_ticks=(40_000, 50_000))
    stream_plan(line, plan, options=StreamOptions(allowances=allowances, config=config))
    assert line.device.configs == [config]
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
    assert most - fewest <= 50  # what the queue holds: 848 bytes, of which each takes 17 or more


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
