"""Completion scripts: every command and option of the parser is in them, and bash does what it is told."""

import os
import pty
import select
import shutil
import subprocess
import time

import pytest

from planarm.cli.commands import build_parser
from planarm.cli.completion import SCRIPTS, commands_of
from planarm.cli.main import main

COMMANDS = commands_of(build_parser())
HOMELESS = {"PATH": os.environ["PATH"], "HOME": "/nonexistent", "TERM": "dumb", "LANG": "C.UTF-8"}
PATIENCE_S = 30.0


class ZshScreen:
    """An interactive zsh at a pseudo-terminal."""

    def __init__(self, folder):
        self._master, slave = pty.openpty()
        self._shell = subprocess.Popen(
            ["zsh", "-f", "-i"],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            cwd=folder,
            env=HOMELESS,
            start_new_session=True,
        )
        os.close(slave)
        self._seen = ""

    def type(self, keys):
        """Forget what was seen, and type."""
        self._seen = ""
        os.write(self._master, keys.encode())

    def wait_for(self, text):
        """Wait until the screen has shown a text."""
        end_s = time.monotonic() + PATIENCE_S
        while text not in self._seen:
            assert time.monotonic() < end_s, self._seen
            if select.select([self._master], [], [], 0.1)[0]:
                self._seen += os.read(self._master, 4096).decode(errors="replace")

    def close(self):
        """End it."""
        self._shell.kill()
        self._shell.wait()
        os.close(self._master)


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


OFFERED = [
    ("planarm expl", {"explain"}),
    ("planarm run --pla", {"--planner"}),
    ("planarm run --space ", {"tip", "joint"}),
    ("planarm emulate --speed r", {"real"}),
    ("planarm completion f", {"fish"}),
    ("planarm run examples/ca", {"case.toml"}),
]


@pytest.fixture
def folder(tmp_path):
    """Where the shells look for files, and their script."""
    (tmp_path / "examples").mkdir()
    (tmp_path / "examples" / "case.toml").touch()
    return tmp_path


@pytest.mark.parametrize(("line", "offered"), OFFERED)
def test_bash_offers_what_fits(line, offered, folder):
    if shutil.which("bash") is None:
        pytest.skip("bash is not installed here")
    words = line.split(" ")
    asked = " ".join(f"'{word}'" for word in words)
    script = SCRIPTS["bash"](COMMANDS)
    script += f'COMP_WORDS=({asked}); COMP_CWORD={len(words) - 1}; _planarm; printf "%s\\n" "${{COMPREPLY[@]}}"\n'
    done = subprocess.run(["bash"], input=script, text=True, stdout=subprocess.PIPE, check=True, cwd=folder)
    assert {word.rsplit("/", 1)[-1] for word in done.stdout.split()} == offered


@pytest.mark.parametrize(("line", "offered"), OFFERED)
def test_fish_offers_what_fits(line, offered, folder):
    if shutil.which("fish") is None:
        pytest.skip("fish is not installed here")
    (folder / "planarm.fish").write_text(SCRIPTS["fish"](COMMANDS))
    asked = f'source planarm.fish; complete -C "{line}"'
    done = subprocess.run(
        ["fish", "--no-config", "-c", asked], text=True, stdout=subprocess.PIPE, check=True, cwd=folder, env=HOMELESS
    )
    assert {told.split("\t")[0].rsplit("/", 1)[-1] for told in done.stdout.splitlines()} == offered


@pytest.mark.parametrize("installed", ["sourced", "in fpath"])
@pytest.mark.parametrize(("line", "offered"), OFFERED)
def test_zsh_offers_what_fits(line, offered, folder, installed):
    """Zsh completes at a terminal only, so it is given one, with a key that shows what the line has become."""
    if shutil.which("zsh") is None:
        pytest.skip("zsh is not installed here")
    (folder / "_planarm").write_text(SCRIPTS["zsh"](COMMANDS))
    load = "source ./_planarm" if installed == "sourced" else ":"
    screen = ZshScreen(folder)
    screen.type(f"fpath=($PWD $fpath); autoload -Uz compinit; compinit -u -D; {load}; print -r ready:$?\r")
    screen.wait_for("ready:0")
    screen.type(line + "\t")
    for word in offered:
        screen.wait_for(word)
    screen.close()
