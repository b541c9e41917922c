"""A timing report as tables for the terminal, as JSON, and as JUnit for continuous integration."""

# ruff: noqa: PLC0415 - rich is imported by those who print a table

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import planarm

if TYPE_CHECKING:
    from rich.table import Table

    from planarm.analysis.timing import Finding, JointTiming, TimingReport

Point = tuple[float, float]

MOST_SHOWN = 20

WORDS = {
    "missing": "step missing",
    "extra": "step too many",
    "late": "step late",
    "early": "step early",
    "stretched": "motion does not keep the plan's time (held, slowed or starved), from here on",
    "direction": "step the wrong way",
    "step_high": "STEP pulse too short",
    "step_low": "STEP pause too short",
    "dir_setup": "DIR set too late before STEP",
    "dir_hold": "DIR changed too soon after STEP",
}


def timing_json(report: TimingReport, drivers: Sequence[str | None], tips_cm: Sequence[Point | None]) -> dict[str, Any]:
    """Return the whole report as one JSON object."""
    told = asdict(report)
    told["ok"] = report.ok
    told["curve_times_s"] = [round(t, 9) for t in report.curve_times_s().tolist()]
    for joint, driver in zip(told["joints"], drivers, strict=True):
        joint["driver"] = driver
    for finding, tip in zip(told["findings"], tips_cm, strict=True):
        finding["tip_cm"] = tip
    return told


def timing_record(
    report: TimingReport, drivers: Sequence[str | None], tips_cm: Sequence[Point | None]
) -> dict[str, Any]:
    """Return what a page shows of a report: the whole of it, its verdict, and the words for its findings."""
    told = timing_json(report, drivers, tips_cm)
    state, word = ("green", "nothing is wrong") if report.ok else ("red", "something is wrong")
    rows = [(name, cells) for name, cells in _rows(report.joints, drivers) if any(cells)]
    return {
        **told,
        "planarm": planarm.__version__,
        "title": Path(report.source).name,
        "verdict": {"state": state, "word": word, "why": verdict(report)},
        "words": WORDS,
        "rows": rows,
    }


def joints_table(report: TimingReport, drivers: Sequence[str | None]) -> Table:
    """Return the joints' figures, a column a joint."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    for joint in report.joints:
        table.add_column(f"joint {joint.joint}", justify="right")
    for name, cells in _rows(report.joints, drivers):
        if any(cell != "" for cell in cells):
            table.add_row(name, *cells)
    return table


def findings_table(report: TimingReport, tips_cm: Sequence[Point | None]) -> Table:
    """Return the first findings, a row each."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("time s", "joint", "finding", "measured", "limit", "path s", "tip cm"):
        table.add_column(name, justify="left" if name == "finding" else "right")
    for finding, tip in list(zip(report.findings, tips_cm, strict=True))[:MOST_SHOWN]:
        table.add_row(
            f"{finding.time_s:.6f}",
            str(finding.joint),
            WORDS[finding.kind] + (f" ({finding.cause})" if finding.cause else ""),
            _us(finding.value_us),
            _us(finding.limit_us),
            "" if finding.path_s is None else f"{finding.path_s:.6f}",
            "" if tip is None else f"{tip[0]:.2f}, {tip[1]:.2f}",
        )
    return table


def verdict(report: TimingReport) -> str:
    """Say in a sentence what was found."""
    if not report.aligned:
        counts = ", ".join(f"{joint.steps} of {joint.steps_planned}" for joint in report.joints)
        return f"the recorded steps do not follow the plan at all (steps by joint: {counts})"
    if report.ok:
        return "nothing is wrong" if report.clock_ppm is None else "every step is there, on its time and in its rules"
    return "; ".join(f"{count} x {WORDS[kind]}" for kind, count in sorted(report.counts.items()))


def junit(report: TimingReport, tips_cm: Sequence[Point | None]) -> str:
    """Return the report as JUnit XML: one test case a joint and kind of finding."""
    suite = ET.Element("testsuite", name=f"planarm timing {report.source}")
    failures = 0
    if not report.aligned:
        case = ET.SubElement(suite, "testcase", classname="timing", name="follows the plan")
        ET.SubElement(case, "failure", message=verdict(report))
        failures += 1
    kinds = [kind for kind in WORDS if report.clock_ppm is not None or "_" in kind]
    placed = list(zip(report.findings, tips_cm, strict=True))
    for joint in report.joints:
        for kind in kinds:
            case = ET.SubElement(suite, "testcase", classname=f"timing.joint{joint.joint}", name=f"no {WORDS[kind]}")
            mine = [_sentence(f, tip) for f, tip in placed if f.kind == kind and f.joint == joint.joint]
            if mine:
                failures += 1
                failure = ET.SubElement(case, "failure", message=f"{len(mine)} x {WORDS[kind]}")
                failure.text = "\n".join(mine)
    suite.set("tests", str(len(suite)))
    suite.set("failures", str(failures))
    ET.indent(suite)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(suite, encoding="unicode") + "\n"


def _rows(joints: Sequence[JointTiming], drivers: Sequence[str | None]) -> list[tuple[str, list[str]]]:
    def spread(joint: JointTiming, name: str) -> str:
        found = getattr(joint, name)
        return "" if found is None else f"{found.p50_us:.3f} / {found.p99_us:.3f} / {found.max_us:.3f}"

    rows = [
        ("steps", [f"{j.steps:,}" for j in joints]),
        ("planned", ["" if j.steps_planned is None else f"{j.steps_planned:,}" for j in joints]),
        ("net micro-steps", [f"{j.net_usteps:+,}" for j in joints]),
        ("time error p50 / p99 / max, us", [spread(j, "timing_error") for j in joints]),
        ("interval error p50 / p99 / max, us", [spread(j, "interval_error") for j in joints]),
        ("jitter rms, us", ["" if j.timing_error is None else f"{j.timing_error.rms_us:.3f}" for j in joints]),
        ("driver", [name or "" for name in drivers]),
    ]
    widths = {
        "shortest interval": "shortest_interval_us",
        "STEP high, least": "high_min_us",
        "STEP high, usual": "high_p50_us",
        "STEP high, most": "high_max_us",
        "STEP low, least": "low_min_us",
        "DIR setup, least": "dir_setup_min_us",
        "DIR hold, least": "dir_hold_min_us",
    }
    rows += [(name, [_us(getattr(j, field)) for j in joints]) for name, field in widths.items()]
    rows.append(("in the resonance band", ["" if j.band_s is None else f"{j.band_s:.3f} s" for j in joints]))
    return rows


def _sentence(finding: Finding, tip_cm: Point | None) -> str:
    place = "" if finding.path_s is None else f", {finding.path_s:.6f} s on the path"
    tip = "" if tip_cm is None else f" at ({tip_cm[0]:.2f}, {tip_cm[1]:.2f}) cm"
    size = "" if finding.value_us is None else f": {_us(finding.value_us)}, limit {_us(finding.limit_us)}"
    cause = f", held up by {finding.cause}" if finding.cause else ""
    return f"joint {finding.joint}: {WORDS[finding.kind]} at {finding.time_s:.9f} s{place}{tip}{size}{cause}"


def _us(value: float | None) -> str:
    return "" if value is None else f"{value:.3f} us"
