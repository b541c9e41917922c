"""A pin and an analogue input of the board, to be driven from outside."""

from __future__ import annotations

from planarm_sim.board.pins import PinPlace
from planarm_sim.cpu.chip import Chip
from planarm_sim.errors import PinError

__all__ = ["AnalogInput", "Pin"]


class Pin:
    """One pin of the board, made by `Uno.pin`."""

    def __init__(self, chip: Chip, place: PinPlace) -> None:
        self._chip = chip
        self._place = place

    @property
    def name(self) -> str:
        """The name printed on the board."""
        return self._place.name

    @property
    def level(self) -> int:
        """The electrical level now, 0 or 1; a floating pin reads 0."""
        return self._chip.pin_level(self._place.index)

    def drive(self, level: int) -> None:
        """Hold the pin at 0 or 1 from outside, from now on.

        Raises:
            PinError: another level.
        """
        if level not in (0, 1):
            raise PinError(f"pin {self.name} cannot be driven to {level!r}; levels are 0 and 1")
        self._chip.drive_pin(self._place.index, int(level))

    def release(self) -> None:
        """Let go of the pin."""
        self._chip.drive_pin(self._place.index, None)


class AnalogInput:
    """An input of the analogue-to-digital converter, made by `Uno.analog`."""

    def __init__(self, chip: Chip, channel: int) -> None:
        self._chip = chip
        self._channel = channel

    @property
    def volts(self) -> float | None:
        """The voltage from outside, 0 to 5 V; None: nothing is connected, conversions see the digital level.

        Raises:
            PinError: set outside the limits.
        """
        return self._chip.analog_volts(self._channel)

    @volts.setter
    def volts(self, value: float | None) -> None:
        self._chip.drive_analog(self._channel, value)
