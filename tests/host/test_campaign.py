"""Campaigns: every run leaves one row whatever happens to its worker, and the same rows however they were run."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from planarm.campaign.engine import LocalEngine
from planarm.campaign.line_faults import FAULTS, damaged
from planarm.campaign.run import run_campaign
from planarm.campaign.spec import load_campaign
from planarm.campaign.store import JOINED, ResultStore, read_rows
from planarm.campaign.task import SceneText
from planarm.campaign.work import run_kind, scene_of
from planarm.campaign.worker import started_deaf_to_ctrl_c
from planarm.cli.main import main
from planarm.errors import SceneError, UsageError

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def written(tmp_path, text):
    (tmp_path / "scene.toml").write_text((EXAMPLES / "table1_case1.toml").read_text())
    path = tmp_path / "campaign.toml"
    path.write_text(text)
    return path


def self_test(tmp_path, deeds, count=6, limits="task_s = 30", batch=4):
    return load_campaign(
        written(
            tmp_path,
            f'kind = "self-test"\nscenes = ["scene.toml"]\nbatch = {batch}\n[limits]\n{limits}\n'
            f"[vary]\ndo = {json.dumps(deeds)}\nseed = {{ first = 1, count = {count} }}\n",
        )
    )


def quiet(_progress):
    pass


def rows_of(table):
    return sorted(pq.read_table(table).to_pylist(), key=lambda row: row["number"])


def same(rows):
    return [{k: v for k, v in row.items() if not k.startswith("took")} for row in rows]


def test_each_run_leaves_one_row_with_its_settings_and_figures(tmp_path):
    campaign = self_test(tmp_path, ["answer"])
    outcome = run_campaign(campaign, LocalEngine(1), tmp_path / "out", False, quiet)
    rows = rows_of(outcome.table)
    assert [(row["number"], row["set.seed"], row["square"]) for row in rows] == [
        (n, n + 1, (n + 1) ** 2) for n in range(6)
    ]
    assert outcome.verdicts == {"ok": 6} and outcome.whole
    assert {row["image_sha256"] for row in rows} and all(row["code"] for row in rows)


def test_a_crash_a_hang_a_hog_and_an_exception_are_one_failed_row_each(tmp_path):
    deeds = ["answer", "raise", "crash", "hang", "hog"]
    campaign = self_test(tmp_path, deeds, count=1, limits="task_s = 4\nmemory_mb = 4000", batch=3)
    rows = rows_of(run_campaign(campaign, LocalEngine(2), tmp_path / "out", False, quiet).table)
    assert [row["verdict"] for row in rows] == ["ok", "failed", "failed", "failed", "failed"]
    reasons = [row["reason"] for row in rows]
    assert reasons[1] == "RuntimeError: run 1 was asked to raise"
    assert "a crash, or out of memory" in reasons[2]
    assert "longer than limits.task_s = 4 s" in reasons[3]
    assert reasons[4].startswith("MemoryError")


def test_rows_are_the_same_whatever_the_workers_and_batches(tmp_path):
    first = run_campaign(self_test(tmp_path, ["answer", "raise"]), LocalEngine(1), tmp_path / "a", False, quiet)
    other = replace(self_test(tmp_path, ["answer", "raise"]), batch=1)
    second = run_campaign(other, LocalEngine(2), tmp_path / "b", False, quiet)
    assert same(rows_of(first.table)) == same(rows_of(second.table))


class Interrupted(LocalEngine):
    """An engine that Ctrl-C stops after two batches."""

    def run(self, batches):
        for count, rows in enumerate(super().run(batches)):
            if count == 2:
                raise KeyboardInterrupt
            yield rows


def test_a_stopped_campaign_keeps_what_finished_and_resume_runs_the_rest_once(tmp_path):
    campaign = self_test(tmp_path, ["answer"], count=12, batch=2)
    stopped = run_campaign(campaign, Interrupted(1), tmp_path / "out", False, quiet)
    assert not stopped.whole and stopped.verdicts == {"ok": 4}
    with pytest.raises(UsageError, match="holds results already; --resume"):
        run_campaign(campaign, LocalEngine(1), tmp_path / "out", False, quiet)
    resumed = run_campaign(campaign, LocalEngine(1), tmp_path / "out", True, quiet)
    assert (resumed.before, resumed.verdicts) == (4, {"ok": 8})
    assert [row["number"] for row in rows_of(resumed.table)] == list(range(12))


def test_results_of_another_campaign_are_not_mixed_in(tmp_path):
    run_campaign(self_test(tmp_path, ["answer"]), LocalEngine(1), tmp_path / "out", False, quiet)
    with pytest.raises(UsageError, match="holds results of another size, spec_sha256"):
        run_campaign(self_test(tmp_path, ["answer"], count=7), LocalEngine(1), tmp_path / "out", True, quiet)


def test_a_killed_process_leaves_whole_rows_that_resume_completes(tmp_path):
    """The parent dies without a word; what it had finished is there, and nothing twice."""
    written(
        tmp_path,
        'kind = "self-test"\nscenes = ["scene.toml"]\nbatch = 1\n[vary]\nseed = { first = 0, count = 400 }\n',
    )
    command = [
        str(Path(sys.executable).with_name("planarm")),
        "campaign",
        "campaign.toml",
        "--out",
        "out",
        "--workers",
        "1",
    ]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL, start_new_session=True) as process:
        deadline = time.monotonic() + 60
        while len(list((tmp_path / "out").glob("part-*.parquet"))) < 3 and time.monotonic() < deadline:
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGKILL)
    found = read_rows(tmp_path / "out")
    assert found is not None and 3 <= len(found) < 400
    campaign = load_campaign(tmp_path / "campaign.toml")
    campaign = replace(campaign, batch=50)
    table = run_campaign(replace(campaign, source="campaign.toml"), LocalEngine(1), tmp_path / "out", True, quiet).table
    assert [row["set.seed"] for row in rows_of(table)] == list(range(400))


def test_rows_that_ctrl_c_finds_written_and_not_counted_are_told(tmp_path, monkeypatch):
    add = ResultStore.add

    def written_then_interrupted(self, rows, scenes):
        add(self, rows, scenes)
        raise KeyboardInterrupt

    monkeypatch.setattr(ResultStore, "add", written_then_interrupted)
    campaign = self_test(tmp_path, ["answer", "raise"])
    stopped = run_campaign(campaign, LocalEngine(1), tmp_path / "out", False, quiet)
    assert sum(stopped.verdicts.values()) == len(rows_of(stopped.table)) > 0


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_with_130_and_keeps_what_finished(tmp_path):
    written(
        tmp_path,
        'kind = "self-test"\nscenes = ["scene.toml"]\nbatch = 1\n[vary]\nseed = { count = 100_000 }\n',
    )
    command = [str(Path(sys.executable).with_name("planarm")), "campaign", "campaign.toml", "--out", "out"]
    with subprocess.Popen(
        [*command, "--workers", "1"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    ) as process:  # fmt: skip
        deadline = time.monotonic() + 60
        while len(list((tmp_path / "out").glob("part-*.parquet"))) < 3 and time.monotonic() < deadline:
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers, too
        told, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    found = rows_of(tmp_path / "out" / JOINED)
    assert 3 <= len(found) < 100_000
    assert f"{100_000 - len(found)} runs are missing, --resume goes on with them" in told


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_while_workers_start_is_one_sentence(tmp_path):
    written(tmp_path, 'kind = "self-test"\nscenes = ["scene.toml"]\n[vary]\nseed = { count = 100_000 }\n')
    command = [str(Path(sys.executable).with_name("planarm")), "campaign", "campaign.toml", "--out", "out"]
    with subprocess.Popen(
        [*command, "--workers", "2"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    ) as process:  # fmt: skip
        assert process.stderr is not None
        assert any(line.startswith("0 of") for line in process.stderr)
        os.killpg(process.pid, signal.SIGINT)
        told, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in said
    if (tmp_path / "out" / JOINED).exists():  # the first batch was faster
        finished = len(rows_of(tmp_path / "out" / JOINED))
        assert f"{100_000 - finished} runs are missing, --resume goes on with them" in told
    else:
        assert "stopped by the keyboard" in said


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot keep a signal back")
@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_in_the_moment_a_worker_starts_is_kept_and_the_worker_does_not_hear_it():
    heard = "import signal; print(signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, []))"
    told = ""
    with pytest.raises(KeyboardInterrupt), started_deaf_to_ctrl_c():
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        told = subprocess.run([sys.executable, "-c", heard], stdout=subprocess.PIPE, text=True, check=True).stdout
    assert told.strip() == "False"
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_settings_go_into_the_scene_and_wrong_ones_are_told(tmp_path):
    scene = SceneText("scene.toml", (EXAMPLES / "table1_case1.toml").read_text())
    changed = scene_of(scene, {"planner.seed": 7, "workspace.cell_cm": 0.5, "joints.2.gear_ratio": 4, "seed": 1})
    assert (changed.planner.seed, changed.workspace.cell_cm, changed.joints[1].gear_ratio) == (7, 0.5, 4.0)
    with pytest.raises(SceneError, match=r"planner\.sede: unknown key"):
        scene_of(scene, {"planner.sede": 7})
    with pytest.raises(SceneError, match=r"joints\.3\.gear_ratio: '3' is no entry; there are 2"):
        scene_of(scene, {"joints.3.gear_ratio": 4})


def test_a_map_run_tells_what_is_free_whatever_the_cell(tmp_path):
    """Shares of the plane: they hardly change with the cell's size, the number of nodes grows with its square."""
    scene = SceneText("scene.toml", (EXAMPLES / "table1_case1.toml").read_text())
    coarse, fine = (run_kind("map", scene, {"workspace.cell_cm": cell}, {})[2] for cell in (1.0, 0.5))
    assert fine["nodes"] / coarse["nodes"] == pytest.approx(4.0, rel=0.05)
    for share in ("free_share", "obstacle_share"):
        assert fine[share] == pytest.approx(coarse[share], abs=0.02)
    assert coarse["free_nodes"] == round(coarse["free_share"] * coarse["nodes"])
    assert coarse["whole_share"] < fine["whole_share"] < fine["free_share"]


@pytest.mark.parametrize("kind", ["search", "plan"])
def test_planning_runs_tell_their_figures(kind):
    scene = SceneText("scene.toml", (EXAMPLES / "table1_case1.toml").read_text())
    verdict, reason, figures = run_kind(kind, scene, {"planner.algorithm": "a_star", "planner.neighbours": 8}, {})
    assert (verdict, reason) == ("ok", "")
    assert figures["length_cm"] > 60.0
    blocked = {"task.goal_cm": [-0.0, 5.0]}
    verdict, reason, _ = run_kind("search", scene, blocked, {})
    assert verdict == "no path" and reason


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("kind = 'search'\n", "scenes: None given, a list of scene files expected"),
        ("kind = 'walk'\nscenes = ['scene.toml']\n", "kind: 'walk' given, one of"),
        ("kind = 'search'\nscenes = ['none.toml']\n", "none.toml cannot be read"),
        (
            "kind = 'search'\nscenes = ['scene.toml']\n[vary]\n'planner.seed' = 3\n",
            "a list, or { first = 0, count = 100 }",
        ),
        ("kind = 'search'\nscenes = ['scene.toml']\n[vary]\nseed = {count = 0}\n", "vary.seed.count: 0 given"),
        ("kind = 'search'\nscenes = ['scene.toml']\n[options]\nseconds = 1\n", "options.seconds: unknown key"),
        ("kind = 'line'\nscenes = ['scene.toml']\n[options]\nseconds = -1\n", "options.seconds: -1 given"),
        ("kind = ", "is not valid TOML"),
    ],
)
def test_a_wrong_file_is_one_sentence(text, said, tmp_path):
    with pytest.raises(SceneError) as told:
        load_campaign(written(tmp_path, text))
    assert said in str(told.value)


@pytest.mark.parametrize("fault", FAULTS)
def test_damage_hits_one_place_as_its_kind_says(fault):
    import random  # noqa: PLC0415

    sent = tuple((1000 * n, bytes(range(10 * n, 10 * n + 10))) for n in range(6))
    whole = b"".join(data for _, data in sent)
    for seed in range(200):
        got = b"".join(data for _, data in damaged(sent, fault, random.Random(seed)))
        if fault == "none":
            assert got == whole
            continue
        same_head = next(
            (n for n, (a, b) in enumerate(zip(got, whole, strict=False)) if a != b), min(len(got), len(whole))
        )
        change = len(got) - len(whole)
        if fault == "cut":
            assert got == whole[: len(got)] and change < 0
        elif fault == "flip":
            assert change == 0 and 1 <= sum(a != b for a, b in zip(got, whole, strict=True)) <= 16
        elif fault == "drop":
            assert -16 <= change < 0 and got[same_head:] == whole[same_head - change :]
        else:
            assert change > 0 and got.endswith(whole[max(same_head, 50) :])


def leave(capsys, *words):
    with pytest.raises(SystemExit) as left:
        main(list(map(str, words)))
    told = capsys.readouterr()
    return left.value.code, told.out, told.err


def test_the_command_runs_repeats_one_and_reports(tmp_path, capsys):
    path = written(
        tmp_path,
        'name = "both"\nkind = "search"\nscenes = ["scene.toml"]\n[vary]\n"planner.algorithm" = ["chaos_a_star"]\n'
        '"planner.neighbours" = [8, 44]\n"planner.seed" = { count = 6 }\n"planner.moves" = ["nodes"]\n',
    )
    code, out, _ = leave(capsys, "sweep", path, "--out", tmp_path / "out", "--workers", 1, "--json")
    told = json.loads(out)
    assert code == 0 and told["runs"] == told["finished"] == 12 and told["whole"]
    row = next(r for r in rows_of(tmp_path / "out" / JOINED) if r["number"] == 9)
    code, out, _ = leave(capsys, "sweep", path, "--only", 9, "--json")
    assert code == 0
    again = json.loads(out)
    assert (again["verdict"], again["length_cm"]) == (row["verdict"], row["length_cm"])
    code, out, _ = leave(capsys, "report", tmp_path / "out", "--out", tmp_path / "plots", "--json")
    groups = json.loads(out)["groups"]
    assert code == 0 and [g["settings"]["set.planner.neighbours"] for g in groups] == [8, 44]
    assert (tmp_path / "plots" / "length_cm.png").read_bytes()[:4] == b"\x89PNG"
    code, out, _ = leave(capsys, "report", tmp_path / "out")
    assert code == 0 and "both: 12 of 12 runs" in out


def test_failures_are_told_by_kind_with_the_line_that_repeats_one(tmp_path, capsys):
    path = written(
        tmp_path,
        'kind = "self-test"\nscenes = ["scene.toml"]\n[vary]\ndo = ["raise", "answer"]\n'
        "seed = { first = 3, count = 5 }\n",
    )
    assert leave(capsys, "campaign", path, "--out", tmp_path / "out", "--workers", 1)[0] == 0
    _, out, _ = leave(capsys, "report", tmp_path / "out", "--json")
    (failure,) = json.loads(out)["failures"]
    assert (failure["runs"], failure["reason"]) == (5, "RuntimeError: run 3 was asked to raise")
    assert failure["example"] == f"planarm campaign {path} --only 0"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["report", "none"], "has neither a run's record.json nor a campaign's"),
        (["campaign", "none.toml"], "none.toml: cannot be read"),
        (["campaign", "campaign.toml", "--only", "99"], "has 6 runs, counted from 0"),
        (
            ["campaign", "campaign.toml", "--dask", "tcp://127.0.0.1:9", "--workers", "2"],
            "--workers goes with this machine",
        ),
    ],
)
def test_wrong_words_are_one_sentence(words, said, tmp_path, capsys, monkeypatch):
    self_test(tmp_path, ["answer"])
    monkeypatch.chdir(tmp_path)
    code, out, err = leave(capsys, *words)
    assert (code, out) == (2, "")
    assert said in err
