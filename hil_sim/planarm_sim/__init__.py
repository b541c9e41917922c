"""An Arduino Uno in Python: the very flash image that a board runs, true to the datasheet to the clock cycle.

::

    from planarm_sim import Uno

    uno = Uno.from_hex("blink.hex")
    uno.run(seconds=1)
    print(uno.edges("D13"))
"""

from __future__ import annotations

from planarm_sim.board import Pin, Uno, UnoSnapshot
from planarm_sim.errors import SimError

__all__ = ["Pin", "SimError", "Uno", "UnoSnapshot"]
