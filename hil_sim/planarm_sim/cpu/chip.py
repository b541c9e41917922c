"""The ATmega328P as one object: arrays in, compiled kernel, logs out.

`Chip` is the whole interface between the chip and the board around it. Time is counted in clock cycles since
power-up and never goes back, not even over a reset.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Any

import numpy as np
from numpy.typing import NDArray


class StopCause(Enum):
    """Why `Chip.run_to` came back."""

    REACHED = "the target cycle is reached"
    BREAK = "BREAK instruction"
    BAD_OPCODE = "undefined opcode"
    ASLEEP = "asleep and nothing can wake the chip"


class ResetCause(IntFlag):
    """Sources of reset, as their bits stand in MCUSR (ATmega328P datasheet, 11.9.1)."""

    POWER_ON = 1
    EXTERNAL = 2
    BROWN_OUT = 4
    WATCHDOG = 8


EDGE_DTYPE = np.dtype([("cycle", np.int64), ("pin", np.uint8), ("level", np.uint8)])
TX_DTYPE = np.dtype([("cycle", np.int64), ("byte", np.uint16), ("bit_cycles", np.int32)])


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything that decides the chip's further run; opaque, made by `Chip.snapshot`."""

    arrays: tuple[NDArray[Any], ...]


@dataclass(frozen=True, slots=True)
class FirstTouch:
    """The first access of the program to a register of a part that is not modelled."""

    address: int
    register: str
    pc: int


class Chip:
    """ATmega328P. Pins are numbered port * 8 + bit with B = 0, C = 1, D = 2 (PB1 is 1, PD1 is 17)."""

    def __init__(self, flash: bytes) -> None:
        """Load a program image of up to 32 KiB and power up; the rest of the flash is erased (0xFF)."""
        raise NotImplementedError

    @property
    def cycle(self) -> int:
        """Clock cycles since power-up."""
        raise NotImplementedError

    def run_to(self, cycle: int) -> StopCause:
        """Run whole instructions until `self.cycle >= cycle`, or until the program stops earlier."""
        raise NotImplementedError

    def reset(self, cause: ResetCause = ResetCause.POWER_ON) -> None:
        """Reset the chip now. SRAM keeps its contents except at power-on; queued serial input stays queued."""
        raise NotImplementedError

    def push_rx(self, start_cycle: int, bit_cycles: float, byte: int) -> None:
        """Queue a serial frame whose start bit falls on RXD at `start_cycle`, in order of time."""
        raise NotImplementedError

    def drain_tx(self) -> NDArray[Any]:
        """Return and forget the frames that ended on TXD: TX_DTYPE, `cycle` is the end of the stop bit."""
        raise NotImplementedError

    def drain_edges(self) -> NDArray[Any]:
        """Return and forget every edge of an output pin, EDGE_DTYPE in order of time."""
        raise NotImplementedError

    def drive_pin(self, pin: int, level: int | None, cycle: int | None = None) -> None:
        """Drive a pin from outside at `cycle` (None: now); `level` None lets go of it."""
        raise NotImplementedError

    def pin_level(self, pin: int) -> int:
        """Return the electrical level of a pin now, 0 or 1; a floating pin reads 0."""
        raise NotImplementedError

    def snapshot(self) -> Snapshot:
        """Copy everything that decides the further run, logs not yet drained included."""
        raise NotImplementedError

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to `snapshot`; the same run follows."""
        raise NotImplementedError

    def unmodelled(self) -> tuple[FirstTouch, ...]:
        """Return the registers of parts that are not modelled which the program touched, by address."""
        raise NotImplementedError
