"""Every block of docs/emulator.md runs as printed."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from planarm_sim.loader import load_hex
from planarm_wire import messages
from planarm_wire.kernel_cache import CACHE_DIR_VARIABLE, kernel_folders

pytest_plugins = ["pytester"]

ROOT = Path(__file__).parents[2]
CACHE = next(iter(kernel_folders("planarm_sim").values())).parents[2]  # pytester's processes have a home of their own
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", (ROOT / "docs" / "emulator.md").read_text(), re.S)
PYTHON = [text for kind, text in BLOCKS if kind == "python" and not text.startswith("# test_")]
TESTS = [text for kind, text in BLOCKS if kind == "python" and text.startswith("# test_")]
COMMANDS = [line for kind, text in BLOCKS if kind == "console" for line in text.splitlines()]


def test_there_is_no_block_of_another_kind():
    assert {kind for kind, _ in BLOCKS} == {"python", "console"}
    assert (len(PYTHON), len(TESTS), len(COMMANDS)) == (2, 1, 2)


def test_the_python_blocks_run_one_after_the_other(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    scope: dict[str, object] = {}
    for block in PYTHON:
        exec(compile(block, "docs/emulator.md", "exec"), scope)
    welcome, status = scope["replies"]
    assert isinstance(welcome, messages.Welcome)
    assert welcome.host_nonce == 7
    assert welcome.spec_hash == messages.SPEC_HASH
    assert isinstance(status, messages.Status)
    assert status.state == messages.State.READY
    assert scope["enabled_at"] > 0
    assert len(scope["intervals"]) >= scope["received"].count
    assert "100% awake" in capsys.readouterr().out


def test_the_tests_pass(pytester, monkeypatch):
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setenv(CACHE_DIR_VARIABLE, str(CACHE))
    (pytester.path / "firmware").symlink_to(ROOT / "firmware")
    (block,) = TESTS
    pytester.makepyfile(test_board=block)
    pytester.makeini("[pytest]")
    result = pytester.runpytest_subprocess("-p", "planarm_sim.pytest_plugin", "--strict-markers")
    result.assert_outcomes(passed=2)


@pytest.mark.parametrize("line", COMMANDS)
def test_the_commands_do_what_they_say(line, tmp_path):
    (tmp_path / "firmware").symlink_to(ROOT / "firmware")
    program, *arguments = shlex.split(line)
    needed = [Path(word) for word in arguments if word.startswith("/")]
    if program != "python" and (shutil.which(program) is None or not all(path.exists() for path in needed)):
        pytest.skip(f"{program}, or {needed}, is missing (Debian: binutils-avr, arduino-core-avr)")
    command = [sys.executable if program == "python" else program, *arguments]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=120)
    made = {path.name for path in tmp_path.iterdir()} - {"firmware"}
    if program == "python":
        assert made == {"wave.vcd", "line.csv", "profile.json"}, "the link is gone at the end"
    else:
        assert made == {"optiboot_1k.hex"}
        assert load_hex(tmp_path / "optiboot_1k.hex").flash[0x7C00] != 0xFF
