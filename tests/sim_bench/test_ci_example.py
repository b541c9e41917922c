"""The example project for somebody else's firmware: it builds, its tests pass, and a failure leaves what one needs."""

import json
import shutil
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "ci_for_your_firmware"

pytestmark = pytest.mark.skipif(shutil.which("avr-g++") is None, reason="builds a sketch: needs gcc-avr and avr-libc")


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of the example, built."""
    folder = tmp_path_factory.mktemp("example") / "project"
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("build", "uno-artefacts", "__pycache__"))
    subprocess.run(["make", "all"], cwd=folder, check=True, capture_output=True)
    return folder


def run_tests(project, *words):
    plugin = () if entry_points(group="pytest11", name="planarm") else ("-p", "planarm_sim.pytest_plugin")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *plugin, *words]
    return subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)


def test_its_tests_pass(project):
    done = run_tests(project)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed" in done.stdout


def test_of_a_failed_test_waveforms_report_and_motion_are_kept(project):
    test = project / "tests" / "test_failing.py"
    test.write_text(
        "import pytest\n"
        '@pytest.mark.uno(firmware="../build/buggy.elf")\n'
        '@pytest.mark.bench(drivers=[{"driver": "a4988", "step": "D2", "direction": "D5", "microsteps": 16}])\n'
        "def test_it(bench):\n"
        "    bench.run(seconds=0.05)\n"
        "    assert bench.report().clean\n"
    )
    done = run_tests(project, "tests/test_failing.py")
    test.unlink()
    assert done.returncode == 1
    (kept,) = (project / "uno-artefacts").iterdir()
    assert {"pins.vcd", "serial.csv", "bench.json", "motion.csv"} <= {path.name for path in kept.iterdir()}
    assert json.loads((kept / "bench.json").read_text())["violations"][0]["rule"] == "step_high"
    assert (kept / "motion.csv").read_text().startswith("t_s,q1_rad,rotor1_rad\n")


def test_the_docs_show_what_the_example_is():
    text = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")
    block = text[text.index("```python") : text.index("```", text.index("```python") + 3)].splitlines()[1:]
    assert len(block) <= 20
    example = (EXAMPLE / "tests" / "test_sketch.py").read_text(encoding="utf-8")
    for line in block:
        if line.startswith(("DRIVER", "@pytest.mark.bench")):
            assert line in example
