"""`planarm dump FILE`: a run's journal, or the bytes that a host sent, as readable messages."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from planarm.errors import JournalError


def execute(options: argparse.Namespace) -> int:
    """Print one line a message, and what they add up to."""
    from planarm.link.dump import Dump, Line, stream_lines
    from planarm.link.journal import MAGIC, read_journal
    from planarm.streaming.plan_stream import JOURNAL_NAME

    path = Path(options.file)
    path = path / JOURNAL_NAME if path.is_dir() else path
    dump = Dump()
    if _begins_with(path, MAGIC):
        journal = read_journal(path)
        lines = list(dump.lines(journal.records))
        if journal.torn:
            lines.append(Line(None, "--", "the last record was cut short: its bytes were not sent"))
    else:
        lines = list(stream_lines(path.read_bytes(), dump))
    if not lines:
        raise JournalError(f"{path}: is no journal and has no message in it; give a run's folder, or bytes of the line")
    if options.json:
        print(json.dumps(dump.figures.figures()))
        return 0
    for line in lines:
        print(line)
    for name, value in dump.figures.figures().items():
        print(f"{name}: {value}")
    return 0


def _begins_with(path: Path, magic: bytes) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(magic)) == magic
    except OSError as error:
        raise JournalError(f"{path}: cannot be read: {error.strerror}; give a run's folder or a byte stream") from error
