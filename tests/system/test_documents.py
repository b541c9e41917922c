"""Every command of README and tutorial: the parser takes all of them, and all that need no board are run."""

import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest

from documents import Typed, Written, instructions
from planarm.cli.commands import build_parser
from planarm.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
README, TUTORIAL = ROOT / "README.md", ROOT / "docs" / "tutorial.md"
PARSED_ONLY = [ROOT / "docs" / name for name in ("board.md", "live.md")]
"""They need a board, or somebody who watches."""
BOARD = "/dev/tty"


def typed(document):
    return [one.line for one in instructions(document) if isinstance(one, Typed)]


@pytest.mark.parametrize("document", [README, TUTORIAL, *PARSED_ONLY], ids=lambda p: p.stem)
def test_the_command_line_takes_every_command(document):
    lines = typed(document)
    assert lines
    for line in lines:
        words = shlex.split(line)
        if words[0] == "planarm":
            build_parser().parse_args(words[1:])
        else:
            assert words[0] == "./dev"
            subprocess.run([sys.executable, ROOT / "dev", words[1], "--help"], check=True, stdout=subprocess.DEVNULL)


def test_the_tutorial_does_what_it_says(tmp_path, monkeypatch, capsys, pytestconfig):
    """In its order, in an empty folder; the runs, and what looks at their results, with --full."""
    monkeypatch.chdir(tmp_path)
    full = pytestconfig.getoption("--full")
    done = 0
    for one in instructions(TUTORIAL):
        if isinstance(one, Written):
            text = (tmp_path / one.continues).read_text() + one.text if one.continues else one.text
            (tmp_path / one.name).write_text(text)
            continue
        words = shlex.split(one.line)
        if words[0] != "planarm" or "/tmp/uno" in one.line or (not full and ("run" in words or "out/" in one.line)):
            continue
        with pytest.raises(SystemExit) as left:
            main(words[1:])
        assert left.value.code == one.exit_code, (one.line, capsys.readouterr().err)
        done += 1
    assert done >= (6 if full else 3)
    assert not full or (tmp_path / "out" / "my_arm" / "timing.html").is_file()


def test_the_two_terminals_of_the_tutorial_meet(tmp_path, pytestconfig):
    if not pytestconfig.getoption("--full"):
        pytest.skip("a board in real time; --full runs it, and tests/system/test_two_processes.py does the same")
    [arm] = [one for one in instructions(TUTORIAL) if isinstance(one, Written) and one.name == "my_arm.toml"]
    (tmp_path / arm.name).write_text(arm.text)
    port = tmp_path / "uno"
    lines = [line.replace("/tmp/uno", str(port)) for line in typed(TUTORIAL) if "/tmp/uno" in line]
    planarm = str(Path(sys.executable).parent / "planarm")
    board, host = ([planarm, *shlex.split(line)[1:]] for line in lines)
    with subprocess.Popen(board, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as emulator:
        try:
            for _ in range(600):
                if port.exists():
                    break
                time.sleep(0.1)
            ran = subprocess.run([*host, "--json"], check=False, cwd=tmp_path, stdout=subprocess.PIPE, timeout=120)
        finally:
            emulator.terminate()
    assert ran.returncode == 0, ran.stdout


def test_what_the_readme_runs_without_a_board_runs(tmp_path, monkeypatch, pytestconfig):
    """With --full: all of README's commands but those for a real board, a second terminal and this test itself."""
    if not pytestconfig.getoption("--full"):
        pytest.skip("--full runs them")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for line in typed(README):
        words = shlex.split(line)
        if words[0] != "planarm" or any(name in line for name in (BOARD, "/tmp/uno", "SCENE", "wave.vcd")):
            continue
        with pytest.raises(SystemExit) as left:
            main(words[1:])
        assert left.value.code == 0, line


def test_the_readmes_python_runs(tmp_path, monkeypatch, capsys):
    """With the released image in the place of the reader's."""
    [snippet] = [text.split("```")[0] for text in README.read_text().split("```python\n")[1:]]
    released = ROOT / "firmware" / "release" / "uno.hex"
    monkeypatch.chdir(tmp_path)
    exec(compile(snippet.replace("your_firmware.hex", str(released)), "README.md", "exec"), {})
    assert capsys.readouterr().out.count("\n") >= 2
