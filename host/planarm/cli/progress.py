"""A progress bar on a terminal, plain lines elsewhere, silence for --json."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planarm.campaign.run import Progress

Report = Callable[[str, float], None]
"""Takes the stage's name and the share done, 0 to 1."""


@contextmanager
def progress(quiet: bool) -> Iterator[Report]:
    """Give a function that shows how far the work is, on stderr so that stdout stays for results."""
    if quiet:
        yield lambda _stage, _share: None
    elif sys.stderr.isatty():
        with _bar() as report:
            yield report
    else:
        yield _lines()


def _lines() -> Report:
    told: set[tuple[str, int]] = set()

    def report(stage: str, share: float) -> None:
        quarter = int(4 * share)
        if (stage, quarter) not in told:
            told.add((stage, quarter))
            print(f"{stage}: {25 * quarter} %", file=sys.stderr, flush=True)

    return report


@contextmanager
def _bar() -> Iterator[Report]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description:>10}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        tasks: dict[str, TaskID] = {}

        def report(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = bar.add_task(stage, total=1.0)
            bar.update(tasks[stage], completed=share)

        yield report


def counting_bar() -> Callable[[Progress], None]:
    """Return what shows finished runs of all, with the remaining time, on stderr; it ends with the last run."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    bar = Bar(
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
        console=Console(stderr=True),
    )
    task = bar.add_task("runs", left="")
    bar.start()

    def tell(progress: Progress) -> None:
        left = "" if progress.remaining_s is None else f"about {progress.remaining_s:.0f} s left"
        done = progress.finished + progress.before
        bar.update(task, total=progress.size, completed=done, left=left)
        if done >= progress.size:
            bar.stop()

    return tell
