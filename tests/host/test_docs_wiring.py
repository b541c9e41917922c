"""The drawings of docs/wiring.md are what docs/wiring.toml says, and the pins are the firmware's."""

import runpy
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

from planarm_wire.messages import DIR_PINS, ENABLE_PIN, STEP_PINS

DOCS = Path(__file__).resolve().parents[2] / "docs"
WIRINGS = tomllib.loads((DOCS / "wiring.toml").read_text(encoding="utf-8"))


def test_the_drawings_are_up_to_date(tmp_path):
    made = runpy.run_path(str(DOCS / "make_wiring.py"))["make_wiring"](tmp_path)
    assert len(made) == len(WIRINGS)
    for file in made:
        ElementTree.fromstring(file.read_text(encoding="utf-8"))
        assert file.read_bytes() == (DOCS / "images" / file.name).read_bytes(), "run python docs/make_wiring.py"


@pytest.mark.parametrize(("name", "slots"), [("own", ("driver 1", "driver 2")), ("cnc_shield", ("slot Y", "slot X"))])
def test_every_wiring_brings_the_firmwares_pins_to_the_drivers(name, slots):
    pin_at = {wire["to"]: wire["from"] for wire in WIRINGS[name]["wires"]}
    for slot, step, direction in zip(slots, STEP_PINS, DIR_PINS, strict=True):
        assert (pin_at[f"{slot} STEP"], pin_at[f"{slot} DIR"], pin_at[f"{slot} ENABLE"]) == (
            step,
            direction,
            ENABLE_PIN,
        )


def test_on_the_shield_exactly_the_wires_that_it_does_not_have_are_added():
    shield = WIRINGS["cnc_shield"]
    for wire in shield["wires"]:
        assert wire.get("added", False) == (shield["nets"][wire["to"]] != wire["from"])


def test_no_added_wire_joins_two_outputs():
    """What a wire joins to a pin of the firmware is no output of it."""
    shield = WIRINGS["cnc_shield"]
    outputs = {*STEP_PINS, *DIR_PINS, ENABLE_PIN}
    joined = {shield["nets"][wire["to"]] for wire in shield["wires"] if wire.get("added")}
    assert joined == {"D2", "D3", "D6"}
    assert not joined & outputs
