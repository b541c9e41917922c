"""An Arduino Uno in Python: the very flash image that a board runs, true to the datasheet to the clock cycle.

::

    from planarm_sim import Uno

    uno = Uno.from_hex("blink.hex")
    uno.run(seconds=1)
    print(uno.edges("D13"))

and around it, when asked for, a bench of drivers, motors and an arm (`planarm_sim.bench`).
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from planarm_sim.errors import SimError

if TYPE_CHECKING:
    from planarm_sim.bench import Bench, BenchReport
    from planarm_sim.board import Pin, Uno, UnoSnapshot
    from planarm_sim.drivers import DriverWiring, driver_row
    from planarm_sim.plant import CircleObstacle, Joint, LimitSwitch, Link, Motor, PolygonObstacle, Rig, desk_arm

__all__ = [
    "Bench",
    "BenchReport",
    "CircleObstacle",
    "DriverWiring",
    "Joint",
    "LimitSwitch",
    "Link",
    "Motor",
    "Pin",
    "PolygonObstacle",
    "Rig",
    "SimError",
    "Uno",
    "UnoSnapshot",
    "desk_arm",
    "driver_row",
]

_ROOMS = {
    "bench": ("Bench", "BenchReport"),
    "board": ("Pin", "Uno", "UnoSnapshot"),
    "drivers": ("DriverWiring", "driver_row"),
    "plant": ("CircleObstacle", "Joint", "LimitSwitch", "Link", "Motor", "PolygonObstacle", "Rig", "desk_arm"),
}
_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names}


def __getattr__(name: str) -> object:
    """Import a room when it is first asked for: the pytest plugin is in every test run, Numba need not be."""
    if name in _ROOM_OF:
        return getattr(importlib.import_module(f"planarm_sim.{_ROOM_OF[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
