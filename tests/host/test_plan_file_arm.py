"""Plans are bound to the arm they were made for; the certificate is shown with every plan."""

import json
from dataclasses import asdict, fields, is_dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from planarm.cli.main import main
from planarm.errors import CertificateError, PlanFileError
from planarm.pipeline import plan_scene, stored
from planarm.plan_file import FORMAT, arm_hash, load_plan, require_arm, save_plan
from planarm.report.tables import certificate_table
from planarm.scene import Scene, parse_scene
from planarm.stepping.certificate import Certificate
from planarm.streaming.plan_stream import stream
from planarm.warm_up import SMALL_SCENE


@pytest.fixture(scope="module")
def scene():
    return parse_scene(SMALL_SCENE, "small")


@pytest.fixture(scope="module")
def plan(scene):
    return plan_scene(scene, lambda _stage, _share: None)


def test_another_task_or_obstacle_is_the_same_arm(scene):
    other = replace(scene, obstacles=(), task=replace(scene.task, goal_cm=(2.0, 3.0)), name="other")
    assert arm_hash(asdict(other)) == arm_hash(asdict(scene))


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda s: replace(s, arm=replace(s.arm, link_lengths_cm=(3.0, 2.01))), "arm differ"),
        (lambda s: replace(s, joints=(s.joints[0], replace(s.joints[1], microsteps=32))), "joints differ"),
        (lambda s: replace(s, joints=(replace(s.joints[0], reversed=True), s.joints[1])), "joints differ"),
        (lambda s: replace(s, coupling=((1.0, 0.0), (1.0, 1.0))), "coupling differ"),
        (lambda s: replace(s, mechanics=replace(s.mechanics, end_masses_kg=(0.0, 0.5))), "mechanics differ"),
    ],
)
def test_a_plan_for_another_arm_is_refused_after_the_file(scene, plan, tmp_path, change, word):
    save_plan(stored(plan), tmp_path / "small.plan")
    loaded = load_plan(tmp_path / "small.plan")
    require_arm(loaded, scene, "small.plan")
    with pytest.raises(CertificateError, match=rf"small.plan: .* another arm .*{word}"):
        require_arm(loaded, change(scene), "small.plan")


def test_allowances_come_back_from_the_file(plan, tmp_path):
    save_plan(stored(plan), tmp_path / "small.plan")
    loaded = load_plan(tmp_path / "small.plan")
    assert loaded.segments == plan.segments
    assert len(loaded.segments.allowances) == len(plan.segments.segments)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            {"wiring": "ramps"},
            "no board executes it: no wiring 'ramps' is known; there are own, own_slow, cnc_shield; make it anew",
        ),
        ({"start_usteps": [0] * 5}, "no board executes it: .*5 joints; the wiring own has pins for 4; make it anew"),
    ],
)
def test_a_plan_for_no_known_board_is_refused_as_a_file(plan, tmp_path, changed, words):
    file = tmp_path / "small.plan"
    save_plan(stored(plan), file)
    body = json.loads(file.read_text()) | changed
    del body["sha256"]
    body["sha256"] = sha256(json.dumps(body, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
    file.write_text(json.dumps(body))
    with pytest.raises(PlanFileError, match=rf"small.plan: {words}"):
        load_plan(file)


@pytest.mark.parametrize("red", [True, False])
def test_nothing_is_sent_of_a_plan_without_certificate_or_with_a_red_one(plan, red):
    class NoLine:
        def __getattr__(self, name):
            raise AssertionError(f"the line was touched: {name}")

    first, *others = plan.certificate.checks
    certificate = Certificate((replace(first, verdict="red"), *others) if red else ())
    with pytest.raises(CertificateError, match=r"wire limits|no checks"):
        stream(plan.segments, certificate, NoLine(), None)


def test_the_table_shows_every_check_and_what_to_change(plan):
    rows = [asdict(check) for check in plan.certificate.checks]
    rows[3] = {**rows[3], "verdict": "red", "setting": "joints[1].max_speed_deg_s"}
    table = certificate_table(rows)
    assert table.row_count == len(rows)
    cells = [list(column.cells) for column in table.columns]
    assert "red" in cells[0][3]
    assert cells[5][3] == r"joints\[1].max_speed_deg_s" or cells[5][3] == "joints[1].max_speed_deg_s"
    assert all(cell == "" for cell, row in zip(cells[5], rows, strict=True) if row["verdict"] == "green")


def test_the_command_refuses_before_it_opens_the_port(scene, plan, tmp_path, capsys):

    save_plan(stored(plan), tmp_path / "small.plan")
    other = tmp_path / "other.toml"
    Path(other).write_text(SMALL_SCENE.replace("microsteps = 16", "microsteps = 8", 1))
    with pytest.raises(SystemExit) as left:
        main(["stream", str(tmp_path / "small.plan"), "--arm", str(other), "--port", "/no/such/port"])
    assert left.value.code == 4
    assert "another arm" in capsys.readouterr().err


def test_a_plan_of_an_older_format_is_refused_in_words_by_whatever_reads_plans(plan, tmp_path, capsys):
    """Such a scene lacks what scenes have got since; its hash is right, and its wire may be ours."""
    file = tmp_path / "old.plan"
    save_plan(stored(plan), file)
    body = json.loads(file.read_text())
    body |= {"format": 3, "planarm": "0.0.9"}
    del body["scene"]["board_spec"], body["sha256"]
    body["sha256"] = sha256(json.dumps(body, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
    file.write_text(json.dumps(body))
    words = r"old\.plan: has format 3, by planarm 0\.0\.9, this planarm reads format 4; make it anew with 'planarm"
    with pytest.raises(PlanFileError, match=words):
        load_plan(file)
    capture = tmp_path / "a.csv"
    capture.write_text("")
    for command in (["stream", str(file), "--port", "sim://"], ["timing", str(capture), "--plan", str(file)]):
        with pytest.raises(SystemExit) as ended:
            main(command)
        assert ended.value.code == PlanFileError.exit_code
        assert "has format 3" in capsys.readouterr().err


def test_another_scene_in_plans_is_another_format():
    """A plan file holds the scene whole: other fields need another `plan_file.FORMAT`, and their hash here."""
    names = sorted(_field_names(Scene))
    assert (FORMAT, sha256(" ".join(names).encode()).hexdigest()[:12]) == (4, "0ff2f0eaf655")


def _field_names(kind, place="scene"):
    """Yield every field that `asdict` makes of a dataclass, with its place."""
    if not is_dataclass(kind):
        for part in get_args(kind):
            yield from _field_names(part, place)
        return
    hints = get_type_hints(kind)
    for field in fields(kind):
        yield f"{place}.{field.name}"
        yield from _field_names(hints[field.name], f"{place}.{field.name}")


def test_a_scene_in_a_plans_place_is_told_what_makes_a_plan_of_it(tmp_path):
    scene = tmp_path / "arm.toml"
    scene.write_text('name = "arm"\n')
    with pytest.raises(
        PlanFileError, match=r"arm\.toml: is no plan: .*; make one with 'planarm plan .*arm\.toml -o FILE"
    ):
        load_plan(scene)
