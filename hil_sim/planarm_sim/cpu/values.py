"""What goes into a chip and comes out of it: causes, edges, frames, snapshots."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu.layout import Bytes, State
from planarm_sim.cpu.program import Program


class StopCause(Enum):
    """Why `Chip.run_to` came back."""

    REACHED = "the target cycle is reached"
    BREAK = "BREAK instruction"
    BAD_OPCODE = "undefined opcode"
    ASLEEP = "asleep and nothing can wake the chip"
    BREAKPOINT = "a breakpoint is reached"


class ResetCause(IntFlag):
    """Sources of reset, as their bits stand in MCUSR (ATmega328P datasheet, 11.9.1)."""

    POWER_ON = 1
    EXTERNAL = 2
    BROWN_OUT = 4
    WATCHDOG = 8


class Parity(Enum):
    """Parity of a serial frame."""

    NONE = "none"
    EVEN = "even"
    ODD = "odd"


EDGE_DTYPE: Final = np.dtype([("cycle", np.int64), ("pin", np.uint8), ("level", np.uint8)])
"""An edge of an output pin: the cycle of the electrical change, the pin, its new level."""
TX_DTYPE: Final = np.dtype([("cycle", np.int64), ("byte", np.uint16), ("bit_cycles", np.int32)])
"""A frame sent: the cycle at which its last stop bit ends, the character, cycles per bit."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything that decides the chip's further run; opaque, made by `Chip.snapshot`."""

    state: NDArray[np.int64]
    memory: NDArray[np.uint8]
    program: Program
    queues: tuple[NDArray[np.int64], ...]


@dataclass(frozen=True, slots=True)
class FirstTouch:
    """The first access of the program to a register of a part that is not modelled.

    Attributes:
        address: in the data space; 0x900 and above is beyond the chip's memory.
        register: the datasheet's name, or the address in hexadecimal where there is no register.
        pc: word address of the instruction.
    """

    address: int
    register: str
    pc: int


class Watcher(Protocol):
    """What may run the chip in the CPU loop's stead, to see more of it; `planarm_sim.insight` has one."""

    def advance(self, st: State, memory: Bytes, words: State, program: Program, target: int) -> int:
        """Run as `dispatch.run` does."""
        ...

    def restart(self, cycle: int) -> None:
        """The chip is reset at `cycle`."""
        ...
