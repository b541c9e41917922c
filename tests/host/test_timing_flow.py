"""`planarm timing`, whole: a plan, a recording of its execution with a defect, the place on the path, each output."""

import json
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from captures import Pulse, Train, write_saleae, write_vcd
from host_scenes import make_scene
from planarm.cli.main import main
from planarm.model.arm import Arm
from planarm.model.kinematics import inverse_2r
from planarm.model.transmission import Transmission
from planarm.pipeline import plan_scene, stored
from planarm.plan_file import save_plan
from planarm.stepping.expand import expand

TICK_PS = 62_500


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """A short plan and the pulses that execute it exactly."""
    scene = make_scene(start=(30.0, 20.0), goal=(28.0, 24.0), x=(0.0, 50.0), y=(0.0, 50.0))
    plan = plan_scene(scene, lambda _stage, _share: None)
    path = tmp_path_factory.mktemp("plan") / "short.plan"
    save_plan(stored(plan), path)
    joints = tuple(
        tuple(Pulse(TICK_PS * int(t), d > 0) for t, d in zip(steps.ticks, steps.directions, strict=True))
        for steps in expand(plan.segments).steps
    )
    return plan, path, Train(joints)


def leave(capsys, *words):
    with pytest.raises(SystemExit) as left:
        main(["timing", *map(str, words)])
    told = capsys.readouterr()
    return left.value.code, told.out, told.err


def test_an_exact_execution_is_told_as_such(planned, tmp_path, capsys):
    _, plan_file, train = planned
    write_vcd(tmp_path / "a.vcd", train.moved(10**11))
    code, out, _ = leave(capsys, tmp_path / "a.vcd", "--plan", plan_file)
    assert code == 0
    assert "every step is there, on its time and in its rules" in out
    assert "a4988" in out, "the plan's own driver is judged by"


def test_a_defect_is_told_with_its_place_on_the_path_in_every_output(planned, tmp_path, capsys):
    plan, plan_file, train = planned
    n = len(train.joints[0]) // 2
    late = train.changed(0, n, rise_ps=train.joints[0][n].rise_ps + 5_000_000)
    write_vcd(tmp_path / "a.vcd", late)
    words = (tmp_path / "a.vcd", "--plan", plan_file, "--junit", tmp_path / "out.xml")
    code, out, err = leave(capsys, *words, "--json")
    told = json.loads(out)
    assert (code, err) == (7, "")
    (finding,) = told["findings"]
    assert (finding["kind"], finding["joint"], told["ok"]) == ("late", 1, False)
    assert finding["value_us"] == pytest.approx(5.0, abs=0.01)
    at_ticks = train.joints[0][n].rise_ps // TICK_PS
    usteps = [
        start + int(steps.directions[: np.searchsorted(steps.ticks, at_ticks + 80, side="right")].sum())
        for start, steps in zip(plan.segments.start_usteps, expand(plan.segments).steps, strict=True)
    ]
    expected = Transmission.of(plan.scene).q_rad(np.array(usteps))
    arm = Arm.from_spec(plan.scene.arm)
    assert inverse_2r(arm, finding["tip_cm"], "up") == pytest.approx(expected, abs=1e-9)
    suite = ET.fromstring((tmp_path / "out.xml").read_text())
    assert suite.get("failures") == "1"
    (failure,) = suite.iter("failure")
    assert "joint 1: step late at" in failure.text and "cm: 5.000 us, limit 1.000 us" in failure.text
    code, out, err = leave(capsys, *words)
    assert code == 7
    assert "step late" in out and "1 x step late" in err


def test_another_drivers_rules_can_be_asked_for(planned, tmp_path, capsys):
    _, plan_file, train = planned
    short = Train(tuple(tuple(replace(p, high_ps=2_000_000) for p in joint) for joint in train.joints))
    write_vcd(tmp_path / "a.vcd", short)
    assert leave(capsys, tmp_path / "a.vcd", "--plan", plan_file)[0] == 0
    code, out, _ = leave(capsys, tmp_path / "a.vcd", "--plan", plan_file, "--driver", "dm542", "--json")
    assert code == 7
    assert json.loads(out)["counts"] == {"step_high": sum(map(len, train.joints))}


def test_a_board_that_is_not_the_plans_is_refused(planned, tmp_path, capsys):
    """Its pins would be another board's: steps would be looked for on lines that do not carry them."""
    _, plan_file, train = planned
    write_vcd(tmp_path / "a.vcd", train.moved(10**11))
    code, _, err = leave(capsys, tmp_path / "a.vcd", "--plan", plan_file, "--board", "cnc_shield")
    assert code == 2
    assert "--board cnc_shield" in err
    assert "short.plan is for the board uno; leave --board out" in " ".join(err.split())
    code, _, _ = leave(capsys, tmp_path / "a.vcd", "--plan", plan_file, "--board", "uno")
    assert code == 0


def test_two_recordings_are_compared_across_formats_and_clocks(planned, tmp_path, capsys):
    _, _, train = planned
    write_vcd(tmp_path / "a.vcd", train)
    write_vcd(tmp_path / "b.vcd", train.scaled(0.9965).moved(5 * 10**9))
    code, out, _ = leave(capsys, "diff", tmp_path / "a.vcd", tmp_path / "b.vcd", "--json")
    assert code == 0
    assert json.loads(out)["clock_ppm"] == pytest.approx(1e6 * (1 / 0.9965 - 1), abs=1.0)
    write_vcd(tmp_path / "c.vcd", train.without(1, 7))
    code, out, _ = leave(capsys, "diff", tmp_path / "a.vcd", tmp_path / "c.vcd", "--json")
    assert code == 7
    assert json.loads(out)["counts"] == {"missing": 1}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.vcd"], "none.vcd: cannot be read"),
        (["a.csv"], "none of the board's step pins (D9, D10"),
        (["a.csv", "--map", "step1=Channel 0"], "dir1 is mapped to no channel"),
        (["a.csv", "--map", "step1=Channel 9"], "no channel 'Channel 9'"),
        (["a.csv", "--map", "wrong"], "is not like 'step1=CHANNEL'"),
        (["a.csv", "--map", "step1=Channel 0", "--map", "dir1=Channel 0"], "stands in another --map already"),
        (["a.csv", "b.csv"], "give one capture, or 'diff' and two captures"),
        (["diff", "a.csv"], "give one capture, or 'diff' and two captures"),
        (["diff", "a.csv", "a.csv", "--plan", "x.plan"], "--plan goes with one capture"),
        (["a.csv", "--tolerance-us", "0"], "'0' given, a number above 0 expected"),
        (["a.csv", "--plan", "a.csv"], "is no plan"),
        (["a.csv", "--map", "step1=Channel 0", "--map", "dir1=Channel 1", "--driver", "x99"], "no driver 'x99'"),
    ],
)
def test_wrong_words_are_one_sentence(words, said, planned, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_saleae(tmp_path / "a.csv", planned[2])
    code, out, err = leave(capsys, *words)
    assert (code, out) == (2, "")
    assert said in err
    sentence, told_by_code = err.removesuffix("\n").rsplit("\n", 1)
    assert "\n" not in sentence or "read: " in sentence
    assert told_by_code.startswith("  'planarm explain E")


def test_a_file_called_diff_can_be_judged(planned, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_vcd(tmp_path / "diff", planned[2])
    assert leave(capsys, "diff", "--plan", planned[1])[0] == 0
