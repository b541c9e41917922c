"""What many runs cost beside the runs themselves: `./dev bench campaign [--runs N]`.

Runs that do nothing ("self-test", "answer") show how many tasks a second each engine hands out by batch size, what a
row weighs on disk and how long results take to read and join; `--scene` adds what a run of each kind costs, and how
long a fresh worker takes until its first row (imports and cached kernels). The table of docs/scale.md comes from here.
"""

import argparse
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from planarm.campaign.dask_engine import DaskEngine
from planarm.campaign.engine import Engine, LocalEngine
from planarm.campaign.run import Progress, run_campaign
from planarm.campaign.spec import Campaign, load_campaign
from planarm.campaign.store import read_rows

ROOT = Path(__file__).resolve().parents[1]
BATCHES = (1, 10, 100, 1000)
KINDS = (("map", 1), ("search", 1), ("plan", 1), ("line", 1))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20_000, help="runs that do nothing, for each engine and batch")
    parser.add_argument("--kind-runs", type=int, default=100, help="runs of each real kind, on one worker")
    parser.add_argument("--scene", type=Path, default=ROOT / "examples" / "table1_case1.toml")
    options = parser.parse_args()
    console = Console()
    with tempfile.TemporaryDirectory() as folder:
        console.print(rates(options.runs, options.scene, Path(folder)))
        console.print(kinds(options.kind_runs, options.scene, Path(folder)))


def rates(runs: int, scene: Path, folder: Path) -> Table:
    """Return how many empty runs a second each engine manages by batch, what they weigh and how long joining takes."""
    table = Table(box=box.SIMPLE_HEAD, title=f"{runs:,} runs that do nothing, two workers")
    for name in ("engine", "batch", "runs/s", "batches/s", "B/row, parts", "joined", "keys s"):
        table.add_column(name, justify="right")
    for name, make in (("processes", local), ("Dask", dask)):
        with make() as engine:
            for batch in BATCHES:
                count = min(runs, 1000 * batch)
                out = folder / f"{name}-{batch}"
                campaign = _campaign(folder, scene, "self-test", count, batch)
                run_campaign(
                    _campaign(folder, scene, "self-test", 4, 1), engine, folder / f"w{name}{batch}", False, _mute
                )
                peak = 0

                def weigh(progress: Progress, out: Path = out, count: int = count) -> None:
                    nonlocal peak
                    if progress.finished == count:
                        peak = sum(path.stat().st_size for path in out.glob("part-*"))

                outcome = run_campaign(campaign, engine, out, False, weigh)
                began_s = time.perf_counter()
                read_rows(out, ["key"])
                keys_s = time.perf_counter() - began_s
                rate = count / outcome.took_s
                weight = outcome.table.stat().st_size / count
                table.add_row(
                    name, str(batch), f"{rate:,.0f}", f"{rate / batch:,.0f}", f"{peak / count:.0f}", f"{weight:.0f}",
                    f"{keys_s:.2f}",
                )  # fmt: skip
    return table


def kinds(runs: int, scene: Path, folder: Path) -> Table:
    """Return what a run of each kind costs on one worker, and how long the worker takes until its first rows."""
    table = Table(box=box.SIMPLE_HEAD, title=f"{runs} runs of each kind, one worker, kernels in the cache")
    for name in ("kind", "first row after s", "s a run", "runs/minute"):
        table.add_column(name, justify="right")
    for kind, batch in KINDS:
        arrivals: list[float] = []
        began_s = time.perf_counter()
        campaign = _campaign(folder, scene, kind, runs, batch)
        run_campaign(
            campaign, LocalEngine(1), folder / kind, False, lambda _p, a=arrivals: a.append(time.perf_counter())
        )
        first_s, each_s = arrivals[1] - began_s, (arrivals[-1] - arrivals[1]) / (runs - 1)
        table.add_row(kind, f"{first_s:.1f}", f"{each_s:.4f}", f"{60 / each_s:,.0f}")
    return table


def _campaign(folder: Path, scene: Path, kind: str, count: int, batch: int) -> Campaign:
    seed = "seed" if kind in ("self-test", "line") else '"planner.seed"'
    extra = '"planner.algorithm" = ["chaos_a_star"]\n' if kind == "search" else ""
    path = folder / f"{kind}.toml"
    path.write_text(
        f'kind = "{kind}"\nscenes = ["{scene.resolve()}"]\nbatch = {batch}\n'
        f"[vary]\n{extra}{seed} = {{ count = {count} }}\n"
    )
    return load_campaign(path)


@contextmanager
def local() -> Iterator[Engine]:
    """Give two processes of this machine."""
    yield LocalEngine(2)


@contextmanager
def dask() -> Iterator[Engine]:
    """Give a Dask cluster of two workers on this machine."""
    import distributed  # noqa: PLC0415 - an optional package

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True)
    with cluster, DaskEngine(cluster.scheduler_address) as engine:
        yield engine


def _mute(_progress: Progress) -> None:
    pass


if __name__ == "__main__":
    main()
