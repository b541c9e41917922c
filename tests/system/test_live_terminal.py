"""`planarm run --live terminal`: keys in a terminal start, hold and resume a run, such as over SSH."""

import os
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PLANARM = Path(sys.executable).parent / "planarm"
WAIT_S = 60.0

pty = pytest.importorskip("pty", reason="a pseudo-terminal is a POSIX system's")


class Screen:
    """What a terminal was told so far, and its keyboard."""

    def __init__(self, fd):
        self.fd, self.text = fd, ""

    def wait_for(self, words):
        until = time.monotonic() + WAIT_S
        while words not in self.text:
            assert time.monotonic() < until, f"{words!r} never came: {self.text[-500:]!r}"
            if select.select([self.fd], [], [], 0.1)[0]:
                self.text += os.read(self.fd, 4096).decode(errors="replace")
        self.text = self.text[self.text.index(words) :]

    def press(self, key):
        os.write(self.fd, key.encode())


def test_keys_start_hold_and_resume_a_run(tmp_path):
    scene = tmp_path / "slow.toml"
    text = (ROOT / "tests" / "scenarios" / "arm.toml").read_text()
    scene.write_text(text.replace("max_speed_deg_s = 110", "max_speed_deg_s = 15"))
    ours, theirs = pty.openpty()
    command = [PLANARM, "run", scene, "--out", tmp_path / "out", "--live", "terminal", "--json"]
    with subprocess.Popen(command, stdin=theirs, stderr=theirs, stdout=subprocess.PIPE) as run:
        os.close(theirs)
        screen = Screen(ours)
        screen.wait_for("waiting for the start")
        screen.press("\r")
        screen.wait_for("running")
        screen.press("h")
        screen.wait_for("held")
        screen.press("r")
        screen.wait_for("running")
        screen.wait_for("done")
        assert run.wait(timeout=WAIT_S) == 0
        run.stdout.read()
    os.close(ours)
    assert (tmp_path / "out" / "report.html").is_file()


def test_without_a_terminal_it_says_what_is_missing(tmp_path):
    command = [PLANARM, "run", ROOT / "tests" / "scenarios" / "arm.toml", "--out", tmp_path, "--live", "terminal"]
    done = subprocess.run(command, check=False, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert "needs a terminal" in done.stderr
