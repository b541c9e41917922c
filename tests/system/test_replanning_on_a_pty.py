"""Planning beside a stream as every real board gets it: another program behind a pseudo-terminal, the computer's clock,
a thread of its own."""

import signal
import subprocess
import sys
import threading
from contextlib import closing
from time import perf_counter

import numpy as np
import pytest

from live_runs import SCENE, circle, quiet, tip_at
from planarm.link.clock import RealClock
from planarm.link.transport import open_transport
from planarm.operations import replanning
from planarm.operations.arrivals import Listed
from planarm.operations.beside import InThread
from planarm.operations.replanning import first_plan, run_live
from planarm.scene.arrivals import Arrival
from planarm.warm_up import warm_up

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="DTR stays up by a setting that Linux keeps")
LIMIT_S = 60


class Watched(InThread):
    """Tells in which threads it worked, and from when to when."""

    def __init__(self):
        super().__init__()
        self.threads, self.worked_s = [], []

    def begin(self, work, now_s):
        def noted():
            began_s = perf_counter()
            try:
                return work()
            finally:
                self.threads.append(threading.get_ident())
                self.worked_s.append((began_s, perf_counter()))

        return super().begin(noted, now_s)


class Looked(Listed):
    """Obstacles by a list; notes when the stream asked for them, which it does at every pass."""

    def __init__(self, arrivals):
        super().__init__(arrivals)
        self.at_s = []

    def new(self, motion_s):
        self.at_s.append(perf_counter())
        return super().new(motion_s)


@pytest.fixture
def port(tmp_path):
    link = tmp_path / "uno"
    words = ["emulate", "--link", str(link), "--speed", "real"]
    program = [sys.executable, "-c", "from planarm.cli.main import main; main()", *words]
    emulator = subprocess.Popen(program, stdout=subprocess.PIPE, text=True, cwd=tmp_path)
    try:
        assert emulator.stdout.readline().startswith("/dev/")
        yield str(link)
    finally:
        emulator.send_signal(signal.SIGINT)
        emulator.communicate(timeout=LIMIT_S)


def test_a_board_streams_on_while_a_thread_plans(port, monkeypatch):
    """However busy the computer is: the arm gets to the goal, at speed or after a rest, and the stream is served.

    How long it was not is printed; a device whose queue runs low rests on its path and loses nothing.
    """
    made = []
    monkeypatch.setattr(replanning, "InThread", lambda: made.append(Watched()) or made[-1])
    warm_up(on_roadmap=True, replanning=True)
    first = first_plan(SCENE, quiet)
    plan = first[1]
    looked = Looked([Arrival(0.15 * plan.trajectory.duration_s, circle(*tip_at(plan, 0.85), 2.0))])
    with closing(open_transport(port)) as line:
        assert isinstance(line.clock, RealClock)
        result = run_live(SCENE, line, looked, quiet, perf_counter, first)
    assert result.reached, result.reason
    assert result.end_rad == pytest.approx(np.array(SCENE.task.goal_rad), abs=1e-3)
    assert [one.verdict for one in result.encounters] == ["avoided"]
    assert result.new_plans
    (beside,) = made
    assert beside.threads
    assert threading.get_ident() not in beside.threads
    at_s = np.array(looked.at_s)
    for began_s, ended_s in beside.worked_s:
        during = at_s[(at_s >= began_s - 0.1) & (at_s <= ended_s + 0.1)]
        longest_ms = 1e3 * np.diff(during).max()
        print(f"planned {1e3 * (ended_s - began_s):.1f} ms, longest without the stream {longest_ms:.1f} ms")
        assert ((at_s > began_s) & (at_s < ended_s)).any(), "the stream was served meanwhile"
    print([(new.spliced_at_s, new.notice_to_certified_ms) for new in result.new_plans])
