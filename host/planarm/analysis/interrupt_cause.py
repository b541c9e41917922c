"""Which interrupt kept an edge from its time, where the recording carries the emulator's interrupt line."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

VECTOR_NAMES = (
    "RESET", "INT0", "INT1", "PCINT0", "PCINT1", "PCINT2", "WDT", "TIMER2_COMPA", "TIMER2_COMPB", "TIMER2_OVF",
    "TIMER1_CAPT", "TIMER1_COMPA", "TIMER1_COMPB", "TIMER1_OVF", "TIMER0_COMPA", "TIMER0_COMPB", "TIMER0_OVF",
    "SPI_STC", "USART_RX", "USART_UDRE", "USART_TX", "ADC", "EE_READY", "ANALOG_COMP", "TWI", "SPM_READY",
)  # fmt: skip
"""Interrupts of the ATmega328P by number (datasheet, table 12-6, whose numbers are one higher)."""


def delayed_by(interrupts: npt.NDArray[np.void], due_ps: float, came_ps: float) -> str | None:
    """Name the vector that ran longest between the moment an edge was due and the moment it came.

    Args:
        interrupts: those that ended before or around, fields vector, begin_ps, end_ps; ascending.
        due_ps: the edge's planned moment.
        came_ps: its real one.

    Returns:
        The vector's name, such as "interrupt USART_RX", or None when none ran then.
    """
    begins = np.maximum(interrupts["begin_ps"], due_ps)
    ends = np.minimum(interrupts["end_ps"], came_ps)
    overlaps = ends - begins
    if not len(overlaps) or overlaps.max() <= 0:
        return None
    vector = int(interrupts["vector"][int(overlaps.argmax())])
    return f"interrupt {VECTOR_NAMES[vector] if vector < len(VECTOR_NAMES) else vector}"
