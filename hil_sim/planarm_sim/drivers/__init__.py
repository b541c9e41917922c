"""Step/dir drivers: rows of data, and the models that enforce their timing rules."""

from __future__ import annotations

from planarm_sim.drivers.bank import DriverBank, DriverCounts, DriverWiring, Violation
from planarm_sim.drivers.table import DRIVERS, RULES, DriverRow, driver_row

__all__ = ["DRIVERS", "RULES", "DriverBank", "DriverCounts", "DriverRow", "DriverWiring", "Violation", "driver_row"]
