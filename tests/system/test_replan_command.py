"""`planarm replan` as a command: obstacles from a file with times, from a watched file, and what is refused."""

import json
from pathlib import Path

import pytest

from planarm.cli.main import main
from planarm.link import transport

EXAMPLE = str(Path(__file__).resolve().parents[2] / "examples" / "energy_two_links.toml")

CIRCLE = """
[[obstacles]]
shape = "circle"
center_cm = [{x}, {y}]
diameter_cm = {diameter}
"""
BESIDE = CIRCLE.format(x=0, y=-40, diameter=4)
ON_THE_WAY = CIRCLE.format(x=0, y=32, diameter=3)
"""The tip comes by there, and this roadmap has no other way."""


def replan(capsys, *words):
    """Run the command; its exit code, what it printed, and what it complained about."""
    with pytest.raises(SystemExit) as left:
        main(["replan", EXAMPLE, *words])
    out, err = capsys.readouterr()
    return left.value.code, out, err


def arrivals(folder, *entries):
    path = folder / "arrivals.toml"
    path.write_text("".join(f"{shape}at_s = {at_s}\n" for at_s, shape in entries))
    return str(path)


def test_an_obstacle_beside_the_way_is_kept_and_the_goal_reached(tmp_path, capsys):
    code, out, _ = replan(capsys, "--arrivals", arrivals(tmp_path, (0.3, BESIDE)), "--json")
    assert code == 0
    (line,) = out.splitlines()  # one object, nothing else
    told = json.loads(line)
    assert told["reached"]
    (one,) = told["encounters"]
    assert (one["verdict"], one["obstacle"]) == ("kept", "circle at (0, -40) cm")
    assert 0.3 <= one["at_s"] < 0.35
    assert told["new_plans"] == []
    assert told["end_deg"] == pytest.approx([160.0, 30.0], abs=0.05)


def test_a_way_that_is_closed_is_a_stop_with_its_reason(tmp_path, capsys):
    code, out, err = replan(capsys, "--arrivals", arrivals(tmp_path, (0.3, ON_THE_WAY)))
    assert code == 3
    assert "circle at (0, 32) cm: avoided" in out
    assert "no way leads on from tip" in " ".join(out.split())
    assert "planarm explain E301" in err


def test_a_stop_is_one_object_too(tmp_path, capsys):
    code, out, _ = replan(capsys, "--arrivals", arrivals(tmp_path, (0.1, BESIDE), (0.3, ON_THE_WAY)), "--json")
    assert code == 3
    (line,) = out.splitlines()
    told = json.loads(line)["error"]
    assert not told["reached"]
    assert [one["verdict"] for one in told["encounters"]] == ["kept", "avoided"]
    assert told["reason"] in told["message"]


def test_a_watched_file_is_read_again_while_the_arm_moves(tmp_path, capsys, monkeypatch):
    """Somebody adds an obstacle when the motion has been planned: here, when the line to the board is opened."""
    watched = tmp_path / "seen.toml"
    watched.write_text(BESIDE)
    opened = transport.open_transport

    def opened_late(*arguments):
        with watched.open("a") as more:
            more.write(CIRCLE.format(x=0, y=-48, diameter=2))
        return opened(*arguments)

    monkeypatch.setattr(transport, "open_transport", opened_late)
    code, out, _ = replan(capsys, "--watch", str(watched), "--json")
    assert code == 0
    met = [(one["obstacle"], one["verdict"]) for one in json.loads(out)["encounters"]]
    assert met == [("circle at (0, -40) cm", "kept"), ("circle at (0, -48) cm", "kept")]


@pytest.mark.parametrize(
    ("text", "words", "complaint"),
    [
        (None, (), "give --arrivals FILE or --watch FILE"),
        (BESIDE.replace("center_cm", "centre_cm"), ("--arrivals",), "did you mean 'center_cm'?"),
        ("obstacles = 3", ("--arrivals",), "obstacles"),
        (BESIDE + "at_s = -1", ("--arrivals",), "at_s"),
    ],
)
def test_what_is_wrong_is_told_before_anything_moves(text, words, complaint, tmp_path, capsys):
    path = tmp_path / "arrivals.toml"
    if text is not None:
        path.write_text(text)
    code, out, err = replan(capsys, *words, *([str(path)] if words else []))
    assert code == 2
    assert complaint in err
    assert out == ""


def test_a_scene_without_a_roadmap_is_refused(tmp_path, capsys):
    scene = EXAMPLE.replace("energy_two_links", "table1_case1")
    with pytest.raises(SystemExit) as left:
        main(["replan", scene, "--arrivals", arrivals(tmp_path, (0.0, BESIDE))])
    assert left.value.code == 2
    assert "takes a planner on a roadmap" in capsys.readouterr().err
