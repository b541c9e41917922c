"""Work beside a stream: in a thread for boards, and in an emulator's time as long as it takes."""

import gc
import threading
import time
from types import SimpleNamespace

import pytest

from planarm.errors import NoPathError
from planarm.link.clock import RealClock
from planarm.notice import silent
from planarm.operations import replanning
from planarm.operations.beside import ALLOWED, AsLong, InThread
from planarm.operations.replanning import run_live


def test_a_thread_works_while_its_owner_goes_on():
    may_end, where = threading.Event(), []

    def work():
        where.append(threading.get_ident())
        assert may_end.wait(10.0)
        return 7

    beside = InThread()
    future = beside.begin(work, 0.0)
    assert not beside.has_ended(future, 1e9)  # whatever the clock says
    may_end.set()
    assert future.result(10.0) == 7
    assert beside.has_ended(future, 0.0)
    assert where != [threading.get_ident()]
    beside.close()
    assert beside.allow_s(0.1) == pytest.approx(ALLOWED * 0.1)


def test_what_fails_in_a_thread_is_raised_where_the_result_is_asked_for():
    def work():
        raise NoPathError("none")

    beside = InThread()
    future = beside.begin(work, 0.0)
    with pytest.raises(NoPathError, match="none"):
        future.result(10.0)
    beside.close()


def test_in_an_emulators_time_a_result_is_held_back_as_long_as_it_took():
    host_s = iter([100.0, 100.25, 200.0, 201.0])
    beside = AsLong(lambda: next(host_s))
    future = beside.begin(lambda: "made", 5.0)
    assert [beside.has_ended(future, at_s) for at_s in (5.0, 5.24, 5.25)] == [False, False, True]
    assert future.result() == "made"
    assert beside.allow_s(0.1) == pytest.approx(ALLOWED * 0.1)

    def fails():
        raise NoPathError("none")

    failed = beside.begin(fails, 6.0)
    assert not beside.has_ended(failed, 6.9)
    with pytest.raises(NoPathError):
        failed.result()


def test_a_time_that_is_said_holds_for_all_work():
    beside = AsLong(lambda: 0.0, takes_s=0.08)
    future = beside.begin(lambda: 1, 2.0)
    assert [beside.has_ended(future, at_s) for at_s in (2.07, 2.08)] == [False, True]
    assert beside.allow_s(5.0) == 0.08


def test_a_fault_of_the_program_is_not_kept_for_later():
    with pytest.raises(ZeroDivisionError):
        AsLong(lambda: 0.0).begin(lambda: 1 // 0, 0.0)


def is_searched(one):
    return any(other is one for other in gc.get_objects())


def test_what_was_alive_before_is_not_searched_for_garbage_meanwhile():
    alive = [[]]
    assert is_searched(alive)
    beside = InThread()
    assert not is_searched(alive)
    beside.close()
    assert is_searched(alive)


def test_who_ends_first_does_not_end_it_for_the_other():
    alive = [[]]
    first, second = InThread(), InThread()
    first.close()
    first.close()
    assert not is_searched(alive)
    second.close()
    assert is_searched(alive)


@pytest.fixture
def made(monkeypatch):
    """What live runs made of their own to plan beside them; they fail in their first leg."""

    def fail(_run, _notice):
        raise ConnectionError("the line")

    threads = []
    monkeypatch.setattr(replanning, "planning_margin_cm", lambda scene: scene.margin_cm)
    monkeypatch.setattr(replanning, "_legs", fail)
    monkeypatch.setattr(replanning, "InThread", lambda: threads.append(InThread()) or threads[-1])
    return threads


def run_on_a_board(scene, beside=None):
    board = SimpleNamespace(clock=RealClock())
    run_live(scene, board, None, silent, time.perf_counter, (None, None), beside)


def test_garbage_is_searched_again_however_a_live_run_ends(made):
    alive = [[]]
    with pytest.raises(ConnectionError, match="the line"):
        run_on_a_board(SimpleNamespace(margin_cm=1.0))
    assert len(made) == 1
    assert is_searched(alive)
    with pytest.raises(AttributeError, match="margin_cm"):
        run_on_a_board(SimpleNamespace())
    assert is_searched(alive)


def test_a_live_run_leaves_what_the_caller_brought_as_it_was(made):
    alive, brought = [[]], AsLong(lambda: 0.0)
    brought.close = lambda: pytest.fail("it is the caller's")
    with pytest.raises(ConnectionError):
        run_on_a_board(SimpleNamespace(margin_cm=1.0), brought)
    assert not made
    assert is_searched(alive)
