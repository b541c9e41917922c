"""What a sweep's or campaign's rows say: tables by setting, distributions, failures by kind with how to repeat them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

FEWEST_SETTINGS, MOST_SETTINGS = 2, 24
"""A setting with fewer values tells nothing apart, one with more makes no groups."""

RESERVED = ("number", "key", "scene", "verdict", "reason", "took_s", "code", "image_sha256")


@dataclass(frozen=True, slots=True)
class GroupRow:
    """Runs that share their settings.

    Attributes:
        settings: what they share.
        runs: how many.
        verdicts: how many of each verdict.
        figures: 5 %, 50 % and 95 % of each figure over the runs that have it.
    """

    settings: dict[str, Any]
    runs: int
    verdicts: dict[str, int]
    figures: dict[str, tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class Failure:
    """Runs with the same verdict and, numbers apart, the same reason; `example` repeats the first of them."""

    verdict: str
    reason: str
    runs: int
    example: str


def grouped(rows: Sequence[Mapping[str, Any]], figures: Sequence[str]) -> list[GroupRow]:
    """Group the rows by the settings that tell runs apart, seeds left out."""
    names = group_names(rows)
    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row.get(name) for name in names), []).append(row)
    return [_group(dict(zip(names, key, strict=True)), members, figures) for key, members in groups.items()]


def group_names(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the scene column and the settings with a few values each; seeds tell nothing apart."""
    settings = [name for name in (rows[0] if rows else {}) if name.startswith("set.")]
    names = ["scene", *(name for name in settings if name.split(".")[-1] != "seed")]
    counts = {name: len({row.get(name) for row in rows}) for name in names}
    return [name for name in names if FEWEST_SETTINGS <= counts[name] <= MOST_SETTINGS]


def figure_names(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the columns that hold numbers which differ."""
    found = []
    for name in rows[0] if rows else {}:
        if name in RESERVED or name.startswith("set."):
            continue
        values = [row[name] for row in rows if row[name] is not None]
        if (
            values
            and all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
            and len(set(values)) > 1
        ):
            found.append(name)
    return found


def failures(rows: Iterable[Mapping[str, Any]], command: str) -> list[Failure]:
    """Return the runs that did not end "ok", by kind, most frequent first.

    Args:
        rows: the runs.
        command: the words that begin the line which repeats a run.
    """
    kinds: Counter[tuple[str, str]] = Counter()
    first: dict[tuple[str, str], Mapping[str, Any]] = {}
    for row in rows:
        if row["verdict"] == "ok":
            continue
        kind = (str(row["verdict"]), without_numbers(str(row["reason"])))
        kinds[kind] += 1
        first.setdefault(kind, row)
    return [
        Failure(
            verdict,
            str(first[verdict, reason]["reason"]),
            count,
            f"{command} --only {first[verdict, reason]['number']}",
        )
        for (verdict, reason), count in kinds.most_common()
    ]


def without_numbers(reason: str) -> str:
    """Return a reason with each number as #, so that reasons which differ in them alone are one kind."""
    out, digits = [], False
    for character in reason:
        if character.isdigit():
            if not digits:
                out.append("#")
            digits = True
        elif not (digits and character == "."):
            digits = False
            out.append(character)
    return "".join(out)


def _group(settings: dict[str, Any], members: Sequence[Mapping[str, Any]], figures: Sequence[str]) -> GroupRow:
    told = {}
    for name in figures:
        values = [float(row[name]) for row in members if row[name] is not None]
        if values:
            low, middle, high = np.percentile(values, [5, 50, 95]).tolist()
            told[name] = (low, middle, high)
    return GroupRow(settings, len(members), dict(Counter(str(row["verdict"]) for row in members)), told)


def report_json(groups: Sequence[GroupRow], failed: Sequence[Failure]) -> str:
    """Return both as one JSON object."""
    told = {
        "groups": [
            {"settings": g.settings, "runs": g.runs, "verdicts": g.verdicts, "p5_p50_p95": g.figures} for g in groups
        ],
        "failures": [{"verdict": f.verdict, "reason": f.reason, "runs": f.runs, "example": f.example} for f in failed],
    }
    return json.dumps(told)
