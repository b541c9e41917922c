"""Serial lines from the emulated board to hosts outside of this process."""

from __future__ import annotations

from planarm_sim.bridge.bridge import BOOT_S, Bridge, BridgeCounts, Speed
from planarm_sim.bridge.line import Clock, Line, WallClock

__all__ = ["BOOT_S", "Bridge", "BridgeCounts", "Clock", "Line", "Speed", "WallClock"]
