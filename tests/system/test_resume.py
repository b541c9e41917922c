"""Runs that broke off, and what `planarm resume` says and does: held against the pins of a board that went on."""

import shutil

import numpy as np
import pytest

from broken_runs import SCENE, KilledError, assert_whole_plan, board, moved_usteps, run_until
from planarm.errors import JournalError, LinkError
from planarm.link.account import account_of
from planarm.link.journal import read_journal
from planarm.link.position import Certainty, StreamError
from planarm.link.stream import AT_EASE
from planarm.operations.resume import go_on, load_run, meet_again
from planarm.pipeline import plan_scene
from planarm.scene import load_scene
from planarm.stepping.expand import expand
from planarm.stepping.remainder import certify_remainder, remainder, steps_left
from planarm_sim.cpu.chip import ResetCause
from planarm_wire.messages import EMERGENCY_CODE, State

CASE_1 = SCENE.parents[2] / "examples" / "table1_case1.toml"
MOMENTS_S = (0.12, 0.2, 0.31, 0.45)  # the motion begins about 0.09 s after power-up and lasts 0.43 s


def never(_report):
    raise AssertionError("nobody is to be asked")


@pytest.fixture(scope="module")
def plan():
    return plan_scene(load_scene(SCENE), lambda _stage, _share: None)


@pytest.mark.parametrize("at_s", MOMENTS_S)
def test_a_killed_host_is_gone_on_with_from_the_exact_position(plan, tmp_path, at_s):
    line = board()
    run_until(plan, line, tmp_path, at_s, KilledError())
    line.clock.wait_until(at_s + 1.0)
    run = load_run(tmp_path)
    standing = moved_usteps(plan, line)
    _, report, met = meet_again(run, line)
    assert report.certainty is Certainty.EXACT
    assert report.moved_usteps == standing
    assert met.status.state in (*AT_EASE, State.READY), "it came to rest on the path"
    report, result = go_on(run, line, never)
    assert report.moved_usteps == standing
    assert result is None or result.ledger_after.executed_segments == len(plan.segments.segments)
    assert_whole_plan(plan, line)
    again, result = go_on(load_run(tmp_path), line, never)
    assert (again.certainty, result) == (Certainty.EXACT, None), "nothing is left"


@pytest.mark.parametrize("at_s", MOMENTS_S)
def test_a_pulled_cable_bounds_the_position_until_it_is_back(plan, tmp_path, at_s):
    line = board()
    ended = run_until(plan, line, tmp_path, at_s, LinkError("the cable is out"))
    assert isinstance(ended, StreamError)
    report = ended.position
    assert report.certainty is Certainty.BOUNDED
    line.clock.wait_until(at_s + 1.0)
    for at, (least, most) in zip(moved_usteps(plan, line), report.bounds_usteps, strict=True):
        assert least <= at <= most
    assert any(report.spread_usteps)
    assert load_run(tmp_path).judge(None).bounds_usteps == report.bounds_usteps, "the journal tells the same"
    report, _ = go_on(load_run(tmp_path), line, never)
    assert report.certainty is Certainty.EXACT
    assert_whole_plan(plan, line)


@pytest.mark.parametrize("cause", [ResetCause.EXTERNAL, ResetCause.BROWN_OUT])
def test_a_board_that_restarted_in_motion_is_refused(plan, tmp_path, cause):
    line = board()
    run_until(plan, line, tmp_path, 0.3, KilledError())
    line.uno.reset(cause)
    line.clock.wait_until(1.0)
    before = moved_usteps(plan, line)
    with pytest.raises(StreamError, match=r"cannot go on.*position lost: the board restarted.*home the arm") as told:
        go_on(load_run(tmp_path), line, lambda _report: True)
    assert told.value.position.certainty is Certainty.LOST
    assert moved_usteps(plan, line) == before


def held_run(plan, line, folder):
    """A run that rests on the path, held by its host, when the host is killed."""
    held = []

    def press(told):
        if told.executed_segments >= 0.1 * told.total_segments and not held:
            held.append(told)
            raise KeyboardInterrupt
        if told.state is State.HELD:
            held.append(told)
            if len(held) > 4:
                raise KilledError

    run_until(plan, line, folder, 0.0, None, press)


def test_a_board_that_restarted_at_rest_is_gone_on_with_after_a_yes(plan, tmp_path):
    line = board()
    held_run(plan, line, tmp_path)
    line.uno.reset()
    line.clock.wait_until(line.clock.now_s() + 0.5)
    standing = moved_usteps(plan, line)
    with pytest.raises(StreamError, match=r"needs a yes; position bounded.*\+-32, \+-32"):
        go_on(load_run(tmp_path), line, lambda _report: False)
    assert moved_usteps(plan, line) == standing
    report, result = go_on(load_run(tmp_path), line, lambda _report: True)
    assert report.moved_usteps == standing
    assert result.segments > 0
    assert_whole_plan(plan, line)
    assert result.ledger_after.position_usteps == expand(plan.segments).end_usteps, "it knows where it is"


def test_a_stopped_run_is_gone_on_with_from_a_rest(plan, tmp_path):
    line = board()
    pressed = []

    def press(told):
        if told.executed_segments >= (0.3 + 0.2 * len(pressed)) * told.total_segments and len(pressed) < 2:
            pressed.append(told)
            raise KeyboardInterrupt

    ended = run_until(plan, line, tmp_path, 0.0, None, press)
    assert ended.position.certainty is Certainty.EXACT
    report, result = go_on(load_run(tmp_path), line, never)
    assert report.certainty is Certainty.EXACT
    assert 0 < result.segments < 2 * len(plan.segments.segments)
    assert_whole_plan(plan, line)


def test_a_remainder_that_broke_off_is_gone_on_with_too(plan, tmp_path):
    line = board()
    held_run(plan, line, tmp_path)
    line.uno.reset()
    line.clock.wait_until(line.clock.now_s() + 0.5)
    run = load_run(tmp_path)

    def kill(told):
        if told.executed_segments >= 2:
            raise KilledError

    with pytest.raises(KilledError):
        go_on(run, line, lambda _report: True, kill)
    line.clock.wait_until(line.clock.now_s() + 1.0)
    report, _ = go_on(load_run(tmp_path), line, never)
    assert report.certainty is Certainty.EXACT
    assert_whole_plan(plan, line)


def test_an_emergency_stop_loses_the_position(plan, tmp_path):
    line = board()
    run_until(plan, line, tmp_path, 0.3, KilledError())
    line.write(bytes([EMERGENCY_CODE] * 3))
    line.clock.wait_until(0.6)
    with pytest.raises(StreamError, match="position lost: the board stopped all pulses at once"):
        go_on(load_run(tmp_path), line, lambda _report: True)


def test_a_motion_of_another_program_is_not_taken_for_this_one(plan, tmp_path):
    line = board()
    ended = run_until(plan, line, tmp_path / "first", 0.3, LinkError("out"))
    assert ended is not None
    go_on(load_run(tmp_path / "first"), line, never)
    shutil.copytree(tmp_path / "first", tmp_path / "copy")
    run_until(plan, line, tmp_path / "second", 0.0)
    with pytest.raises(StreamError, match="another program moved the arm off this path"):
        go_on(load_run(tmp_path / "copy"), line, never)


def test_a_journal_cut_short_anywhere_never_tells_less_than_was_sent(plan, tmp_path):
    """Whatever part of the last record reached the disk, the frames before it are all there."""
    line = board()
    run_until(plan, line, tmp_path, 0.3, KilledError())
    path = tmp_path / "run.journal"
    whole, data = read_journal(path), path.read_bytes()
    last = len(whole.records[-1].data) + 17
    for cut in range(1, last, 5):
        path.write_bytes(data[:-cut])
        torn = read_journal(path)
        assert torn.torn
        assert torn.records == whole.records[:-1]
    path.write_bytes(data)
    assert account_of(read_journal(path)).sent_segments == account_of(whole).sent_segments > 20
    path.write_bytes(data[:20])
    with pytest.raises(JournalError, match="first record is not whole"):
        read_journal(path)
    with pytest.raises(JournalError, match="cannot be read"):
        load_run(tmp_path / "nothing")


@pytest.mark.parametrize("share", [0.0, 0.03, 0.2, 0.5, 0.77, 0.99])
def test_a_remainder_makes_the_steps_that_are_left_within_the_motors_limits(plan, share):
    train = expand(plan.segments)
    at = share * train.duration_ticks
    made = [int(np.searchsorted(joint.ticks, at)) for joint in train.steps]
    rest = remainder(plan.segments, made, plan.scene.joints)
    left = steps_left(plan.segments, made)
    for steps, wanted in zip(expand(rest).steps, left.steps, strict=True):
        np.testing.assert_array_equal(steps.directions, wanted.directions)
    certificate = certify_remainder(plan.scene, left, rest)
    assert certificate.ok, certificate.explain()
    assert len(rest.allowances) == len(rest.segments)
    assert rest.duration_ticks < 1.6 * (train.duration_ticks - at) + 1.6e6


def test_wherever_the_arm_stops_the_rest_keeps_the_intervals_at_its_border():
    """Steps coded anew may be late, those that follow early: together they must not be nearer than a motor allows."""
    plan = plan_scene(load_scene(CASE_1), lambda _stage, _share: None)
    train = expand(plan.segments)
    for at in np.linspace(0.0, 0.995, 100) * train.duration_ticks:
        made = [int(np.searchsorted(joint.ticks, at)) for joint in train.steps]
        rest = remainder(plan.segments, made, plan.scene.joints)
        certificate = certify_remainder(plan.scene, steps_left(plan.segments, made), rest)
        assert certificate.ok, certificate.explain()
