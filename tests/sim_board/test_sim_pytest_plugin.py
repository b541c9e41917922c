"""The pytest plugin, on test runs made for the purpose, in processes of their own."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from planarm_wire.kernel_cache import CACHE_DIR_VARIABLE, kernel_folders

pytest_plugins = ["pytester"]

CACHE = next(iter(kernel_folders("planarm_sim").values())).parents[
    2
]  # pytester gives its processes a home of their own

DATA = Path(__file__).parent / "data"
PULSES, ECHO = DATA / "pulses.hex", DATA / "echo.hex"


@pytest.fixture
def trial(pytester, monkeypatch):
    """Run tests with the plugin alone: none of this environment's others."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setenv(CACHE_DIR_VARIABLE, str(CACHE))

    def run(source, *options, ini=""):
        pytester.makepyfile(test_board=source)
        pytester.makeini(f"[pytest]\n{ini}")
        return pytester.runpytest_subprocess("-p", "planarm_sim.pytest_plugin", "--strict-markers", *options)

    return run


def test_marked_tests_get_their_boards_and_failed_ones_tell_where_they_left_what_they_did(trial, pytester):
    (pytester.path / "echo.hex").write_bytes(ECHO.read_bytes())
    result = trial(
        f"""
        import pytest

        @pytest.mark.uno(firmware="echo.hex", baud=125_000)
        def test_echo(uno, make_uno):
            assert uno.serial.baud == 125_000
            uno.run(seconds=0.01)
            second = make_uno(baud=250_000)
            assert (second.cycle, second.serial.baud) == (0, 250_000)
            second.run_until(b"R\\x01", limit_s=0.01)

        @pytest.mark.uno(firmware="echo.hex")
        @pytest.mark.parametrize("name", ["a/b"])
        def test_fails(uno, make_uno, name):
            uno.run(seconds=0.001)
            uno.serial.write(b"A")
            uno.run(seconds=0.01)
            second = make_uno({str(PULSES)!r})
            second.observe()
            second.run(cycles=4000)
            assert uno.serial.read() == b"R\\x01A"

        def test_runs_nothing(uno):
            pass
        """
    )
    result.assert_outcomes(passed=1, failed=1, errors=1)
    result.stdout.fnmatch_lines(["*test_runs_nothing asks for an Uno, and nothing says what it runs: mark the test*"])
    (folder,) = (pytester.path / "uno-artefacts").iterdir()
    assert folder.name == "test_board.py_test_fails_a_b"
    result.stdout.fnmatch_lines(
        ["*emulated Uno*", f"*pins.vcd, serial.csv, pins-2.vcd, profile-2.json, serial-2.csv*kept in {folder}"]
    )
    log = (folder / "serial.csv").read_text().splitlines()
    assert log[0] == "start_cycle,end_cycle,start_us,direction,byte,character"
    assert [line.split(",")[3:] for line in log[1:]] == [
        ["from board", "0x52", "R"],
        ["from board", "0x01", ""],
        ["to board", "0x41", "A"],
        ["from board", "0x42", "B"],
    ]
    assert int(log[3].split(",")[1]) == int(log[3].split(",")[0]) + 640, "ten bits at 250,000 baud"
    assert json.loads((folder / "profile-2.json").read_text())["cycles"] >= 4000
    assert (folder / "pins-2.vcd").read_text().startswith("$comment")


@pytest.mark.parametrize("options", [[], [f"--uno-firmware={PULSES}", "--uno-artefacts=kept"]])
def test_options_and_before_them_the_configuration_name_program_and_folder(trial, pytester, options):
    source = "def test_fails(uno):\n    uno.run(cycles=4000)\n    assert len(uno.edges('D9')) == -1"
    result = trial(source, *options, ini=f"uno_firmware = {ECHO}\nuno_artefacts = there")
    result.assert_outcomes(failed=1)
    (folder,) = (pytester.path / ("kept" if options else "there")).iterdir()
    assert {path.name for path in folder.iterdir()} == {"pins.vcd", "serial.csv"}
    result.stdout.fnmatch_lines(["*assert 4 == -1*" if options else "*assert 0 == -1*"])


def test_the_plugin_alone_does_not_load_the_compiler():
    program = "import sys, planarm_sim.pytest_plugin; print('numba' in sys.modules)"
    shown = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert shown.stdout.strip() == "False"
