"""The command line parses and prints: exit codes, JSON on stdout alone, and nothing heavy for --help."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from planarm.cli.main import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
HEAVY = ("numpy", "numba", "scipy", "matplotlib", "rich", "serial", "planarm_sim")


def leave(capsys, *words):
    with pytest.raises(SystemExit) as left:
        main(list(words))
    captured = capsys.readouterr()
    return left.value.code, captured.out, captured.err


def test_help_loads_nothing_heavy():
    told = "import sys, planarm.cli.main as m; m.build_parser().format_help(); "
    told += f"print([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", told], stdout=subprocess.PIPE, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_help_names_every_command_and_exit_code(capsys):
    code, out, _ = leave(capsys, "--help")
    assert code == 0
    assert all(word in out for word in ("plan", "run", "stream", "emulate", "7 executed steps differ"))


def test_an_unknown_scene_is_bad_input(capsys, tmp_path):
    code, out, err = leave(capsys, "run", str(tmp_path / "none.toml"))
    assert (code, out) == (2, "")
    assert "none.toml" in err


def test_an_error_with_json_is_one_object_on_stdout(capsys, tmp_path):
    broken = tmp_path / "broken.toml"
    broken.write_text((EXAMPLES / "table1_case1.toml").read_text().replace("link_width_cm", "link_widht_cm"))
    code, out, _ = leave(capsys, "run", str(broken), "--json")
    error = json.loads(out)["error"]
    assert code == error["exit_code"] == 2
    assert "link_width_cm" in error["message"], "the closest known key is named"


def test_a_wall_across_the_way_is_exit_code_3(capsys, tmp_path):
    """A radial wall at 45 degrees, from 15 to 52 cm, stops link 1 (30 cm) on its way from 11.5 to 109.4 degrees."""
    text = (EXAMPLES / "table1_case1.toml").read_text()
    wall = '[[obstacles]]\nshape = "polygon"\nvertices_cm = [[11, 10], [37, 36], [36, 37], [10, 11]]\n'
    scene = tmp_path / "walled.toml"
    scene.write_text(text.replace("[task]", wall + "\n[task]"))
    code, out, _ = leave(capsys, "plan", str(scene), "-o", str(tmp_path / "x.plan"), "--json")
    assert code == 3, out
    assert not (tmp_path / "x.plan").exists()


def test_either_elbow_takes_the_shorter_way(capsys, tmp_path):
    text = (EXAMPLES / "table1_case1.toml").read_text()
    lengths = {}
    for elbow in ("up", "down", "either"):
        scene = tmp_path / f"{elbow}.toml"
        scene.write_text(text.replace('elbow = "up"', f'elbow = "{elbow}"'))
        code, out, _ = leave(capsys, "plan", str(scene), "-o", str(tmp_path / "x.plan"), "--json")
        if code == 0:
            told = json.loads(out)
            lengths[elbow] = told["path_length_cm"]
            assert told["path_bound_cm"] <= told["path_length_cm"]
            assert told["path_gap_percent"] == pytest.approx(
                100 * (told["path_length_cm"] / told["path_bound_cm"] - 1), abs=1e-4
            )
    assert lengths["either"] == min(lengths.values())


def test_an_unreachable_port_is_exit_code_5(capsys, tmp_path):
    code, _, err = leave(
        capsys, "run", str(EXAMPLES / "table1_case1.toml"), "--port", str(tmp_path / "tty"), "--out", str(tmp_path)
    )
    assert code == 5
    assert str(tmp_path / "tty") in err


def test_plan_then_stream_through_the_emulator(capsys, tmp_path):
    target = tmp_path / "case2.plan"
    code, out, _ = leave(capsys, "plan", str(EXAMPLES / "table1_case2.toml"), "-o", str(target), "--json")
    assert code == 0, out
    code, out, _ = leave(capsys, "stream", str(target), "--json")
    assert code == 0, out
    assert all(isinstance(steps, int) for steps in json.loads(out)["moved_usteps"])


def test_a_changed_plan_is_not_streamed(capsys, tmp_path):
    target = tmp_path / "case1.plan"
    leave(capsys, "plan", str(EXAMPLES / "table1_case1.toml"), "-o", str(target))
    body = json.loads(target.read_text())
    body["segments"][0][0] += 2
    target.write_text(json.dumps(body))
    code, _, err = leave(capsys, "stream", str(target))
    assert code == 4
    assert "SHA-256" in err


def test_emulate_has_an_arm_around_the_board_and_tells_what_faults_did(capsys, tmp_path):
    """The released firmware keeps its drivers off until it is told otherwise: a bump moves the arm, and is told."""
    faults = tmp_path / "bump.toml"
    bump = 'kind = "mechanics.bump"\njoint = 1\ntorque_nm = 0.03\nat_s = 0.05\nfor_s = 0.1\n'
    faults.write_text(f'zero = "power_up"\n[[faults]]\n{bump}')
    code, out, _ = leave(capsys, "emulate", "--json", "--speed", "max", "--seconds", "0.3", "--faults", str(faults))
    assert code == 0
    bench = json.loads(out)["bench"]
    assert [line.split(": ")[1] for line in bench["faults"]] == ["mechanics.bump begins", "mechanics.bump ends"]
    assert len(bench["counts"]) == 2


def test_faults_around_another_program_want_a_scene(capsys, tmp_path):
    code, _, err = leave(capsys, "emulate", "--firmware", "other.hex", "--faults", str(tmp_path / "any.toml"))
    assert code == 2
    assert "--faults needs drivers and an arm around the board: give --scene FILE" in err


def test_a_run_that_fails_prints_the_line_that_replays_it(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenarios = EXAMPLES.parent / "tests" / "scenarios"
    words = (
        "run",
        str(scenarios / "arm.toml"),
        "--faults",
        str(scenarios / "mechanics_stall.toml"),
        "--fault-seed",
        "3",
    )
    code, out, err = leave(capsys, *words)
    assert code == 7
    replay = next(line for line in err.splitlines() if "replay: " in line).partition("replay: ")[2]
    program, *again = shlex.split(replay)
    assert program == "planarm"
    assert [without_remaining_time(part) for part in leave(capsys, *again)[1:]] == [out, without_remaining_time(err)]


def without_remaining_time(text):
    """The wall's clock is not the same twice, and only a first run compiles."""
    return re.sub(r"about \d+\.\d s left|^Compiling .*\n", "", text, flags=re.M)
