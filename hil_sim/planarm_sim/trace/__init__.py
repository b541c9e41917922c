"""Waveforms of the emulated pins, in files that GTKWave and PulseView read."""

from __future__ import annotations

from planarm_sim.trace.vcd import EDGE, UNITS_PER_CYCLE, Vcd, VcdWriter, read_vcd

__all__ = ["EDGE", "UNITS_PER_CYCLE", "Vcd", "VcdWriter", "read_vcd"]
