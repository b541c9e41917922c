"""The same campaign on a Dask cluster of two workers, one of which is killed on the way: the same rows, none twice."""

import os
import signal
import sys
import threading
import time
import warnings
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pyarrow.parquet as pq
import pytest

from planarm.campaign.dask_engine import DaskEngine
from planarm.campaign.engine import LocalEngine
from planarm.campaign.run import run_campaign
from planarm.campaign.spec import load_campaign
from planarm.errors import ClusterError, UsageError

distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
dask = pytest.importorskip("dask", reason="dask.distributed is not installed")
SCENE = Path(__file__).resolve().parents[2] / "examples" / "table1_case1.toml"

pytestmark = [
    pytest.mark.filterwarnings("default"),
    pytest.mark.skipif(sys.platform == "win32", reason="workers are killed by a POSIX signal"),
]


def campaign_of(tmp_path, deeds, count, batch):
    path = tmp_path / "campaign.toml"
    path.write_text(
        f'kind = "self-test"\nscenes = ["{SCENE}"]\nbatch = {batch}\n[limits]\ntask_s = 20\n'
        f"[vary]\ndo = {deeds}\nseed = {{ count = {count} }}\n"
    )
    return load_campaign(path)


def rows_of(table):
    rows = sorted(pq.read_table(table).to_pylist(), key=lambda row: row["number"])
    return [{k: v for k, v in row.items() if not k.startswith("took")} for row in rows]


SLOW_MACHINE = {
    "distributed.scheduler.allowed-failures": 1,  # a batch is given up after two deaths, not four: a second each
    "distributed.deploy.lost-worker-timeout": "60s",  # a worker's restart may take that long beside other work
}


@contextmanager
def cluster_of(workers):
    """A cluster on this machine."""
    with dask.config.set(SLOW_MACHINE):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            cluster = distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=None, processes=True
            )
        with cluster:
            yield cluster


def nothing(_progress):
    """Show no progress."""


def test_a_killed_worker_loses_and_doubles_nothing(tmp_path, sized):
    """Small: runs that only answer; full: the 10,000 boards of examples/sweeps/line_faults.toml."""
    small = campaign_of(tmp_path, '["answer"]', 300, 3)
    campaign = sized(small, None) or load_campaign(SCENE.parent / "sweeps" / "line_faults.toml")
    with cluster_of(2) as cluster, DaskEngine(cluster.scheduler_address, 60.0) as engine:
        killed = []

        def kill_once(progress):
            if progress.finished >= campaign.size // 10 and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        there = run_campaign(campaign, engine, tmp_path / "dask", False, kill_once)
        assert killed and there.whole
        poisoned = campaign_of(tmp_path, '["answer", "crash"]', 1, 2)
        poison = run_campaign(poisoned, engine, tmp_path / "poison", False, nothing)
    here = run_campaign(campaign, LocalEngine(sized(1, os.cpu_count() or 1)), tmp_path / "local", False, nothing)
    assert rows_of(there.table) == rows_of(here.table)
    assert [row["verdict"] for row in rows_of(poison.table)] == ["ok", "failed"]


def test_a_cluster_whose_workers_are_gone_ends_the_campaign_in_time_and_can_be_resumed(tmp_path):
    campaign = campaign_of(tmp_path, '["answer"]', 60, 2)
    with cluster_of(2) as cluster, DaskEngine(cluster.scheduler_address, 2.0) as engine:

        def lose_all(progress):
            if progress.finished >= 10 and not lost_s:
                for nanny in cluster.workers.values():
                    nanny.close_gracefully()  # it starts no other worker, as if it were gone itself
                    os.kill(nanny.pid, signal.SIGKILL)
                lost_s.append(time.monotonic())

        lost_s = []
        with pytest.raises(ClusterError, match=r"tcp://.* no worker for 2 s \(limits.cluster_s\).* --resume") as told:
            run_campaign(campaign, engine, tmp_path / "out", False, lose_all)
        assert told.value.told()["code"] == "E208"
        left = rows_of(tmp_path / "out" / "rows.parquet")
        assert 10 <= len(left) < 60 and {row["verdict"] for row in left} == {"ok"}, "joined, as after Ctrl-C"
        # Workers are counted once a second; what a closed connection takes to be noticed is Dask's. Alone: 3.0 s.
        assert 2.0 <= time.monotonic() - lost_s[0] < 60.0
        closing = threading.Timer(0.5, cluster.close)
        closing.start()
        with pytest.raises(ClusterError, match=r"scheduler .*--resume"):
            run_campaign(campaign, engine, tmp_path / "out", True, nothing)
        closing.join()
    rest = run_campaign(campaign, LocalEngine(1), tmp_path / "out", True, nothing)
    assert rest.whole and 10 <= rest.before < 60
    assert [(row["number"], row["verdict"]) for row in rows_of(rest.table)] == [(n, "ok") for n in range(60)]


class KilledWorker(Exception):  # noqa: N818 - Dask's name
    """As Dask's: a task was given up because its workers died."""


class Suspecting:
    """A cluster of one worker that dies of each "crash", as its scheduler sees it: all that it had is suspect.

    Dask's scheduler counts a death for whatever was assigned to the worker, running or waiting; here as often as it
    takes for all of it to be given up, as happens where workers come back slowly. What waits is run when nothing else
    is submitted, the oldest first.
    """

    def __init__(self, *_address, **_settings):
        self.assigned = []

    def nthreads(self, callback_timeout):
        assert callback_timeout > 0.0
        for future in self.assigned[:1]:
            suspects = list(self.assigned) if future.does("crash") else []
            for one in suspects or [future]:
                one.end(bool(suspects))
        return {"worker": 1}

    def submit(self, work, batch, pure):
        assert not pure
        self.assigned.append(Assigned(self, work, batch))
        return self.assigned[-1]

    def cancel(self, futures):
        for future in futures:
            self.assigned.remove(future)

    def close(self):
        assert not self.assigned


class Assigned:
    """A future of that cluster."""

    def __init__(self, cluster, work, batch):
        self.cluster, self.work, self.batch, self.key = cluster, work, batch, object()

    def does(self, deed):
        return deed in {task.settings["do"] for task in self.batch.tasks}

    def end(self, given_up):
        self.cluster.assigned.remove(self)
        self.given_up = given_up
        self.tell(self)

    def add_done_callback(self, tell):
        self.tell = tell

    def cancelled(self):
        return False

    def result(self, timeout):
        assert timeout > 0.0
        if self.given_up:
            raise KilledWorker
        return self.work(self.batch)


def test_runs_that_wait_behind_one_that_kills_its_worker_are_not_given_up_with_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=Suspecting, KilledWorker=KilledWorker))
    # Two are assigned at once: three crashes and three answers are given up; of the singles, an answer with a crash.
    campaign = campaign_of(tmp_path, '["crash", "answer", "raise"]', 3, 3)
    with DaskEngine("tcp://nowhere", 0.01) as engine:
        outcome = run_campaign(campaign, engine, tmp_path / "dask", False, nothing)
    rows = rows_of(outcome.table)
    assert [row["verdict"] for row in rows] == ["failed"] * 3 + ["ok"] * 3 + ["failed"] * 3
    assert all("its worker died each time" in row["reason"] for row in rows[:3])
    assert all("asked to raise" in row["reason"] for row in rows[6:])


class Busy(Suspecting):
    """A cluster whose scheduler takes some seconds for each answer, as one with many tasks does."""

    answers_in_s = 4.0

    def nthreads(self, callback_timeout):
        if callback_timeout < self.answers_in_s:
            raise TimeoutError
        return super().nthreads(callback_timeout)


@pytest.mark.parametrize("answers_in_s", [4.0, 6.0])
def test_a_busy_scheduler_has_some_seconds_for_its_answer_whatever_the_patience(tmp_path, monkeypatch, answers_in_s):
    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=Busy, KilledWorker=KilledWorker))
    monkeypatch.setattr(Busy, "answers_in_s", answers_in_s)
    campaign = campaign_of(tmp_path, '["answer"]', 6, 2)
    with DaskEngine("tcp://nowhere", 0.01) as engine:
        if answers_in_s < 5.0:
            assert run_campaign(campaign, engine, tmp_path / "dask", False, nothing).whole
        else:
            with pytest.raises(ClusterError, match=r"not answered for 5 s \(limits.cluster_s, at least 5\)"):
                run_campaign(campaign, engine, tmp_path / "dask", False, nothing)


def test_a_scheduler_that_is_not_there_is_told():
    with pytest.raises(UsageError, match="no Dask scheduler answers there"):
        DaskEngine("tcp://127.0.0.1:9", 60.0)
