"""`planarm compare`: a paper's table (table2, mpdstar, moving) computed anew; `--external CMD`: the benchmark."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from planarm.cli.progress import progress
from planarm.cli.scenes import compile_first
from planarm.cli.terminal import terminal
from planarm.errors import UsageError
from planarm.output import writing

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from planarm.experiments.text_table import TextTable
    from planarm.notice import Notice

Result = TypeVar("Result")

BENCHMARK_SCENES = 1000
SAVING_SCENES = 60


def execute(options: argparse.Namespace) -> int:
    """Compute the comparison, print it, and write it down where --out says."""
    if (options.table is None) == (options.external is None):
        raise UsageError("give table2, mpdstar or moving, or --external CMD")
    compile_first("planarm")
    if options.external is not None:
        return _external(options)
    if options.table == "mpdstar":
        return _mpdstar(options)
    if options.table == "moving":
        return _moving(options) if options.random is None else _random(options)
    return _as_printed(options) if options.as_printed else _table2(options)


def _external(options: argparse.Namespace) -> int:
    """Score anybody's planner on the open benchmark.

    Raises:
        UsageError: It gave no answer to any scene.
    """
    from planarm.experiments.external import score_external, score_table

    with progress(options.json) as notice:
        score = score_external(options.external, options.scenes or BENCHMARK_SCENES, options.timeout_s, notice)
    if score.silent:
        raise UsageError(
            f"--external: {options.external!r} answered none of {len(score.answers)} scenes: it ended, or took longer "
            f"than --timeout-s {options.timeout_s:g}; it has to read a scene a line from stdin and to write an answer "
            "a line to stdout, unbuffered (docs/benchmark.md)"
        )
    if options.json:
        print(json.dumps(score.fields()))
    else:
        terminal().print(_shown(score_table(score)))
    return 0


@dataclass(frozen=True)
class _Paper(Generic[Result]):
    """What a paper's comparison is made of; `written` is what --out leaves."""

    compute: Callable[[Notice], Result]
    write: Callable[[Result, Path, Notice], object]
    as_json: Callable[[Result], object]
    assumptions: Callable[[Result], tuple[str, ...]]
    tables: Callable[[Result], Iterable[TextTable]]
    findings: Callable[[Result], tuple[str, ...]]
    written: str


def _compare(options: argparse.Namespace, paper: _Paper[Result]) -> int:
    out = Path(options.out) if options.out else None
    if out:
        with writing(out):  # before the work is done
            out.mkdir(parents=True, exist_ok=True)
    with progress(options.json) as notice:
        result = paper.compute(notice)
        if out:
            with writing(out):
                paper.write(result, out, notice)
    if options.json:
        print(json.dumps(paper.as_json(result)))
        return 0
    console = terminal()
    _print_sentences(console, "What is assumed", paper.assumptions(result))
    for one in paper.tables(result):
        console.print(_shown(one))
    _print_sentences(console, "What is reproduced, and what is not", paper.findings(result))
    if out:
        console.print(f"{paper.written}: {out}", markup=False)
    return 0


def _mpdstar(options: argparse.Namespace) -> int:
    """Compute paper A's cases and tables anew."""
    from planarm.experiments.mpdstar import as_json, compare_mpdstar, findings, tables, write_mpdstar
    from planarm.experiments.mpdstar_scenes import ASSUMPTIONS

    return _compare(
        options,
        _Paper(
            lambda notice: compare_mpdstar(options.nodes, options.scenes or SAVING_SCENES, notice),
            write_mpdstar,
            as_json,
            lambda _result: ASSUMPTIONS,
            tables,
            findings,
            "mpdstar.json, mpdstar.md and pictures",
        ),
    )


def _as_printed(options: argparse.Namespace) -> int:
    """Run the papers' printed equations and pseudo-code, errors included."""
    from dataclasses import asdict

    from planarm.experiments.as_printed import as_printed_tables, compare_as_printed

    with progress(options.json) as notice:
        result = compare_as_printed(notice)
    if options.json:
        print(json.dumps(asdict(result)))
    else:
        for one in as_printed_tables(result):
            terminal().print(_shown(one))
    return 0


def _table2(options: argparse.Namespace) -> int:
    """Compute paper C's Table II anew."""
    from planarm.experiments.table2 import compare_table2
    from planarm.experiments.table2_folder import write_table2
    from planarm.experiments.table2_tables import as_json, assumptions, findings, tables

    return _compare(
        options,
        _Paper(
            lambda notice: compare_table2(options.seeds, notice),
            write_table2,
            as_json,
            assumptions,
            tables,
            findings,
            "table2.json, table2.md and pictures",
        ),
    )


def _random(options: argparse.Namespace) -> int:
    """Plan random scenes among moving obstacles in three ways."""
    from dataclasses import asdict

    from planarm.experiments.moving_random import compare_random, findings, tables

    with progress(options.json) as notice:
        result = compare_random(options.random, notice=notice)
    if options.json:
        print(json.dumps(asdict(result)))
        return 0
    for one in tables(result):
        terminal().print(_shown(one))
    _print_sentences(terminal(), "What that means", findings(result))
    return 0


def _moving(options: argparse.Namespace) -> int:
    """Compute paper B's two environments anew."""
    from planarm.experiments.moving import compare_moving
    from planarm.experiments.moving_folder import write_moving
    from planarm.experiments.moving_tables import as_json, assumptions, findings, tables

    return _compare(
        options,
        _Paper(
            lambda notice: compare_moving(notice=notice),
            write_moving,
            as_json,
            assumptions,
            tables,
            findings,
            "moving.json, moving.md, pictures and animations",
        ),
    )


def _shown(one: TextTable) -> Table:
    """Return the table for a terminal of 80 columns, the cases apart."""
    from rich import box
    from rich.table import Table

    shown = Table(
        title=one.title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for column, name in enumerate(one.header):
        words = column < one.words
        shown.add_column(name, justify="left" if words else "right", no_wrap=words)
    for before, cells in zip((one.rows[0], *one.rows), one.rows, strict=False):
        if one.words > 1 and before[0] != cells[0]:
            shown.add_section()
        shown.add_row(*cells)
    return shown


def _print_sentences(console: Console, title: str, sentences: tuple[str, ...]) -> None:
    from rich.padding import Padding

    console.print(f"[bold]{title}[/bold]")
    for sentence in sentences:
        console.print(Padding(f"- {sentence}", (0, 0, 0, 2)), highlight=False)
    console.print()
