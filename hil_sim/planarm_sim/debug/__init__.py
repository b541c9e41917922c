"""A debugger's way into the emulated board: GDB's remote serial protocol, as avr-gdb speaks it."""

from __future__ import annotations

from planarm_sim.debug.server import GdbServer, serve
from planarm_sim.debug.session import Session
from planarm_sim.debug.target import Target

__all__ = ["GdbServer", "Session", "Target", "serve"]
