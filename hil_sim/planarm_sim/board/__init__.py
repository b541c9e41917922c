"""The Uno: its pins, its serial line, and the chip on it."""

from __future__ import annotations

from planarm_sim.board.pins import PINS, PinPlace, pin_name
from planarm_sim.board.serial import CLOCK_HZ, SerialPort, Usb
from planarm_sim.board.uno import Pin, Uno, UnoSnapshot

__all__ = ["CLOCK_HZ", "PINS", "Pin", "PinPlace", "SerialPort", "Uno", "UnoSnapshot", "Usb", "pin_name"]
