"""Host and emulator in two processes, joined by a real pseudo-terminal and pyserial."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from planarm_sim.trace import read_vcd

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 120


def command(*words):
    return [sys.executable, "-c", "from planarm.cli.main import main; main()", *words]


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals need a POSIX system")
def test_run_streams_through_a_pty_to_the_emulator(tmp_path):
    link, trace = tmp_path / "uno", tmp_path / "trace.vcd"
    emulator = subprocess.Popen(
        command("emulate", "--link", str(link), "--vcd", str(trace)), stdout=subprocess.PIPE, text=True, cwd=tmp_path
    )
    try:
        first_line = emulator.stdout.readline()
        assert first_line.startswith("/dev/"), first_line
        assert link.resolve() == Path(first_line.strip())
        ran = subprocess.run(
            command("run", str(ROOT / "examples/table1_case1.toml"), "--port", str(link), "--json", "--out", "out"),
            capture_output=True,
            text=True,
            cwd=tmp_path,
            timeout=LIMIT_S,
            check=False,
        )
    finally:
        emulator.send_signal(signal.SIGINT)
        rest = emulator.communicate(timeout=LIMIT_S)[0]
    assert ran.returncode == 0, ran.stderr
    summary = json.loads(ran.stdout)
    assert summary["steps_at_pins"] is None, "another process's pins cannot be seen from here"
    assert emulator.returncode == 0, rest
    assert not link.exists(), "the emulator takes its link away"
    assert count_rises(trace, "D9") == summary["steps_planned"][0]
    assert count_rises(trace, "D10") == summary["steps_planned"][1]


def count_rises(trace, pin):
    return int((read_vcd(trace).edges[pin]["level"] == 1).sum())
