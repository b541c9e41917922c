"""`planarm completion SHELL`: a completion script for bash, zsh or fish, made from the command line's own parser."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Option:
    """An option: its spellings, what it is for, whether a value follows, and which values there are, if few."""

    flags: tuple[str, ...]
    purpose: str
    takes_value: bool
    values: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Command:
    """A command: its name, what it is for, its options, and the words that may stand without one, if few."""

    name: str
    purpose: str
    options: tuple[Option, ...]
    words: tuple[str, ...]


def execute(options: argparse.Namespace) -> int:
    """Print the script."""
    from planarm.cli.commands import build_parser

    print(SCRIPTS[options.shell](commands_of(build_parser())), end="")
    return 0


def commands_of(parser: argparse.ArgumentParser) -> tuple[Command, ...]:
    """Return every command of a parser; argparse shows its actions under this name since it exists."""
    [subparsers] = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    purposes = {choice.dest: choice.help or "" for choice in subparsers._choices_actions}
    return tuple(_command(name, purposes[name], inner) for name, inner in subparsers.choices.items())


def _command(name: str, purpose: str, parser: argparse.ArgumentParser) -> Command:
    options = tuple(_option(action) for action in parser._actions if action.option_strings)
    words = [str(word) for action in parser._actions if not action.option_strings for word in action.choices or ()]
    return Command(name, purpose, options, tuple(words))


def _option(action: argparse.Action) -> Option:
    values = tuple(str(choice) for choice in action.choices or ())
    return Option(tuple(action.option_strings), action.help or "", action.nargs != 0, values)


def bash(commands: tuple[Command, ...]) -> str:
    """Return the script for bash: options after a dash, known values after their option, files otherwise."""
    cases, values = [], []
    for command in commands:
        flags = " ".join(flag for option in command.options for flag in option.flags)
        cases.append(f'    {command.name}) flags="{flags}"; words="{" ".join(command.words)}" ;;')
        for option in command.options:
            if option.values:
                flags_of = "|".join(f"{command.name}:{flag}" for flag in option.flags)
                values.append(f'    {flags_of}) _planarm_of "{" ".join(option.values)}"; return ;;')
    return BASH.format(
        commands=" ".join(command.name for command in commands), values="\n".join(values), cases="\n".join(cases)
    )


def zsh(commands: tuple[Command, ...]) -> str:
    """Return the script for zsh."""
    names = "\n".join(f"    {_quoted(f'{c.name}:{c.purpose}')}" for c in commands)
    cases = []
    for command in commands:
        specs = [spec for option in command.options for spec in _zsh_option(option)]
        words = f"*:word:({' '.join(command.words)})" if command.words else "*:file:_files"
        cases.append("    " + " \\\n      ".join([f"{command.name}) _arguments", *specs, _quoted(words)]) + " ;;")
    return ZSH.format(commands=names, cases="\n".join(cases))


def fish(commands: tuple[Command, ...]) -> str:
    """Return the script for fish."""
    names = " ".join(command.name for command in commands)
    lines = ["# fish completion for planarm"]
    for command in commands:
        alone = f"-n 'not __fish_seen_subcommand_from {names}'"
        lines.append(f"complete -c planarm -f {alone} -a {command.name} -d {_quoted(command.purpose)}")
        within = f"-n '__fish_seen_subcommand_from {command.name}'"
        if command.words:
            lines.append(f"complete -c planarm -f {within} -a {_quoted(' '.join(command.words))}")
        for option in command.options:
            flags = " ".join(f"-l {f[2:]}" if f.startswith("--") else f"-s {f[1:]}" for f in option.flags)
            value = " -r" if option.takes_value else ""
            value += f" -f -a {_quoted(' '.join(option.values))}" if option.values else ""
            lines.append(f"complete -c planarm {within} {flags}{value} -d {_quoted(option.purpose)}")
    return "\n".join(lines) + "\n"


def _zsh_option(option: Option) -> list[str]:
    told = option.purpose.replace("[", "(").replace("]", ")").replace(":", "\\:")
    value = f":value:({' '.join(option.values)})" if option.values else ":value:_files" if option.takes_value else ""
    return [_quoted(f"{flag}[{told}]{value}") for flag in option.flags]


def _quoted(text: str) -> str:
    """Return a word in single quotes for any of the shells."""
    return "'" + text.replace("'", "'\\''") + "'"


BASH = """\
# bash completion for planarm
_planarm_of() {{
  COMPREPLY=($(compgen -W "$1" -- "$now"))
}}
_planarm() {{
  local now="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" command="${{COMP_WORDS[1]}}"
  local flags words
  if [ "$COMP_CWORD" -eq 1 ]; then
    _planarm_of "{commands} --help --version"
    return
  fi
  case "$command:$before" in
{values}
  esac
  case "$command" in
{cases}
  esac
  case "$now:$words" in
    -*) _planarm_of "$flags" ;;
    *:?*) _planarm_of "$words" ;;
    *) COMPREPLY=($(compgen -f -- "$now")) ;;
  esac
}}
complete -o filenames -F _planarm planarm
"""

ZSH = """\
#compdef planarm
# zsh completion for planarm
_planarm() {{
  local -a commands
  commands=(
{commands}
  )
  if (( CURRENT == 2 )); then
    _describe command commands
    return
  fi
  shift words
  (( CURRENT-- ))
  case $words[1] in
{cases}
  esac
}}
if [ "$funcstack[1]" = "_planarm" ]; then  # called from a folder of $fpath
  _planarm "$@"
else
  compdef _planarm planarm
fi
"""

SCRIPTS: Mapping[str, Callable[[tuple[Command, ...]], str]] = {"bash": bash, "zsh": zsh, "fish": fish}
