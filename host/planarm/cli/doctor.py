"""`planarm doctor`: what stands between this computer and a board."""

from __future__ import annotations

import argparse
import json
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from planarm_wire.messages import BOARDS
from planarm_wire.wirings import pin_words

if TYPE_CHECKING:
    from planarm.link.doctor import Report


def execute(options: argparse.Namespace) -> int:
    """List ports and findings; with --port ask the board there, too. Always 0: a finding is no failure."""
    from planarm.link.doctor import ask_board, examine
    from planarm.link.transport import open_transport

    report = examine(Path.cwd())
    if options.port is not None:
        with closing(open_transport(options.port)) as transport:
            report = replace(report, board=ask_board(transport))
    print(json.dumps({**asdict(report), "ok": report.ok}) if options.json else _words(report))
    return 0


def _words(report: Report) -> str:
    lines = []
    for port in report.ports:
        lines.append(f"{port.device}  {port.description}")
        if port.by_id:
            lines.append(f"  {port.by_id}  (stays the same wherever it is plugged in)")
    for finding in report.findings:
        lines.append(f"{'!!' if finding.advice else 'ok'} {finding.what}")
        if finding.advice:
            lines.append(f"   {finding.advice}")
    lines += [f"board {name}: {value}" for name, value in report.board.items()]
    steps = report.board.get("joints")
    lines += [f"pins of {board.name}: {pin_words(board)}" for board in BOARDS.values() if board.joints == steps]
    return "\n".join(lines)
