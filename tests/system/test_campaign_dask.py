"""The same campaign on a Dask cluster of two workers, one of which is killed on the way: the same rows, none twice."""

import os
import signal
import sys
import warnings
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from planarm.campaign.dask_engine import DaskEngine
from planarm.campaign.engine import LocalEngine
from planarm.campaign.run import run_campaign
from planarm.campaign.spec import load_campaign
from planarm.errors import UsageError

distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
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


def test_a_killed_worker_loses_and_doubles_nothing(tmp_path, sized):
    """Small: runs that only answer; full: the 10,000 boards of examples/sweeps/line_faults.toml."""
    small = campaign_of(tmp_path, '["answer"]', 300, 3)
    campaign = sized(small, None) or load_campaign(SCENE.parent / "sweeps" / "line_faults.toml")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True)
    with cluster, DaskEngine(cluster.scheduler_address) as engine:
        killed = []

        def kill_once(progress):
            if progress.finished >= campaign.size // 10 and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        there = run_campaign(campaign, engine, tmp_path / "dask", False, kill_once)
        assert killed and there.whole
        poisoned = campaign_of(tmp_path, '["answer", "crash"]', 2, 2)
        poison = run_campaign(poisoned, engine, tmp_path / "poison", False, lambda _progress: None)
    here = run_campaign(
        campaign, LocalEngine(sized(1, os.cpu_count() or 1)), tmp_path / "local", False, lambda _progress: None
    )
    assert rows_of(there.table) == rows_of(here.table)
    assert [row["verdict"] for row in rows_of(poison.table)] == ["ok", "ok", "failed", "failed"]


def test_a_scheduler_that_is_not_there_is_told():
    with pytest.raises(UsageError, match="no Dask scheduler answers there"):
        DaskEngine("tcp://127.0.0.1:9")
