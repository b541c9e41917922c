"""`planarm resume RUN`: where the arm is after a run that broke off, and the rest of the path."""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planarm.cli.progress import progress
from planarm.cli.scenes import require_file, tell_first_compile
from planarm.errors import JournalError

if TYPE_CHECKING:
    from planarm.link.position import PositionReport


def execute(options: argparse.Namespace) -> int:
    """Tell the verdict; unless only asked for that, go on with the run."""
    require_file(str(Path(options.run) / "run.journal"), JournalError, "give the folder of a run")
    tell_first_compile("planarm", "planarm_sim")
    from planarm.link.positions import Positions, default_path
    from planarm.link.transport import open_transport
    from planarm.operations.resume import go_on, load_run, meet_again
    from planarm.plan_file import arm_hash
    from planarm.streaming.plan_stream import telling

    run = load_run(Path(options.run))
    port = options.port or run.port
    with closing(open_transport(port, run.scene.link.baud, board=run.scene.board)) as transport:
        if options.check:
            _, report, _ = meet_again(run, transport)
            _tell(options.json, report, None)
            return 0
        with progress(options.json) as notice:
            report, result = go_on(
                run, transport, lambda told: _confirmed(told, options), telling(notice, notice.watch)
            )
    if result is not None and "://" not in port:
        Positions(default_path()).remember(port, result.boot_nonce, arm_hash(run.stored.scene), "resumed")
    _tell(options.json, report, result.segments if result else 0)
    return 0


def _confirmed(report: PositionReport, options: argparse.Namespace) -> bool:
    """Ask the person at the terminal; elsewhere only --yes is a yes."""
    if options.yes or options.json or not sys.stdin.isatty():
        return bool(options.yes)
    print(report, file=sys.stderr)
    return input("go on from there? [y/N] ").strip().lower() in ("y", "yes")


def _tell(as_json: bool, report: PositionReport, executed: int | None) -> None:
    told: dict[str, Any] = {
        "verdict": report.certainty.value,
        "reason": report.reason,
        "executed_segments": list(report.executed_segments),
        "total_segments": report.total_segments,
        "moved_usteps": list(report.moved_usteps),
        "within_usteps": list(report.spread_usteps),
    }
    if executed is not None:
        told["segments_of_the_rest"] = executed
    if as_json:
        print(json.dumps(told))
        return
    print(report)
    if executed is not None:
        print("the rest of the path was executed" if executed else "nothing was left to execute")
