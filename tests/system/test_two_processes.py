"""Host and emulator in two processes, joined by a real pseudo-terminal and pyserial."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from planarm.plan_file import load_plan
from planarm.stepping.expand import expand
from planarm_sim.trace import read_vcd

ROOT = Path(__file__).resolve().parents[2]
CASE1 = str(ROOT / "examples/table1_case1.toml")
LIMIT_S = 120


def command(*words):
    return [sys.executable, "-c", "from planarm.cli.main import main; main()", *words]


def planarm(folder, *words):
    """Run a command in the folder to its end."""
    return subprocess.run(command(*words), capture_output=True, text=True, cwd=folder, timeout=LIMIT_S, check=False)


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
        ran = planarm(tmp_path, "run", CASE1, "--port", str(link), "--at-start", "--json", "--out", "out")
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


@pytest.mark.skipif(sys.platform != "linux", reason="DTR stays up by a setting that Linux keeps with the port")
def test_a_killed_run_is_resumed_by_another_process_and_no_step_is_lost(tmp_path):
    """SIGKILL in the middle: the board comes to rest on the path, and the second program finds it where it is."""
    link, trace = tmp_path / "uno", tmp_path / "trace.vcd"
    emulator = subprocess.Popen(
        command("emulate", "--link", str(link), "--vcd", str(trace)), stdout=subprocess.PIPE, text=True, cwd=tmp_path
    )
    try:
        emulator.stdout.readline()
        words = ("run", CASE1, "--port", str(link), "--at-start", "--out", "out")
        with subprocess.Popen(command(*words), stderr=subprocess.PIPE, text=True, cwd=tmp_path) as run:
            said = []
            for line in run.stderr:
                said.append(line)
                if line.startswith("stream: 25 %"):
                    run.kill()
                    break
            assert said[-1].startswith("stream: 25 %"), said
        resumed = planarm(tmp_path, "resume", "out", "--json")
    finally:
        emulator.send_signal(signal.SIGINT)
        rest = emulator.communicate(timeout=LIMIT_S)[0]
    assert resumed.returncode == 0, resumed.stderr
    verdict = json.loads(resumed.stdout)
    assert verdict["verdict"] == "exact", verdict
    assert 0 < verdict["executed_segments"][0] < verdict["total_segments"]
    assert emulator.returncode == 0, rest
    planned = expand(load_plan(tmp_path / "out" / "run.plan").segments)
    assert [count_rises(trace, pin) for pin in ("D9", "D10")] == [len(joint.ticks) for joint in planned.steps]


def count_rises(trace, pin):
    return int((read_vcd(trace).edges[pin]["level"] == 1).sum())
