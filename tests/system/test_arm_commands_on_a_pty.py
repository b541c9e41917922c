"""Zero, goto, jog, home and stop, each a program of its own, on an emulated arm behind a pseudo-terminal."""

import json
import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="DTR stays up by a setting that Linux keeps")

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 180
SWITCHES = """
[[limit_switches]]
joint = 1
pin = "A1"
at_deg = 56
side = "above"
[[limit_switches]]
joint = 2
pin = "A2"
at_deg = -67
side = "below"
"""


def command(*words):
    return [sys.executable, "-c", "from planarm.cli.main import main; main()", *map(str, words)]


@contextmanager
def emulated(folder, scene):
    """An emulator process around the scene's arm; gives what starts programs on its port."""
    link = folder / "uno"
    environment = os.environ | {"PLANARM_STATE": str(folder / "state")}
    emulator = subprocess.Popen(
        command("emulate", "--scene", scene, "--link", link), stdout=subprocess.PIPE, text=True, cwd=folder
    )
    try:
        assert emulator.stdout.readline().startswith("/dev/")

        def start(*words):
            return subprocess.Popen(
                command(*words, "--port", link),
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                cwd=folder,
                env=environment,
            )

        yield start
    finally:
        emulator.send_signal(signal.SIGINT)
        emulator.communicate(timeout=LIMIT_S)


def told(program):
    out, err = program.communicate(timeout=LIMIT_S)
    assert program.returncode == 0, err
    return json.loads(out)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "switched.toml"
    path.write_text((ROOT / "examples/sweeps/short_move.toml").read_text() + SWITCHES)
    return path


def test_zero_goto_jog_and_home_know_where_the_arm_is_from_one_program_to_the_next(tmp_path, scene):
    with emulated(tmp_path, scene) as start:
        zeroed = told(start("zero", scene, "--json"))
        assert zeroed["known_by"] == "zeroed"
        went = told(start("goto", scene, 38, 21, "--json"))
        assert went["tip_cm"] == pytest.approx([38.0, 21.0], abs=0.02)
        assert any(went["moved_usteps"])
        jogged = told(start("jog", scene, 2, "-3", "--json"))
        assert jogged["joints_deg"][1] == pytest.approx(went["joints_deg"][1] - 3.0, abs=0.03)
        assert jogged["moved_usteps"][0] == 0
        asked = told(start("status", scene, "--json"))
        assert (asked["usteps"], asked["known_by"]) == (jogged["usteps"], "zeroed")
        homed = told(start("home", scene, "--json"))
        assert homed["known_by"] == "homed"
        assert homed["joints_deg"] == pytest.approx([56.0, -67.0], abs=0.5)
        back = told(start("goto", scene, 42, 12, "--json"))
        assert back["usteps"] == pytest.approx(zeroed["usteps"], abs=8), "switches and zero agree"


@pytest.mark.usefixtures("ctrl_c")
def test_stop_asks_the_program_that_has_the_port_and_the_arm_rests_on_its_path(tmp_path):
    """A slow motion, so that the second program comes in time on any machine."""
    scene = tmp_path / "slow.toml"
    text = (ROOT / "examples/sweeps/short_move.toml").read_text()
    scene.write_text(text.replace("max_speed_deg_s = 110", "max_speed_deg_s = 3"))
    with emulated(tmp_path, scene) as start:
        run = start("run", scene, "--at-start", "--out", "out")
        said = []
        for line in run.stderr:
            said.append(line)
            if line.startswith("stream: 25 %"):
                break
        assert said[-1].startswith("stream: 25 %"), said
        stopped = told(start("stop", "--json"))
        _, rest = run.communicate(timeout=LIMIT_S)
        assert stopped["let_go"]
        assert f"process {run.pid}" in stopped["asked"][0]
        assert run.returncode == 5
        assert "stopped as asked" in " ".join(rest.split())
        assert "position exact" in " ".join(rest.split())
        status = told(start("status", scene, "--json"))
        state, wiring = status["board"]["state"], status["wiring"]
        assert state in ("ready", "idle")
        assert wiring["known_by"] == ("the scene" if state == "idle" else "the image")
        assert wiring["pins"]["joint 1"] == "STEP D9, DIR D4"
        resumed = start("resume", "out", "--json")
        out, err = resumed.communicate(timeout=LIMIT_S)
        assert resumed.returncode == 0, err
        assert json.loads(out)["verdict"] == "exact"
