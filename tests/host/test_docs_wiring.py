"""The drawings of docs/wiring.md are what docs/wiring.toml says, and the pins are the firmware's."""

import runpy
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

from planarm_wire.messages import BOARDS, DIR_PINS, ENABLE_PIN, STEP_PINS

DOCS = Path(__file__).resolve().parents[2] / "docs"
WIRINGS = tomllib.loads((DOCS / "wiring.toml").read_text(encoding="utf-8"))


def test_the_drawings_are_up_to_date(tmp_path):
    made = runpy.run_path(str(DOCS / "make_wiring.py"))["make_wiring"](tmp_path)
    assert len(made) == len(WIRINGS)
    for file in made:
        ElementTree.fromstring(file.read_text(encoding="utf-8"))
        assert file.read_bytes() == (DOCS / "images" / file.name).read_bytes(), "run python docs/make_wiring.py"


DRIVERS = tuple(f"driver {number}" for number in range(1, 5))
SLOTS = ("slot X", "slot Y", "slot Z", "slot A")


@pytest.mark.parametrize(
    ("name", "board", "slots"),
    [
        ("own", "uno", DRIVERS[:2]),
        ("own", "uno_slow", DRIVERS[:2]),
        ("own_four", "uno_four", DRIVERS),
        ("cnc_shield_wires", "uno", ("slot Y", "slot X")),
        ("cnc_shield", "cnc_shield", SLOTS[:2]),
        ("cnc_shield", "cnc_shield_four", SLOTS),
    ],
)
def test_every_wiring_brings_the_firmwares_pins_to_the_drivers(name, board, slots):
    wired = BOARDS[board]
    pin_at = {wire["to"]: wire["from"] for wire in WIRINGS[name]["wires"]}
    for slot, step, direction in zip(slots, wired.step_pins, wired.dir_pins, strict=True):
        assert (pin_at[f"{slot} STEP"], pin_at[f"{slot} DIR"], pin_at[f"{slot} ENABLE"]) == (
            step,
            direction,
            wired.enable_pin,
        )
    inputs = [pin for place, pin in pin_at.items() if place.split()[0] in ("switches", "headers")]
    assert inputs[: 1 + wired.joints] == [wired.stop_pin, *wired.limit_pins]


@pytest.mark.parametrize("name", WIRINGS)
def test_all_drivers_are_supplied_through_the_emergency_contact(name):
    places = [f"{part['name']} {pin}" for part in WIRINGS[name]["parts"] for pin in part["pins"]]
    assert WIRINGS[name]["supplied"] == [place for place in places if place.endswith("motor +")] != []
    grounded = [wire["to"] for wire in WIRINGS[name]["wires"] if wire["from"] == "GND"]
    own = [place for place in WIRINGS[name]["supplied"] if place.startswith("driver")]
    assert [place.replace("motor +", "GND") for place in own] == [place for place in grounded if place[0] == "d"]


def test_on_the_shield_exactly_the_wires_that_it_does_not_have_are_added():
    shield = WIRINGS["cnc_shield_wires"]
    for wire in shield["wires"]:
        assert wire.get("added", False) == (shield["nets"][wire["to"]] != wire["from"])


def test_no_added_wire_joins_two_outputs():
    """What a wire joins to a pin of the firmware is no output of it."""
    shield = WIRINGS["cnc_shield_wires"]
    outputs = {*STEP_PINS, *DIR_PINS, ENABLE_PIN}
    joined = {shield["nets"][wire["to"]] for wire in shield["wires"] if wire.get("added")}
    assert joined == {"D2", "D3", "D6"}
    assert not joined & outputs
