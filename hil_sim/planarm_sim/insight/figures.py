"""What watching a program tells, as values; cycles are those of the 16 MHz clock."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "INTERVAL",
    "VECTOR_NAMES",
    "FunctionFigures",
    "Insight",
    "InterruptFigures",
    "Spread",
    "running_interrupts",
]

VECTOR_NAMES: Final = (
    "RESET", "INT0", "INT1", "PCINT0", "PCINT1", "PCINT2", "WDT", "TIMER2_COMPA", "TIMER2_COMPB", "TIMER2_OVF",
    "TIMER1_CAPT", "TIMER1_COMPA", "TIMER1_COMPB", "TIMER1_OVF", "TIMER0_COMPA", "TIMER0_COMPB", "TIMER0_OVF",
    "SPI_STC", "USART_RX", "USART_UDRE", "USART_TX", "ADC", "EE_READY", "ANALOG_COMP", "TWI", "SPM_READY",
)  # fmt: skip
"""Interrupt vectors by number (ATmega328P datasheet, table 12-6; number here = vector no. there - 1)."""

INTERVAL: Final = np.dtype(
    [("vector", np.uint8), ("flag", np.int64), ("entry", np.int64), ("exit", np.int64), ("nested_in", np.uint8)]
)
"""One interrupt: its vector; the cycles at which its request came to stand, its first instruction began and its RETI
was over; how many interrupts it interrupted."""


@dataclass(frozen=True, slots=True)
class Spread:
    """How a number of cycles is spread.

    Attributes:
        least: the smallest.
        mean: the average.
        p99: 99 of 100 are not larger; exact below 4,096, above it to 256 cycles.
        most: the largest.
    """

    least: int
    mean: float
    p99: int
    most: int


@dataclass(frozen=True, slots=True)
class InterruptFigures:
    """One vector.

    Attributes:
        vector: its number.
        name: as avr-libc has it.
        count: how often it was taken, and has returned.
        latency_cycles: from the request (flag and enable set) to the first instruction in the vector table, the four
            cycles of entering included (datasheet, 7.7.1). A request that its handler leaves standing, as RXC with a
            second byte, counts anew from the handler's return.
        duration_cycles: from that instruction to the end of RETI, interrupts in between included.
    """

    vector: int
    name: str
    count: int
    latency_cycles: Spread
    duration_cycles: Spread


@dataclass(frozen=True, slots=True)
class FunctionFigures:
    """One function.

    Attributes:
        name: its symbol.
        address: byte address in flash.
        calls: how often it was entered.
        inclusive_cycles: spent in it and in what it called, without interrupts and sleep.
        self_cycles: spent in it alone.
    """

    name: str
    address: int
    calls: int
    inclusive_cycles: int
    self_cycles: int


@dataclass(frozen=True, slots=True)
class Insight:
    """What a program did since it has been watched.

    Attributes:
        start_cycle: when watching began.
        cycles: how long it has lasted.
        asleep_cycles: of these, the processor slept.
        interrupt_cycles: of these, were spent in interrupts, their entries included.
        deepest_stack_bytes: the most bytes that were on the stack below the end of the SRAM.
        interrupts: every vector that was taken.
        functions: every function that was entered, most expensive by itself first; empty without symbols.
    """

    start_cycle: int
    cycles: int
    asleep_cycles: int
    interrupt_cycles: int
    deepest_stack_bytes: int
    interrupts: tuple[InterruptFigures, ...]
    functions: tuple[FunctionFigures, ...]

    @property
    def load(self) -> float:
        """Share of the time in which the processor was awake."""
        return 1 - self.asleep_cycles / self.cycles if self.cycles else 0.0

    @property
    def interrupt_share(self) -> float:
        """Share of the time that interrupts took."""
        return self.interrupt_cycles / self.cycles if self.cycles else 0.0

    def interrupt(self, name: str) -> InterruptFigures | None:
        """The figures of a vector by its name; None when it was never taken."""
        return next((figures for figures in self.interrupts if figures.name == name), None)

    def function(self, name: str) -> FunctionFigures | None:
        """The figures of a function by its name; None when it was never entered."""
        return next((figures for figures in self.functions if figures.name == name), None)

    def as_dict(self) -> dict[str, Any]:
        """All of it for JSON, the two shares included."""
        return {**asdict(self), "load": self.load, "interrupt_share": self.interrupt_share}


def running_interrupts(intervals: NDArray[Any]) -> list[tuple[int, int]]:
    """Return the moments at which another interrupt began to run, with its number; 0 where none runs.

    Args:
        intervals: INTERVAL in order of entries; one within another interrupts it, which then goes on.
    """
    changes: list[tuple[int, int]] = []
    stack: list[tuple[int, int]] = []

    def end_before(cycle: float) -> None:
        while stack and stack[-1][1] <= cycle:
            _, end = stack.pop()
            changes.append((end, stack[-1][0] if stack else 0))

    for vector, entry, end in intervals[["vector", "entry", "exit"]].tolist():
        end_before(entry)
        stack.append((vector, end))
        changes.append((entry, vector))
    end_before(inf)
    return changes
