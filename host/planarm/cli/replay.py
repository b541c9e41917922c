"""`planarm replay RUN`: what a run sent, played into the emulated board; the same edges come out."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from planarm.cli.scenes import tell_first_compile
from planarm.errors import StepsDifferError


def execute(options: argparse.Namespace) -> int:
    """Replay, and hold the pins against those of the run where its folder has them."""
    tell_first_compile("planarm_sim")
    from planarm.link.journal import read_journal
    from planarm.link.replay import replay
    from planarm.streaming.plan_stream import JOURNAL_NAME

    folder = Path(options.run)
    journal = read_journal(folder / JOURNAL_NAME)
    played = replay(journal, Path(options.firmware) if options.firmware else None)
    trace = folder / "trace.vcd"
    differences = played.differences(trace) if trace.exists() else []
    if options.vcd:
        played.line.pins.write_vcd(Path(options.vcd))
    told: dict[str, object] = {
        "edges": played.edges(),
        "compared_with": str(trace) if trace.exists() else None,
        "differences": differences,
        "same_replies": played.same_replies,
    }
    print(json.dumps(told) if options.json else _words(told))
    return StepsDifferError.exit_code if differences else 0


def _words(told: dict[str, object]) -> str:
    edges = told["edges"]
    assert isinstance(edges, dict)
    counts = ", ".join(f"{pin} {count}" for pin, count in edges.items())
    verdict = "no waveforms to compare with" if told["compared_with"] is None else "the same edges as in the run"
    if told["differences"]:
        verdict = "\n".join(map(str, told["differences"] if isinstance(told["differences"], list) else ()))
    replies = "the same replies to the byte" if told["same_replies"] else "other replies"
    return f"edges: {counts}\n{verdict}; {replies}"
