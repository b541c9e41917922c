"""Summaries as tables for the terminal."""

# ruff: noqa: PLC0415 - rich is imported by those who print a table

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from rich.table import Table

UNITS: Final = {
    "cm": "cm",
    "mm": "mm",
    "rad": "rad",
    "deg": "°",
    "s": "s",
    "ms": "ms",
    "us": "µs",
    "hz": "Hz",
    "ticks": "ticks",
    "usteps": "micro-steps",
    "bytes": "bytes",
    "percent": "%",
    "ppm": "ppm",
}
"""Units by the last word of a key."""
RATES: Final = {"s": "/s", "s2": "/s²"}
"""What a key's last word says behind a unit, as in `bytes_s`."""


def summary_table(summary: Mapping[str, Any], title: str | None = None) -> Table:
    """Return a two-column table of a summary: names in words, values with the units of their keys.

    The unit is the key's last word, as in `path_length_cm`, or its last two, as in `line_asked_bytes_s`. Mappings
    inside are flattened. Entries of a list stand on one line with slashes between, or on a line each where they are
    mappings. None reads "not measured", truth values "yes" or "no", the latter in red.
    """
    from rich import box
    from rich.table import Table

    table = Table(title=title, box=box.SIMPLE_HEAD, show_header=False, title_justify="left", pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in _rows(summary, ""):
        table.add_row(name, value)
    return table


VERDICT_STYLES: Final = {"green": "green", "amber": "yellow", "red": "bold red"}


def certificate_table(checks: Sequence[Mapping[str, Any]], title: str | None = None) -> Table:
    """Return a certificate as a table: each check with its verdict, value, limit, place, and what to change.

    Args:
        checks: mappings with name, value, limit, unit, verdict, where and setting.
        title: above the table.
    """
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False, padding=(0, 1, 0, 0))
    for name, style in (("", ""), ("check", ""), ("value", ""), ("limit", "dim"), ("where", "dim"), ("change", "dim")):
        table.add_column(name, style=style, justify="right" if name in ("value", "limit") else "left", overflow="fold")
    for check in checks:
        verdict = str(check["verdict"])
        unit = f" {check['unit']}" if check["unit"] else ""
        table.add_row(
            f"[{VERDICT_STYLES[verdict]}]{verdict}[/]",
            escape(str(check["name"])),
            f"{float(check['value']):.5g}{unit}",
            f"{float(check['limit']):.5g}",
            escape(str(check["where"])),
            escape(str(check["setting"])) if verdict != "green" else "",
        )
    return table


def _rows(summary: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, str]]:
    for key, value in summary.items():
        words = str(key).split("_")
        if isinstance(value, Mapping):
            yield from _rows(value, f"{prefix}{' '.join(words)}: ")
            continue
        name, unit = _name_and_unit(words)
        yield prefix + name, _text(value, unit)


def _name_and_unit(words: Sequence[str]) -> tuple[str, str]:
    """Part a key's words; a key that is a unit alone is a name."""
    if len(words) > 2 and words[-1] in RATES and words[-2] in UNITS:
        return " ".join(words[:-2]), UNITS[words[-2]] + RATES[words[-1]]
    if len(words) > 1 and words[-1] in UNITS:
        return " ".join(words[:-1]), UNITS[words[-1]]
    return " ".join(words), ""


def _text(value: Any, unit: str) -> str:  # noqa: ANN401 - a summary holds whatever JSON holds
    from rich.markup import escape

    if value is None:
        return "[dim]not measured[/dim]"
    if isinstance(value, bool):
        return "yes" if value else "[bold red]no[/bold red]"
    text = _list(value) if isinstance(value, (list, tuple)) else _number(value)
    return escape(f"{text} {unit}".strip() if text else "none")


def _list(values: Sequence[Any]) -> str:
    """Return numbers side by side, and mappings a line each, such as ``joint 1, limit speed, share of time 0.6``."""
    if not any(isinstance(value, Mapping) for value in values):
        return " / ".join(map(_number, values))
    lines = [[f"{str(key).replace('_', ' ')} {_number(one)}" for key, one in value.items()] for value in values]
    return "\n".join(", ".join(line) for line in lines)


def _number(value: object) -> str:
    """Return whole numbers with thousands apart, others with six digits that count, anything else as it is."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Integral):
        return f"{int(value):,}"
    if isinstance(value, Real):
        return f"{float(value):.6g}"
    return str(value)
