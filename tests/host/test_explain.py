"""Codes: every error, every check and every word of the device has one, and each is explained once."""

import ast
import json
import re
import runpy
from pathlib import Path

import pytest

import planarm.errors
from planarm.cli.main import main
from planarm.errors import PlanarmError
from planarm.explain import check_code, explain, explanations
from planarm.link import position
from planarm.scene import load_scene
from planarm_wire.messages import Fault, Result

ROOT = Path(__file__).resolve().parents[2]
ERRORS = [e for m in (planarm.errors, position) for e in vars(m).values() if isinstance(e, type)]
ERRORS = [e for e in ERRORS if issubclass(e, PlanarmError) and e is not PlanarmError]


def leave(capsys, *words):
    with pytest.raises(SystemExit) as left:
        main(list(words))
    captured = capsys.readouterr()
    return left.value.code, captured.out, captured.err


@pytest.mark.parametrize("error", ERRORS, ids=lambda e: e.__name__)
def test_every_error_has_a_code_that_begins_with_its_exit_code(error):
    assert error.code[:2] == f"E{error.exit_code}"
    assert explanations()[error.code].fix


def test_no_error_is_explained_that_does_not_exist():
    assert {code for code in explanations() if code[0] == "E"} == {error.code for error in ERRORS}


def test_every_fault_and_refusal_is_explained():
    wanted = {f"F{one.value}" for one in Fault if one is not Fault.NONE}
    wanted |= {f"R{-one.value}" for one in Result if one.value < 0}
    assert wanted <= set(explanations())
    assert "queue ran empty" in explain("underrun").cause


def names_in_sources():
    """The first argument of every check that the certificate's sources make, as a pattern; variables match anything."""
    for path in sorted((ROOT / "host" / "planarm" / "stepping").glob("check*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        texts = {
            t.id: n.value
            for n in ast.walk(tree)
            if isinstance(n, ast.Assign)
            for t in n.targets
            if isinstance(t, ast.Name)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("at_most", "at_least", "Check"):
                named = node.args[0]
                yield pattern(texts.get(named.id, named) if isinstance(named, ast.Name) else named)


def pattern(node):
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return re.escape(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(re.escape(p.value) if isinstance(p, ast.Constant) else ".+" for p in node.values)
    return ".+"


def test_every_name_of_a_check_in_the_sources_has_a_code():
    titles = [e.title for e in explanations().values() if e.code[0] == "C"]
    patterns = list(names_in_sources())
    assert len(patterns) > 20
    for one in patterns:
        names = [name for title in titles for name in (title, f"joint 1 {title}", f"{title}, 0.2 s late")]
        assert any(re.fullmatch(one, name) and check_code(name) for name in names), one


def test_every_check_of_a_plan_has_its_code_and_every_code_is_some_checks():
    from planarm.pipeline import plan_scene  # noqa: PLC0415 - brings the kernels, which the other tests do not need

    scene = ROOT / "tests" / "scenarios" / "arm.toml"
    checks = plan_scene(load_scene(scene), lambda _stage, _share: None).certificate.checks
    assert [check.name for check in checks if not check_code(check.name)] == []
    unseen = {code for code in explanations() if code[0] == "C"} - {check_code(check.name) for check in checks}
    assert unseen <= {"C25", "C30"}, "the scene has no floor, and no limit of jerk"


@pytest.mark.parametrize(
    "asked", ["E202", "e202", "C12", "joint 2 step interval", "F2", "UNDERRUN", "WRONG_STATE", "R3"]
)
def test_a_code_or_a_name_is_explained(capsys, asked):
    code, out, err = leave(capsys, "explain", asked)
    assert (code, err) == (0, "")
    assert "cause:" in out and "fix:" in out


def test_an_unknown_code_names_the_nearest(capsys):
    code, _, err = leave(capsys, "explain", "E222")
    assert code == 2
    assert "did you mean E202" in err


def test_without_a_code_all_are_listed(capsys):
    _, out, _ = leave(capsys, "explain", "--json")
    assert [one["code"] for one in json.loads(out)["codes"]] == list(explanations())


def test_an_error_on_the_terminal_names_its_code(capsys, tmp_path):
    code, _, err = leave(capsys, "plan", str(tmp_path / "none.toml"))
    assert code == 2
    assert re.search(r"planarm explain E2\d\d", err)


def test_the_page_of_codes_is_the_one_that_is_made():
    page = runpy.run_path(str(ROOT / "docs" / "make_codes.py"))["codes_page"]()
    assert (ROOT / "docs" / "codes.md").read_text(encoding="utf-8") == page
