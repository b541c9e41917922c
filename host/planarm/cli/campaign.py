"""`planarm sweep SWEEP.toml` and `planarm campaign CAMPAIGN.toml`: many runs, here or on a Dask cluster."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from planarm.cli.scenes import tell_first_compile
from planarm.cli.terminal import terminal
from planarm.errors import UsageError
from planarm.output import require_folder_place

if TYPE_CHECKING:
    from planarm.campaign.run import Outcome, Progress
    from planarm.campaign.spec import Campaign

STOPPED = 130


def execute(options: argparse.Namespace) -> int:
    """Run what is missing, write it down, and tell the verdicts; 130 after Ctrl-C, with everything finished kept."""
    out = Path(options.out) if options.out else None
    if out:
        require_folder_place(out)
    tell_first_compile("planarm", "planarm_sim")
    from planarm.campaign.dask_engine import DaskEngine
    from planarm.campaign.engine import LocalEngine
    from planarm.campaign.run import run_campaign
    from planarm.campaign.spec import load_campaign

    campaign = load_campaign(Path(options.file))
    if options.only is not None:
        return _only(options.only, campaign, options.json)
    if options.dask and options.workers:
        raise UsageError("--workers goes with this machine's own processes; a cluster has its own number")
    out = out or Path("out") / campaign.name
    with DaskEngine(options.dask, campaign.cluster_s) if options.dask else nullcontext() as cluster:
        engine = cluster or LocalEngine(options.workers or os.cpu_count() or 1)
        outcome = run_campaign(campaign, engine, out, options.resume, _teller(options.json))
    _tell(options.json, outcome, campaign.size)
    return 0 if outcome.whole else STOPPED


def _only(number: int, campaign: Campaign, as_json: bool) -> int:
    """Repeat one run in this process and tell its row."""
    from itertools import islice

    from planarm.campaign.task import Batch
    from planarm.campaign.worker import run_batch
    from planarm.report.tables import summary_table

    task = next(islice(campaign.tasks(), number, None), None)
    if task is None:
        raise UsageError(f"--only {number}: {campaign.source} has {campaign.size} runs, counted from 0")
    (row,) = run_batch(Batch(campaign.kind, campaign.scenes, (task,), campaign.limits, campaign.options))
    told = {**task.settings, "verdict": row.verdict, "reason": row.reason, **row.figures}
    if as_json:
        print(json.dumps(told))
    else:
        terminal().print(summary_table(told))
    return 0


def _tell(as_json: bool, outcome: Outcome, size: int) -> None:
    finished = sum(outcome.verdicts.values())
    if as_json:
        told = {
            "rows": str(outcome.table),
            "runs": size,
            "finished_before": outcome.before,
            "finished": finished,
            "verdicts": outcome.verdicts,
            "took_s": outcome.took_s,
            "runs_per_minute": 60.0 * finished / outcome.took_s,
            "whole": outcome.whole,
        }
        print(json.dumps(told))
        return
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in sorted(outcome.verdicts.items())) or "nothing to do"
    print(f"{finished} runs in {outcome.took_s:.1f} s: {verdicts}")
    if not outcome.whole:
        print(f"stopped; {size - outcome.before - finished} runs are missing, --resume goes on with them")
    print(f"rows: {outcome.table}")


def _teller(quiet: bool) -> Callable[[Progress], None]:
    """Return what shows the progress on stderr: a bar on a terminal, a line now and then elsewhere."""
    if quiet:
        return lambda _progress: None
    if not sys.stderr.isatty():
        return _lines()
    from planarm.cli.progress import counting_bar

    return counting_bar()


def _lines() -> Callable[[Progress], None]:
    told = -1

    def tell(progress: Progress) -> None:
        nonlocal told
        tenth = 10 * (progress.finished + progress.before) // max(progress.size, 1)
        if tenth != told:
            told = tenth
            left = "" if progress.remaining_s is None else f", about {progress.remaining_s:.0f} s left"
            print(f"{progress.finished + progress.before} of {progress.size} runs{left}", file=sys.stderr, flush=True)

    return tell
