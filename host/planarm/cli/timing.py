"""`planarm timing CAPTURE` and `planarm timing diff A B`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from planarm.cli.progress import progress
from planarm.cli.scenes import require_file, tell_first_compile
from planarm.errors import CaptureError, StepsDifferError, UsageError
from planarm.output import require_place, writing

if TYPE_CHECKING:
    from planarm.timing_flow import TimingFindings


def execute(options: argparse.Namespace) -> int:
    """Judge a recording, or one against another; exit code 7 when something is wrong."""
    names = [Path(name) for name in options.captures]
    is_diff = options.captures[0] == "diff" and len(names) > 1
    if len(names) != (3 if is_diff else 1):
        raise UsageError("give one capture, or 'diff' and two captures; 'planarm timing --help' shows both")
    if is_diff and options.plan:
        raise UsageError("diff holds one capture against the other; --plan goes with one capture")
    for place in filter(None, (options.junit, options.html)):
        require_place(Path(place))
    for name in options.captures[int(is_diff) :]:
        require_file(name, CaptureError, "give the path of a VCD, or of a CSV export of Saleae Logic 2 or sigrok")
    tell_first_compile("planarm")
    from planarm.timing_flow import TimingRequest, compare_recordings, judge_recording

    request = TimingRequest(
        capture=names[-1],
        plan=Path(options.plan) if options.plan else None,
        driver=options.driver,
        channels=tuple(options.map or ()),
        tolerance_us=options.tolerance_us,
        board=options.board,
    )
    with progress(options.json) as notice:
        found = compare_recordings(names[1], request, notice) if is_diff else judge_recording(request, notice)
    _tell(options, found)
    if not found.report.ok:
        from planarm.report.timing import verdict

        if options.json:
            return StepsDifferError.exit_code
        raise StepsDifferError(f"{request.capture}: {verdict(found.report)}")
    return 0


def _tell(options: argparse.Namespace, found: TimingFindings) -> None:
    from planarm.cli.terminal import terminal
    from planarm.report.page import timing_page
    from planarm.report.timing import findings_table, joints_table, junit, timing_json, timing_record, verdict

    report = found.report
    if options.junit:
        with writing(Path(options.junit)):
            Path(options.junit).write_text(junit(report, found.tips_cm), encoding="utf-8")
    if options.html:
        with writing(Path(options.html)):
            told = timing_record(report, found.drivers, found.tips_cm)
            Path(options.html).write_text(timing_page(told), encoding="utf-8")
    if options.json:
        print(json.dumps(timing_json(report, found.drivers, found.tips_cm)))
        return
    console = terminal()
    console.print(joints_table(report, found.drivers))
    if report.clock_ppm is not None and report.start_s is not None:
        console.print(f"board clock {report.clock_ppm:+.1f} ppm, plan starts at {report.start_s:.6f} s", markup=False)
    if report.findings:
        console.print(findings_table(report, found.tips_cm))
        unlisted = sum(report.counts.values()) - len(report.findings[:20])
        if unlisted > 0:
            console.print(f"and {unlisted} more; --json lists up to {len(report.findings)}", markup=False)
    if report.ok:
        console.print(verdict(report), markup=False)
