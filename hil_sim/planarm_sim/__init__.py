"""An Arduino Uno in Python: the very flash image that a board runs, true to the datasheet to the clock cycle.

::

    from planarm_sim import Uno

    uno = Uno.from_hex("blink.hex")
    uno.run(seconds=1)
    print(uno.edges("D13"))
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from planarm_sim.errors import SimError
from planarm_sim.plant import CircleObstacle, Joint, LimitSwitch, Link, Motor, PolygonObstacle, Rig

if TYPE_CHECKING:
    from planarm_sim.bench import Bench, BenchReport
from planarm_sim.board import Pin, Uno, UnoSnapshot
from planarm_sim.drivers import DriverWiring, driver_row

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
    "driver_row",
]


def __getattr__(name: str) -> object:
    """Import the board when it is first asked for: the pytest plugin is in every test run, Numba need not be."""
    if name in __all__:
        from planarm_sim import board  # noqa: PLC0415 - that is the point

        return vars(board)[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
