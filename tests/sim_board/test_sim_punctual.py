"""What a board behind a terminal asks of the system, and that it leaves everything as it was."""

import ctypes
import gc
import platform
import sys
from pathlib import Path

import pytest

from planarm_sim.bridge import punctual as of
from planarm_sim.bridge.punctual import punctual

PR_GET_TIMERSLACK = 30


def slack_ns() -> int:
    return int(ctypes.CDLL(None).prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0))


@pytest.mark.skipif(sys.platform != "linux", reason="timer slack is Linux' own")
def test_sleeps_end_in_time_meanwhile():
    before = slack_ns()
    assert before > 1
    with punctual():
        assert slack_ns() == 1
    assert slack_ns() == before


@pytest.mark.skipif(platform.machine() not in of._NUMBERS or sys.platform != "linux", reason="the calls' numbers")
def test_short_slices_are_asked_for_and_given_back():
    usual = of._set_slice(0)
    assert usual is not None
    with punctual():
        assert of._set_slice(of.SLICE_NS) == of.SLICE_NS
    assert of._set_slice(0) == usual


def test_what_the_collector_need_not_look_at_is_frozen_meanwhile():
    before = gc.get_freeze_count()
    with punctual():
        assert gc.get_freeze_count() > before + 1000
    assert gc.get_freeze_count() == 0


def test_a_system_that_knows_none_of_it_is_no_error(monkeypatch):
    monkeypatch.setattr("sys.platform", "darwin")
    assert of._set_slack(1) is None
    assert of._set_slice(1) is None
    with punctual():
        pass


def test_where_the_kernel_tells_it_the_slice_is_the_threads(monkeypatch):
    """/proc/PID/sched shows `se.slice` on kernels built for debugging; elsewhere there is nothing to compare."""
    sched = Path("/proc/self/sched")
    if not sched.exists():
        pytest.skip("this kernel does not show how it schedules")
    with punctual():
        told = [line for line in sched.read_text().splitlines() if line.startswith("se.slice")]
    if not told:
        pytest.skip("this kernel does not show the slice")
    assert float(told[0].split()[-1]) in (of.SLICE_NS, of.SLICE_NS / 1e6)
