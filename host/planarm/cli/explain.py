"""`planarm explain [CODE]`: what an error, a check, a fault or a refusal means, and what helps."""

from __future__ import annotations

import argparse
import json
import textwrap
from dataclasses import asdict

from planarm.explain import explain, explanations

WIDTH = 100


def execute(options: argparse.Namespace) -> int:
    """Print one explanation, or every code with its title."""
    if options.code is None:
        listed = explanations().values()
        if options.json:
            print(json.dumps({"codes": [asdict(one) for one in listed]}))
        else:
            print(*(f"{one.code:5} {one.title}" for one in listed), sep="\n")
        return 0
    told = explain(options.code)
    if options.json:
        print(json.dumps(asdict(told)))
    else:
        print(f"{told.code}: {told.title}\n")
        print(*_lines("cause", told.cause), *_lines("fix", told.fix), sep="\n")
    return 0


def _lines(name: str, text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=f"{name + ':':8}", subsequent_indent=8 * " ")
