"""A campaign from its file to its table: what is missing is run, rows are written as they come."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from planarm.campaign.engine import Engine
from planarm.campaign.spec import Campaign
from planarm.campaign.store import ResultStore, about
from planarm.errors import ClusterError


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a campaign stands: runs finished here, finished before, and in all; seconds that may remain."""

    finished: int
    before: int
    size: int
    remaining_s: float | None


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a campaign left: rows by verdict (of this call), rows found before, the table, and whether it is whole."""

    verdicts: dict[str, int]
    before: int
    table: Path
    whole: bool
    took_s: float


def run_campaign(
    campaign: Campaign, engine: Engine, folder: Path, resume: bool, on_progress: Callable[[Progress], None]
) -> Outcome:
    """Run what is missing.

    Ctrl-C stops it: everything finished is kept, and `resume` goes on from there.

    Raises:
        UsageError: the folder holds other results.
        OutputError: it cannot be written.
        SceneError: the scenes or settings are wrong for every run; single wrong ones are failed rows.
        ClusterError: the cluster is gone; everything finished is kept, joined, and `resume` goes on from there.
    """
    store = ResultStore(folder, about(campaign), resume)
    done = store.done()
    verdicts: Counter[str] = Counter()
    scenes = [scene.source for scene in campaign.scenes]
    began_s = time.monotonic()
    stopped = False
    on_progress(Progress(0, len(done), campaign.size, None))
    with closing(engine.run(campaign.batches(done))) as results:
        try:
            for rows in results:
                store.add(rows, scenes)
                verdicts.update(row.verdict for row in rows)
                on_progress(_progress(verdicts.total(), len(done), campaign.size, time.monotonic() - began_s))
        except KeyboardInterrupt:
            if len(store.done()) - len(done) > verdicts.total():  # the last rows were written, not counted yet
                verdicts.update(row.verdict for row in rows)
            if not (verdicts or done):  # there is nothing to keep or to tell of
                raise
            stopped = True
        except ClusterError:
            if verdicts or done:
                store.join()
            raise
    table = store.join()
    return Outcome(dict(verdicts), len(done), table, not stopped, time.monotonic() - began_s)


def _progress(finished: int, before: int, size: int, took_s: float) -> Progress:
    left = size - before - finished
    return Progress(finished, before, size, took_s / finished * left if finished else None)
