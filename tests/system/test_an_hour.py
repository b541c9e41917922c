"""An hour of motion on a line that loses a byte in ten thousand: every step, once."""

import random
from collections import Counter

import numpy as np

from link_model import motion
from planarm.campaign.faulty_transport import FaultyTransport, Mishaps
from planarm.link.exchange import stream_plan
from planarm.link.plan_steps import PlanSteps
from planarm.link.released_image import released_image
from planarm_sim import Uno
from planarm_sim.board.pins import pin_place
from planarm_sim.faults.line import ActiveFault, FaultyLine
from planarm_sim.faults.schedule import Fault
from planarm_wire.messages import STEP_PINS

SEGMENT_TICKS = 320_000
LOST_SHARE = 1e-4


def test_every_step_of_a_long_motion_comes_once_although_bytes_are_lost(sized):
    """50 segments a second; a minute's worth of bytes are a few tens of thousands, so seconds lose some, too."""
    seconds = sized(8, 3600)
    board = Uno.from_hex(released_image())
    board.run(seconds=0.02)
    lost = ActiveFault(
        Fault("line.drop", 0.0, None, {"direction": "both", "share": LOST_SHARE * sized(50, 1)}),
        0,
        1 << 62,
        np.random.default_rng(7),
    )
    line = FaultyTransport(board, FaultyLine(board, lambda: (lost,)), Mishaps())
    rises = Counter()
    board.listen(lambda edges: rises.update(_rising(edges)))
    segments = motion(50 * seconds, ticks=SEGMENT_TICKS, seed=random.Random(3).randrange(1 << 30))
    result = stream_plan(line, segments, lambda _told: board.clear_edges())
    steps = PlanSteps.of(segments)
    assert result.ledger_after.position_usteps == steps.planned_usteps()
    assert [rises[pin] for pin in STEP_PINS] == [counts[-1] for counts in steps.counts]
    assert line.line.counts["dropped"] > 10
    assert result.retransmissions > 0
    assert result.motion_s < 1.02 * seconds + 1.0


def _rising(edges) -> dict[str, int]:
    """How many rising edges each STEP pin has among some; pins as the chip numbers them."""
    up = edges["pin"][edges["level"] == 1]
    return {pin: int((up == pin_place(pin).index).sum()) for pin in STEP_PINS}
