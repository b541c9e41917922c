"""What the released firmware takes of its processor, measured on the emulator (firmware/README.md, budgets)."""

from __future__ import annotations

from typing import Final

STEP_INTERRUPT_TICKS: Final = 79
"""A step's interrupt."""
LINE_LOAD: Final = 0.1
"""Share of the processor that the interrupts of a busy line take."""
READ_TICKS: Final = 15_000
"""The main program's work on a segment, from the rates at which it just keeps up (12,000 to 15,000)."""
SLICE_WORK_TICKS: Final = 8_000
"""The same on each further slice of it."""
STRETCHED_TICKS: Final = 17_000
"""What it needs more for a segment that is stretched: with those of 0.5 and 1 ms it keeps up at one every 2.0 ms, and
not at one every 1.7 ms."""
LATEST_READ_TICKS: Final = 40_000
"""How long before its start a segment must be there."""
LEAST_SHARE: Final = 0.05
"""Keeps an overloaded board's time finite."""
