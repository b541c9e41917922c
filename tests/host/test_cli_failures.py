"""Whatever goes wrong on the command line is one sentence and the right exit code: files, readers, keyboard, words."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from planarm.cli import main as command_line
from planarm.cli import plan as plan_command
from planarm.cli import run as run_command
from planarm.cli.main import main

CASE_1 = Path(__file__).resolve().parents[2] / "examples" / "table1_case1.toml"


def leave(capsys, *words):
    with pytest.raises(SystemExit) as left:
        main(list(map(str, words)))
    captured = capsys.readouterr()
    return left.value.code, captured.out, captured.err


def changed_scene(tmp_path, *changes):
    text = CASE_1.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    scene = tmp_path / "scene.toml"
    scene.write_text(text)
    return scene


@pytest.mark.parametrize("target", ["", "none/x.plan"], ids=["a folder", "in a folder that is not there"])
def test_a_plan_that_cannot_be_written_is_told_before_planning(capsys, tmp_path, monkeypatch, target):
    monkeypatch.setattr("planarm.warm_up.warm_up", lambda: pytest.fail("work was begun for nothing"))
    code, out, err = leave(capsys, "plan", CASE_1, "-o", tmp_path / target)
    assert (code, out) == (2, "")
    assert str(tmp_path) in err and "cannot be written" in err


def test_nothing_moves_when_the_run_folder_cannot_be_made(capsys, tmp_path, monkeypatch):
    """A report that fails after minutes of motion has lost what the motion was for."""
    monkeypatch.setattr("planarm.pipeline.open_transport", lambda *_: pytest.fail("the port was opened"))
    taken = tmp_path / "taken"
    taken.write_text("")
    code, out, _ = leave(capsys, "run", CASE_1, "--out", taken, "--json")
    error = json.loads(out)["error"]
    assert code == error["exit_code"] == 2
    assert error["kind"] == "OutputError" and str(taken) in error["message"]


@pytest.mark.parametrize("content", [None, b"\xff\xfe", b"{", b"[]", b'{"format": 1000}'])
def test_what_is_no_plan_is_bad_input(capsys, tmp_path, content):
    target = tmp_path / "x.plan"
    if content is not None:
        target.write_bytes(content)
    code, out, err = leave(capsys, "stream", target)
    assert (code, out) == (2, "")
    assert str(target) in err


def test_wrong_words_with_json_are_one_object(capsys):
    code, out, _ = leave(capsys, "plan", CASE_1, "-o", "x.plan", "--seed", "many", "--json")
    error = json.loads(out)["error"]
    assert code == error["exit_code"] == 2
    assert "--seed" in error["message"] and "--help" in error["message"]


def test_the_keyboard_with_json_is_one_object(capsys, monkeypatch):
    def interrupted(_options):
        raise KeyboardInterrupt

    monkeypatch.setattr(plan_command, "execute", interrupted)
    code, out, _ = leave(capsys, "plan", CASE_1, "-o", "x.plan", "--json")
    error = json.loads(out)["error"]
    assert code == error["exit_code"] == 130, "what shells report of SIGINT"
    assert error["kind"] == "Stopped"


def test_an_empty_port_is_not_the_scenes(capsys, tmp_path):
    """A script's unset variable must not start the emulator in place of the arm."""
    code, out, _ = leave(capsys, "run", CASE_1, "--port", "", "--out", tmp_path)
    assert (code, out) == (5, "")


def test_brackets_in_a_folders_name_are_no_markup(capsys):
    """rich reads [/x] as the end of a style, and fails when none began."""
    run_command._print({"scene": "x"}, Path("out [/x]"))
    assert "out [/x]" in capsys.readouterr().out


def test_a_reader_that_leaves_early_is_no_traceback():
    read, write = os.pipe()
    os.close(read)
    told = f"import planarm.cli.main as m; m._run = lambda _: print('x' * 100_000); m.main([{str(CASE_1)!r}])"
    done = subprocess.run([sys.executable, "-c", told], stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (command_line.STOPPED_READING, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, a disk without room")
def test_a_full_disk_behind_stdout_is_a_sentence():
    told = "import planarm.cli.main as m; m._run = lambda _: print('x') or 0; m.main([])"
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([sys.executable, "-c", told], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "planarm: stdout: No space left on device\n"


def test_a_motion_of_hours_is_refused_before_it_fills_the_memory(capsys, tmp_path):
    """At 0.0001 deg/s case 1 takes weeks; the certificate's dense grid would take terabytes."""
    scene = changed_scene(tmp_path, ("max_speed_deg_s = 114.59155902616465", "max_speed_deg_s = 0.0001"))
    code, _, err = leave(capsys, "plan", scene, "-o", tmp_path / "x.plan")
    assert code == 4
    assert "600 s" in err and "max_speed_deg_s" in err


def test_a_goal_that_is_the_start_is_done_at_once(capsys, tmp_path):
    scene = changed_scene(tmp_path, ("goal_cm = [1, 45]", "goal_cm = [49, 2]"))
    code, out, _ = leave(capsys, "run", scene, "--out", tmp_path / "out", "--json")
    told = json.loads(out)
    assert (code, told["segments"], told["net_usteps"], told["steps_at_pins"]) == (0, 0, [0, 0], [0, 0])


def test_a_disk_that_gets_full_in_a_motion_is_told_with_what_the_arm_does(capsys, tmp_path, monkeypatch):
    written, write = [], os.write

    def cut(file, data):
        written.append(len(data))
        return write(file, data if len(written) < 120 else data[:1])

    monkeypatch.setattr("planarm.link.journal.os.write", cut)
    code, _, err = leave(capsys, "run", CASE_1, "--out", tmp_path / "out")
    assert code == 2
    assert "run.journal: only 1 of" in err and "make room on the disk" in err
    assert "rests there; the board knows where: 'planarm status'" in err
