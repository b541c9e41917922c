"""Step/dir drivers: rows of data, and the models that enforce their timing rules."""

from __future__ import annotations

from planarm_sim.drivers.bank import DriverBank, DriverCounts, DriverWiring, Violation, driver_row, wiring_of
from planarm_wire.drivers import DRIVERS, RULES, DriverRow

__all__ = [
    "DRIVERS",
    "RULES",
    "DriverBank",
    "DriverCounts",
    "DriverRow",
    "DriverWiring",
    "Violation",
    "driver_row",
    "wiring_of",
]
