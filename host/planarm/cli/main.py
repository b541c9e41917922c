"""`planarm`: parses its words, runs the command's own file, and tells what went wrong."""

from __future__ import annotations

import importlib
import json
import os
import sys
from collections.abc import Sequence

from planarm.cli.commands import build_parser
from planarm.errors import OutputError, PlanarmError, UsageError

STOPPED_READING = 141
"""What a shell reports of a program that a closed pipe has ended."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command and leave with its exit code."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        code = _run(words)
        if sys.stdout is not None:  # closed by whoever started us
            sys.stdout.flush()
    except BrokenPipeError:  # the reader, such as head, has seen enough; a file's errors carry its name
        code = _leave_quietly(STOPPED_READING)
    except OSError as error:
        print(f"planarm: stdout: {error.strerror or error}", file=sys.stderr)
        code = _leave_quietly(OutputError.exit_code)
    sys.exit(code)


def _run(words: Sequence[str]) -> int:
    """Run the command that the words ask for; return its exit code."""
    as_json = "--json" in words
    try:
        parser = build_parser()
        if not words:
            parser.print_help(sys.stderr)
            return UsageError.exit_code
        options = parser.parse_args(words)
        command = importlib.import_module(f"planarm.cli.{options.command}")
        return int(command.execute(options))
    except PlanarmError as error:
        report_error(error, as_json)
        return error.exit_code
    except KeyboardInterrupt:
        report_error(Stopped("stopped by the keyboard"), as_json)
        return Stopped.exit_code


def _leave_quietly(code: int) -> int:
    """Give stdout up, so that the interpreter does not try to write to it again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


class Stopped(PlanarmError):  # noqa: N818 - not an error
    """Ctrl-C."""

    exit_code = 130


def report_error(error: PlanarmError, as_json: bool) -> None:
    """Print the error where its reader looks: one JSON object on stdout, or a sentence on stderr."""
    if as_json:
        print(json.dumps({"error": error.told()}))
    else:
        print(f"planarm: {error}", file=sys.stderr)
        for note in getattr(error, "__notes__", ()):
            print(f"  {note}", file=sys.stderr)
        if error.code:
            print(f"  'planarm explain {error.code}' tells more", file=sys.stderr)
        if error.advice:
            print("What would help:", *(f"  - {sentence}" for sentence in error.advice), sep="\n", file=sys.stderr)
