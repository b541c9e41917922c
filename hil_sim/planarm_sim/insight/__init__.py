"""What no board tells: interrupts by latency and duration, load, stack, cycles per function."""

from __future__ import annotations

from planarm_sim.insight.figures import (
    INTERVAL,
    VECTOR_NAMES,
    FunctionFigures,
    Insight,
    InterruptFigures,
    Spread,
)
from planarm_sim.insight.observer import Observer

__all__ = ["INTERVAL", "VECTOR_NAMES", "FunctionFigures", "Insight", "InterruptFigures", "Observer", "Spread"]
