"""Schedules of faults: what is read, what is refused and how it is told, and that docs list every kind."""

import re
from pathlib import Path

import pytest

from planarm_sim.errors import FaultError
from planarm_sim.faults import KINDS, load_schedule, parse_schedule
from planarm_sim.faults.schedule import LASTING, MOMENTARY

DOCS = (Path(__file__).resolve().parents[2] / "docs" / "faults.md").read_text(encoding="utf-8")


def test_a_schedule_has_its_defaults():
    schedule = parse_schedule('[[faults]]\nkind = "line.drop"\nshare = 0.5\n', "x.toml")
    assert (schedule.seed, schedule.zero) == (0, "first_step")
    fault = schedule.faults[0]
    assert (fault.kind, fault.at_s, fault.for_s) == ("line.drop", 0.0, None)
    assert fault.settings == {"direction": "both", "share": 0.5}
    assert parse_schedule("seed = 3", "x.toml", 9).seed == 9


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("seed = ", "is not valid TOML"),
        ("sed = 1", "sed: unknown key; it takes seed, zero, faults"),
        ("seed = true", "seed: True given, a whole number from 0 on"),
        ('zero = "start"', "zero: 'start' given, 'first_step' or 'power_up'"),
        ("faults = 3", "an array of tables"),
        ('[[faults]]\nkind = "line.dorp"', "faults[1].kind: 'line.dorp' given, one of line.drop"),
        ('[[faults]]\nkind = "line.dorp"', "(closest: line.drop)"),
        ('[[faults]]\nkind = "line.drop"', "faults[1].share: missing, a number from 0 to 1"),
        ('[[faults]]\nkind = "line.drop"\nshare = 1.5', "faults[1].share: 1.5 given"),
        ('[[faults]]\nkind = "line.drop"\nshare = 0.1\ndirection = "up"', "'to_board', 'to_host', 'both'"),
        ('[[faults]]\nkind = "power.reset"\nfor_s = 1', "for_s: unknown key"),
        ('[[faults]]\nkind = "mechanics.bump"\njoint = 1\ntorque_nm = 1', "faults[1].for_s: missing"),
        ('[[faults]]\nkind = "mechanics.stall"\njoint = 1.5', "faults[1].joint: 1.5 given, a whole number"),
    ],
)
def test_what_is_wrong_is_named(text, words):
    with pytest.raises(FaultError) as caught:
        parse_schedule(text, "x.toml")
    assert str(caught.value).startswith("x.toml: ")
    assert words in str(caught.value)


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(FaultError, match=r"nothing.toml: cannot be read"):
        load_schedule(tmp_path / "nothing.toml")


def test_the_docs_list_every_kind_with_its_settings():
    for kind, settings in KINDS.items():
        row = next(line for line in DOCS.splitlines() if line.startswith("|") and f"`{kind}`" in line)
        assert set(re.findall(r"`(\w+)`", row.split("|")[2])) == set(settings)
    assert set(MOMENTARY) | set(LASTING) <= set(KINDS)
