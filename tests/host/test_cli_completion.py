"""Completion scripts: every command and option of the parser is in them, and bash does what it is told."""

import shutil
import subprocess

import pytest

from planarm.cli.completion import SCRIPTS, commands_of
from planarm.cli.main import build_parser, main

COMMANDS = commands_of(build_parser())


@pytest.mark.parametrize("shell", SCRIPTS)
def test_every_command_and_option_is_there(shell, capsys):
    with pytest.raises(SystemExit) as left:
        main(["completion", shell])
    script = capsys.readouterr().out
    assert left.value.code == 0
    assert {"run", "plan", "timing", "explain"} <= {command.name for command in COMMANDS}
    for command in COMMANDS:
        assert command.name in script
        for option in command.options:
            for flag in option.flags:
                assert (f"-l {flag[2:]}" if shell == "fish" and flag.startswith("--") else flag.lstrip("-")) in script


@pytest.mark.parametrize("shell", SCRIPTS)
def test_the_shell_takes_the_script(shell):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed here")
    script = SCRIPTS[shell](COMMANDS)
    subprocess.run([shell, "-n"], input=script, text=True, check=True)


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["planarm", "pl"], {"plan"}),
        (["planarm", "run", "--pla"], {"--planner"}),
        (["planarm", "run", "--space", ""], {"tip", "joint"}),
        (["planarm", "emulate", "--speed", "r"], {"real"}),
        (["planarm", "completion", "f"], {"fish"}),
    ],
)
def test_bash_offers_what_fits(words, offered):
    if shutil.which("bash") is None:
        pytest.skip("bash is not installed here")
    asked = " ".join(f"'{word}'" for word in words)
    script = SCRIPTS["bash"](COMMANDS)
    script += f'COMP_WORDS=({asked}); COMP_CWORD={len(words) - 1}; _planarm; printf "%s\\n" "${{COMPREPLY[@]}}"\n'
    done = subprocess.run(["bash"], input=script, text=True, stdout=subprocess.PIPE, check=True)
    assert set(done.stdout.split()) == offered
