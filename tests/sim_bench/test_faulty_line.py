"""A line on which things go wrong, by itself: when it wants to be served."""

from pathlib import Path

import numpy as np

from planarm_sim import Uno
from planarm_sim.faults import parse_schedule
from planarm_sim.faults.line import ActiveFault, FaultyLine

ECHO = Path(__file__).parents[1] / "sim_board" / "data" / "echo.hex"
MS = 16_000


def test_a_byte_that_is_held_is_handed_over_when_it_is_due():
    """Whoever sleeps until the line asks for him does not add to its delays."""
    uno = Uno.from_hex(ECHO, usb="16u2")
    uno.run(cycles=MS)
    schedule = parse_schedule('[[faults]]\nkind = "line.delay"\nshare = 1.0\nby_s = 0.001\n', "x.toml")
    delay = ActiveFault(schedule.faults[0], 0, 10**9, np.random.default_rng(1))
    line = FaultyLine(uno, lambda: (delay,))
    usual = uno.serial.next_delivery_cycle
    assert line.next_delivery_cycle == usual, "nothing is held: the USB bridge's next packet"
    before = uno.cycle
    line.write(b"a")
    assert line.next_delivery_cycle == before + MS < usual
    uno.run(cycles=MS - 100)
    assert line.read() == b""
    assert uno.serial.pending == 0, "the byte is still held"
    uno.run(cycles=line.next_delivery_cycle - uno.cycle)
    line.pump()
    assert uno.serial.pending == 1
