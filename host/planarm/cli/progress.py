"""A progress bar on a terminal, plain lines elsewhere, silence for --json."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

    from planarm.campaign.run import Progress
    from planarm.link.remaining import Remaining
    from planarm.link.stream import StreamProgress

STREAM = "stream"
"""The stage in which a device executes a motion."""


class Shown:
    """What a command tells its progress to: the share of a stage, and everything of a motion under way."""

    def __call__(self, stage: str, share: float) -> None:
        """Take a stage's name and the share of it that is done, 0 to 1."""

    def watch(self, told: StreamProgress) -> None:
        """Take what the device tells of a motion."""

    def warn(self, text: str) -> None:
        """Take what will be otherwise than planned."""


@contextmanager
def progress(quiet: bool) -> Iterator[Shown]:
    """Give what shows how far the work is, on stderr so that stdout stays for results."""
    if quiet:
        yield Shown()
    elif sys.stderr.isatty():
        with _bar() as shown:
            yield shown
    else:
        yield Lines()


class Lines(Shown):
    """A line for each quarter of a stage; of a motion with path time, queue and remaining time."""

    def __init__(self, wall_s: Callable[[], float] = time.monotonic) -> None:
        self._told: set[tuple[str, int]] = set()
        self._wall_s = wall_s
        self._remaining: Remaining | None = None

    def __call__(self, stage: str, share: float) -> None:
        """Print a quarter once; those of a motion come with `watch`."""
        if stage != STREAM:
            self._print(stage, share, "")

    def watch(self, told: StreamProgress) -> None:
        """Print a quarter once, with what there is to know."""
        from planarm.link.remaining import Remaining, words_of

        self._remaining = self._remaining or Remaining(self._wall_s)
        left_s = self._remaining.after(told)
        self._print(STREAM, told.path_s / told.total_s, f" ({words_of(told, left_s)})")

    def warn(self, text: str) -> None:
        """Print it."""
        print(f"note: {text}", file=sys.stderr, flush=True)

    def _print(self, stage: str, share: float, more: str) -> None:
        quarter = int(4 * share)
        if (stage, quarter) not in self._told:
            self._told.add((stage, quarter))
            print(f"{stage}: {25 * quarter} %{more}", file=sys.stderr, flush=True)


NARROW_COLUMNS = 76
"""Below it there is no room for a bar beside all that a motion tells."""


@contextmanager
def _bar() -> Iterator[Shown]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn
    from rich.table import Column

    whole = Column(no_wrap=True)
    columns = (
        TextColumn("{task.description:>7}", table_column=whole),
        BarColumn(bar_width=None, table_column=Column(ratio=1)),
        TextColumn("{task.percentage:3.0f} %", table_column=whole),
        TextColumn("{task.fields[words]}", table_column=whole),
    )
    with Progress(*columns, console=Console(stderr=True), expand=True) as bar:
        yield Bar(bar)


class Bar(Shown):
    """A bar for each stage; of a motion with path time, queue and remaining time behind it."""

    def __init__(self, bar: RichProgress) -> None:
        self._bar = bar
        self._tasks: dict[str, TaskID] = {}
        self._remaining: Remaining | None = None

    def __call__(self, stage: str, share: float) -> None:
        """Move the stage's bar."""
        self._bar.update(self._task(stage), completed=share)

    def watch(self, told: StreamProgress) -> None:
        """Move the motion's bar, and say what there is to know."""
        from planarm.link.remaining import Remaining, words_of

        self._remaining = self._remaining or Remaining(time.monotonic)
        words = words_of(told, self._remaining.after(told), short=self._bar.console.width < NARROW_COLUMNS)
        self._bar.update(self._task(STREAM), completed=told.path_s / told.total_s, words=words)

    def warn(self, text: str) -> None:
        """Print it above the bars."""
        self._bar.console.print(f"note: {text}", markup=False)

    def _task(self, stage: str) -> TaskID:
        if stage not in self._tasks:
            self._tasks[stage] = self._bar.add_task(stage, total=1.0, words="")
        return self._tasks[stage]


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
