"""`[[limit_switches]]`: switches that joints press, wired to the board; the emulated arm presses them."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from planarm.scene.strict_toml import Table

KEYS = ("joint", "pin", "at_deg", "side", "bounce_ms", "normally_closed")
SIDES = ("below", "above")
PINS = tuple(f"D{n}" for n in range(2, 14)) + tuple(f"A{n}" for n in range(6))


@dataclass(frozen=True, slots=True)
class LimitSwitchSpec:
    """A switch: `joint` counts from 1, `above` tells whether it is pressed at and beyond `at_rad` or up to it.

    One that is `normally_closed` opens when it is pressed, so that a broken wire reads as pressed.
    """

    joint: int
    pin: str
    at_rad: float
    above: bool
    bounce_s: float
    normally_closed: bool = False


def parse_limit_switches(root: Table, joints: int) -> tuple[LimitSwitchSpec, ...]:
    """Read all of them.

    Raises:
        SceneError: a value is not what its key takes, two switches share a pin, or one opens and another closes.
    """
    switches: list[LimitSwitchSpec] = []
    for path, entry in root.tables("limit_switches"):
        table = Table.with_keys(root.source, path, entry, KEYS)
        switch = LimitSwitchSpec(
            joint=table.integer("joint", at_least=1, at_most=joints),
            pin=table.choice("pin", PINS),
            at_rad=radians(table.number("at_deg", at_least=-720.0, at_most=720.0)),
            above=table.choice("side", SIDES) == "above",
            bounce_s=1e-3 * table.number("bounce_ms", 1.0, at_least=0.0, at_most=1000.0),
            normally_closed=table.flag("normally_closed", False),
        )
        if any(other.pin == switch.pin for other in switches):
            table.fail("pin", f"{switch.pin} is another switch's; give each a pin of its own")
        if switches and switches[0].normally_closed != switch.normally_closed:
            table.fail("normally_closed", "the board takes all switches alike: write the same for each")
        switches.append(switch)
    return tuple(switches)
