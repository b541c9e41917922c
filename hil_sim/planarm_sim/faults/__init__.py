"""What goes wrong, on demand: a seeded schedule for the line, the power, the mechanics and the host."""

from __future__ import annotations

from planarm_sim.faults.runner import FaultRunner, inject
from planarm_sim.faults.schedule import KINDS, Fault, Schedule, load_schedule, parse_schedule

__all__ = ["KINDS", "Fault", "FaultRunner", "Schedule", "inject", "load_schedule", "parse_schedule"]
