"""Holds that the line damages, or that overtake a RESUME on its way: the emulated arm rests all the same."""

from dataclasses import replace
from pathlib import Path

import pytest

from planarm.link.arm_record import ArmSetup
from planarm.link.exchange import open_session, request
from planarm.link.stream import Phase
from planarm.link.stream_values import position_of
from planarm.link.transport import open_transport
from planarm.pipeline import plan_scene
from planarm.scene import load_scene
from planarm.streaming.plan_stream import options_for, stream
from planarm_wire.framing import Frame, FrameDecoder
from planarm_wire.messages import HOLD_CODE, MessageType, State

SCENE = Path(__file__).resolve().parents[1] / "scenarios" / "arm.toml"
PHASES = 24
PHASE_S = 0.00011
"""Between the moments of two runs: the board's main loop is at another place each time."""
HOLD_S = 0.12
"""From the first segment; the motion takes 0.4 s."""


@pytest.fixture(scope="module")
def plan():
    return plan_scene(replace(load_scene(SCENE), limit_switches=()), lambda _stage, _share: None)


class Hand:
    """Holds a motion, resumes it while it slows down, and holds it again right behind the RESUME; then lets it end."""

    def __init__(self, plan, hold_s):
        self.plan, self.hold_s = plan, hold_s
        self.line = open_transport("sim://", 250_000, ArmSetup(plan.scene, plan.segments.start_usteps, None))
        session = open_session(self.line)
        request(self.line, session, position_of(plan.segments.start_usteps, session.joints))
        self.state, self.stream, self.next = None, None, self.first_hold
        self.rested = False
        self.write, self.line.write = self.line.write, self.written
        self.holds_written = 0

    def run(self):
        options = options_for(self.plan.scene, self.plan.segments)
        return stream(self.plan.segments, self.plan.certificate, self.line, self.watch, options, steer=self.steer)

    def watch(self, told):
        self.state = told.state

    def steer(self, stream):
        self.stream = stream
        assert stream.phase is Phase.RUNNING
        self.next()

    def written(self, data):
        self.holds_written += data.count(HOLD_CODE)
        self.write(data)

    def first_hold(self):
        if self.line.clock.now_s() >= self.stream.started_s + self.hold_s:
            self.stream.hold()
            self.next = self.then_resume

    def then_resume(self):
        if self.state is State.HOLDING:
            self.stream.resume()
            self.line.write, self.next = self.written_with_resume, self.until_held

    def written_with_resume(self, data):
        """The RESUME goes out, and the second hold so close behind it that nothing comes between."""
        self.written(data)
        frames = [frame for frame in FrameDecoder().feed(data) if isinstance(frame, Frame)]
        if MessageType.RESUME not in [frame.type_code for frame in frames]:
            return
        self.line.write = self.without_the_hold
        self.stream.hold()
        self.written(bytes([HOLD_CODE]))

    def without_the_hold(self, data):
        """That hold is on its way already."""
        assert data[0] == HOLD_CODE
        self.line.write = self.written
        if data[1:]:
            self.write(data[1:])

    def until_held(self):
        if self.state is State.HELD:
            self.rested = True
            self.stream.resume()
            self.next = lambda: None


def test_a_hold_right_behind_a_resume_rests_the_arm_in_every_phase(plan):
    again = 0
    for phase in range(PHASES):
        hand = Hand(plan, HOLD_S + phase * PHASE_S)
        result = hand.run()
        assert hand.rested, f"phase {phase}: the second hold was lost"
        assert result.ledger_after.position_usteps[:2] == plan.train.end_usteps
        again += hand.holds_written > 2
    assert again > 0, "in some phases the RESUME undoes the hold"


def test_a_hold_that_the_line_lost_is_sent_again(plan):
    hand = Hand(plan, HOLD_S)
    lost = []

    def without_a_hold(data):
        if HOLD_CODE in data and not lost:
            lost.append(data)
            data = data.replace(bytes([HOLD_CODE]), b"")
        if data:
            hand.write(data)

    hand.line.write = without_a_hold
    hand.then_resume = hand.until_held
    hand.run()
    assert lost
    assert hand.rested
