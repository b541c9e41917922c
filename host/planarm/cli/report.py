"""`planarm report DIR`: the page of a run, or what a sweep's or campaign's results say."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from planarm.errors import UsageError
from planarm.output import writing

if TYPE_CHECKING:
    from rich.table import Table

    from planarm.report.campaign import Failure, GroupRow


def execute(options: argparse.Namespace) -> int:
    """Write a run's page anew, or print a campaign's tables; which of them the folder tells."""
    from planarm.run_folder.folder import RECORD

    folder = Path(options.results)
    return _run(folder, options) if (folder / RECORD).exists() else _campaign(folder, options)


def _run(folder: Path, options: argparse.Namespace) -> int:
    """Write the page of a run from its record, beside it or into --out."""
    from planarm.run_folder.folder import PAGE, read_record, write_page

    record = read_record(folder)
    page = Path(options.out or folder) / PAGE
    write_page(record, page)
    print(json.dumps({"report": str(page), "verdict": record["verdict"]}) if options.json else page)
    return 0


def _campaign(folder: Path, options: argparse.Namespace) -> int:
    """Print tables of groups and failures; with --out draw the distributions."""
    from planarm.campaign.store import read_about, read_rows
    from planarm.report.campaign import failures, figure_names, grouped, report_json

    told = read_about(folder)
    table = read_rows(folder)
    if table is None:
        raise UsageError(f"{folder}: holds no row yet; 'planarm sweep {told.source} --resume --out {folder}' goes on")
    rows = table.to_pylist()
    figures = figure_names(rows)
    groups = grouped(rows, figures)
    failed = failures(rows, f"planarm campaign {told.source}")
    if options.json:
        print(report_json(groups, failed))
    else:
        _print(groups, failed, figures, f"{told.name}: {len(rows):,} of {told.size:,} runs, {told.code}")
    if options.out:
        _draw(rows, figures, Path(options.out), options.json)
    return 0


def _print(groups: list[GroupRow], failed: list[Failure], figures: list[str], title: str) -> None:
    from planarm.cli.terminal import terminal

    console = terminal()
    console.print(title, markup=False)
    console.print(_verdicts_table(groups))
    for figure in figures:
        console.print(_spread_table(groups, figure))
    for failure in failed:
        console.print(f"{failure.runs} x {failure.verdict}: {failure.reason}", markup=False, highlight=False)
        console.print(f"    again: {failure.example}", markup=False, highlight=False)


def _verdicts_table(groups: list[GroupRow]) -> Table:
    verdicts = sorted({verdict for group in groups for verdict in group.verdicts})
    table = _table(groups, "", ("runs", *verdicts))
    for group in groups:
        counts = (f"{group.verdicts.get(verdict, 0):,}" for verdict in verdicts)
        table.add_row(*map(str, group.settings.values()), f"{group.runs:,}", *counts)
    return table


def _spread_table(groups: list[GroupRow], figure: str) -> Table:
    table = _table(groups, figure, ("5 %", "median", "95 %"))
    for group in groups:
        spread = (f"{value:.5g}" for value in group.figures.get(figure, ()))
        table.add_row(*map(str, group.settings.values()), *spread)
    return table


def _table(groups: list[GroupRow], title: str, columns: tuple[str, ...]) -> Table:
    """Return an empty table: a row a group, its settings first."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title=title, title_justify="left")
    settings = list(groups[0].settings) if groups else []
    for name in (*(s.split(".")[-1] for s in settings), *columns):
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _draw(rows: list[dict[str, object]], figures: list[str], out: Path, quiet: bool) -> None:
    from planarm.report.campaign_plots import draw_distribution

    with writing(out):
        for figure in figures:
            draw_distribution(rows, figure, out / f"{figure}.png")
    if not quiet:
        print(f"pictures: {out}")
