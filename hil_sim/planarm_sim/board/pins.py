"""The Uno's pin names and where they go on the ATmega328P (Arduino Uno Rev3 schematic)."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass

from planarm_sim.errors import PinError

__all__ = ["PINS", "PinPlace", "pin_name", "pin_place"]

PORTS = "BCD"


@dataclass(frozen=True, slots=True)
class PinPlace:
    """Where a board pin goes.

    Attributes:
        name: as printed on the board.
        port: letter of the port.
        bit: bit of the port.
        role: alternate functions that matter to a program that steps motors; "" when there are none.
    """

    name: str
    port: str
    bit: int
    role: str = ""

    @property
    def index(self) -> int:
        """Number of the pin on the chip: port (B 0, C 1, D 2) x 8 + bit."""
        return PORTS.index(self.port) * 8 + self.bit


PINS: tuple[PinPlace, ...] = (
    PinPlace("D0", "D", 0, "RXD"),
    PinPlace("D1", "D", 1, "TXD"),
    PinPlace("D2", "D", 2, "INT0"),
    PinPlace("D3", "D", 3, "INT1 OC2B"),
    PinPlace("D4", "D", 4, "T0"),
    PinPlace("D5", "D", 5, "T1 OC0B"),
    PinPlace("D6", "D", 6, "OC0A"),
    PinPlace("D7", "D", 7),
    PinPlace("D8", "B", 0, "ICP1"),
    PinPlace("D9", "B", 1, "OC1A"),
    PinPlace("D10", "B", 2, "OC1B"),
    PinPlace("D11", "B", 3, "OC2A"),
    PinPlace("D12", "B", 4),
    PinPlace("D13", "B", 5, "LED"),
    PinPlace("A0", "C", 0),
    PinPlace("A1", "C", 1),
    PinPlace("A2", "C", 2),
    PinPlace("A3", "C", 3),
    PinPlace("A4", "C", 4),
    PinPlace("A5", "C", 5),
)
"""Every pin of the two headers, in the board's order."""

_BY_NAME = {pin.name: pin for pin in PINS}
_BY_INDEX = {pin.index: pin.name for pin in PINS}


def pin_place(name: str) -> PinPlace:
    """Find a pin by its name.

    Raises:
        PinError: the Uno has no such pin; the message names the closest one.
    """
    if name in _BY_NAME:
        return _BY_NAME[name]
    raise PinError(f"an Uno has no pin {name!r}; it has D0 to D13 and A0 to A5. Closest: {_closest(str(name))}")


def _closest(name: str) -> str:
    """The pin that was probably meant: a chip's name for it, the same row's nearest number, or the likest name."""
    for pin in PINS:
        if name.upper() == f"P{pin.port}{pin.bit}":
            return pin.name
    parts = re.fullmatch(r"([DA]?)(\d+)", name.upper())
    if parts is None:
        return difflib.get_close_matches(name.upper(), _BY_NAME, n=1, cutoff=0.0)[0]
    row, number = parts.group(1) or "D", int(parts.group(2))
    return min((n for n in _BY_NAME if n.startswith(row)), key=lambda n: abs(int(n[1:]) - number))


def pin_name(index: int) -> str | None:
    """Name of the chip's pin `index` on the board; None for pins that no header carries (crystal, reset)."""
    return _BY_INDEX.get(index)
