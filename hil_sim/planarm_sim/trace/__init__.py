"""What the emulated board did, in files that GTKWave, PulseView and spreadsheets read."""

from __future__ import annotations

from planarm_sim.trace.serial_csv import SerialCsvWriter, write_serial_log
from planarm_sim.trace.vcd import EDGE, UNITS_PER_CYCLE, Vcd, VcdWriter, read_vcd

__all__ = ["EDGE", "UNITS_PER_CYCLE", "SerialCsvWriter", "Vcd", "VcdWriter", "read_vcd", "write_serial_log"]
