"""The command line's parser: errors are told like all others and say what was meant; the help has commands by use."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from textwrap import fill
from typing import Any, NoReturn, TypeAlias

from planarm.errors import UsageError

EXIT_CODES = """exit codes:
  0 ok    2 bad input    3 no path    4 cannot be timed or certified
  5 link    6 device fault    7 executed steps differ from the plan"""

LEAST_TERMINAL = 79
"""Columns that every terminal shows without a break."""

TRY_IT = """try it:
  planarm run examples/table1_case1.toml       on the emulated Uno; writes out/table1_case1-chs/report.html
  planarm COMMAND --help                       what a command takes
"""

USES = {
    "plan and run": ("plan", "run", "stream", "replan", "resume", "stop"),
    "look at what happened": ("report", "timing", "dump", "replay", "explain"),
    "a real board and its arm": (
        "doctor",
        "flash",
        "setup",
        "calibrate",
        "status",
        "home",
        "zero",
        "jog",
        "goto",
    ),
    "the emulated board": ("emulate",),
    "many runs, and science": ("envelope", "sweep", "campaign", "compare"),
    "the shell": ("completion",),
}
"""Every command under what it is for, in the order in which a person meets them."""


class Parser(argparse.ArgumentParser):
    """A parser that keeps the exit codes' table as it is."""

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - handed on as they are
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **settings)

    def parse_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]  # noqa: ANN401 - argparse's own types
        """Parse; words that nothing takes are refused by the command's own parser, which knows what was meant."""
        known, rest = self.parse_known_args(args, namespace)
        if rest:
            self._of(known.command).refuse(rest)
        return known

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """Say that nothing takes these words, and what was meant.

        Raises:
            UsageError: always.
        """
        wrong = next((word for word in words if word.startswith("-")), words[0])
        if not wrong.startswith("-"):
            self.error(f"nothing takes {wrong!r}")
        name = wrong.split("=")[0]
        self.error(f"there is no option {name}{meant(name, self._option_string_actions)}")

    def error(self, message: str) -> NoReturn:
        """Raise what argparse found as this project's own error.

        Raises:
            UsageError: always.
        """
        raise UsageError(f"{message}; '{self.prog} --help' tells what there is")

    def format_help(self) -> str:
        """Return the help; that of the whole program has its commands by use."""
        if not self._commands():
            return super().format_help()
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        told = {one.dest: one for one in self._commands()[0]._choices_actions}
        for use, names in USES.items():
            formatter.start_section(use)
            formatter.add_arguments([told[name] for name in names])
            formatter.end_section()
        formatter.add_text(TRY_IT)
        formatter.add_text(self.epilog)
        return formatter.format_help()

    def _check_value(self, action: argparse.Action, value: Any) -> None:  # noqa: ANN401 - argparse's own type
        if action.choices is None or value in action.choices:
            return
        if isinstance(action, argparse._SubParsersAction):
            self.error(f"there is no command {value!r}{meant(value, action.choices)}")
        choices = ", ".join(map(str, action.choices))
        raise argparse.ArgumentError(action, f"{value!r} is none of {choices}{meant(value, action.choices)}")

    def _commands(self) -> list[argparse._SubParsersAction[Parser]]:
        return [action for action in self._actions if isinstance(action, argparse._SubParsersAction)]

    def _of(self, command: str) -> Parser:
        return self._commands()[0].choices[command]


Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


def add_command(commands: Commands, name: str, purpose: str, details: str = "") -> Parser:
    """Add a command, whose own page begins with what it is for and ends with the exit codes.

    Args:
        commands: those of the program.
        name: the command's.
        purpose: what it is for, as the list of all commands says.
        details: what its own page says instead, a line for each paragraph.
    """
    paragraphs = (details or f"{purpose[0].upper()}{purpose[1:]}.").splitlines()
    about = "\n".join(fill(paragraph, LEAST_TERMINAL, break_on_hyphens=False) for paragraph in paragraphs)
    return commands.add_parser(name, help=purpose, description=about, epilog=EXIT_CODES)


def meant(word: str, known: Iterable[str]) -> str:
    """Return a question for what was probably meant; nothing when nothing is near."""
    [nearest] = get_close_matches(str(word), [str(one) for one in known], n=1) or [""]
    return f"; did you mean {nearest}?" if nearest else ""
