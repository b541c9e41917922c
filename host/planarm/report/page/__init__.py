"""Self-contained pages: one HTML file with its style, its code and its data, which loads nothing from anywhere.

Style and code are the files beside this one, written by hand; data are the record of a run (`planarm.record`). The same
record gives the same page, byte by byte.
"""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any, Final

RUN_STYLES: Final = ("base.css", "run.css")
RUN_CODE: Final = ("dom.js", "plot.js", "workspace.js", "player.js", "events.js", "tables.js", "run.js")
LIVE_STYLES: Final = ("base.css", "run.css", "live.css")
LIVE_CODE: Final = ("dom.js", "plot.js", "workspace.js", "live.js")
TIMING_STYLES: Final = ("base.css", "timing.css")
TIMING_CODE: Final = ("dom.js", "plot.js", "events.js", "timing.js")


def run_page(record: Mapping[str, Any]) -> str:
    """Return the page of a run.

    Args:
        record: what `planarm.record.run_record` returns, or read from a run's record.json.
    """
    return page(f"{record['title']} – planarm", record, RUN_STYLES, RUN_CODE)


def live_page(record: Mapping[str, Any]) -> str:
    """Return the page of a run that is going on; it asks its own server for news.

    Args:
        record: what `planarm.record.run_record.plan_record` returns.
    """
    return page(f"{record['title']} – planarm live", record, LIVE_STYLES, LIVE_CODE, connect="'self'")


def timing_page(record: Mapping[str, Any]) -> str:
    """Return the page of a timing report.

    Args:
        record: what `planarm.report.timing.timing_record` returns.
    """
    return page(f"{record['title']} – planarm timing", record, TIMING_STYLES, TIMING_CODE)


def page(
    title: str, record: Mapping[str, Any], styles: Sequence[str], code: Sequence[str], *, connect: str = "'none'"
) -> str:
    """Return a page of the house's files around a record.

    Args:
        title: of the page, any text.
        record: its data, JSON's values.
        styles: style sheets beside this file, in order.
        code: scripts beside this file, in order.
        connect: whom the page may ask: nobody, or 'self', its own server.
    """
    parts = {
        "connect": connect,
        "title": html.escape(title),
        "css": "\n".join(_read(name) for name in styles),
        "js": "\n".join(_read(name) for name in code),
        # Within a script only "<" can end it early; as an escape it means the same to JSON.
        "record": json.dumps(record, separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace(
            "<", "\\u003c"
        ),
    }
    pieces = _read("page.html").split("@")
    return "".join(parts[piece] if n % 2 else piece for n, piece in enumerate(pieces))


def _in_a_script(record: Mapping[str, Any]) -> str:
    """Return JSON that no script element ends early: a "<" is told as an escape, which means the same."""
    told = json.dumps(record, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return told.replace("<", "\\u003c")


def _read(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
