"""Streams a motion that can be held to a board, and the reference motion of the tests of holds and stops."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from firmware_board import LEAD_TICKS, WAKE_TICKS, Board, Firmware, Schedule
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import (
    HOLD_CODE,
    JOINTS,
    QUEUE_FRAME_BYTES,
    Config,
    Enable,
    Fault,
    PinMap,
    Resume,
    Segments,
    Start,
    State,
    Status,
)
from stretch_motion import HoldableMotion, Profile

FAST = Profile((20_000.0, 12_360.0), (400_000.0, 400_000.0), 0.8, 30).motion()


class Player:
    """Streams a motion to a board that has just been powered on, and notes what it tells."""

    def __init__(self, firmware: Firmware, motion: HoldableMotion, *, options: int = 0) -> None:
        self.motion = motion
        self.board = Board(firmware)
        self.board.hello()
        config = Config(PinMap.OWN, JOINTS, 0, options, 0, 0, 0, motion.start_stop_ticks)
        assert self.board.ask(config).refusal == 0
        self.board.ask(Enable(1))
        self.board.run(WAKE_TICKS)
        self.waiting = deque(
            Segments(*head, (segment,)) for segment, head in zip(motion.segments, motion.heads, strict=True)
        )
        self.status = self.board.ask()

    def fill(self) -> Status:
        """Send what the queue takes."""
        self.status = self.board.ask_now()
        free = self.status.free_bytes
        while self.waiting and encoded_bytes(self.waiting[0]) <= free:
            free -= encoded_bytes(self.waiting[0]) + QUEUE_FRAME_BYTES
            self.board.send(self.waiting.popleft())
            self.board.run(6000)
        return self.status

    def start(self) -> None:
        while self.waiting and self.fill().free_bytes > 60:
            pass
        self.board.send(Start(LEAD_TICKS))

    def play_until(self, tick: int, *states: State, feed: bool = True) -> Status:
        """Let time pass, up to a tick or to one of the states."""
        while self.board.now < tick:
            self.board.run(8000)
            status = self.fill() if feed else self.board.ask_now()
            if status.state in states:
                return status
        assert not states, f"not in {states}: {self.board.ask()}"
        return self.board.ask()

    def hold_and_resume(self, waits: Iterable[int], pause: int) -> None:
        """Hold after each wait, rest for the pause, and go on; fewer times where the motion has ended. All in ticks."""
        for wait in waits:
            self.play_until(self.board.now + wait)
            self.board.receive(bytes([HOLD_CODE]))
            if self.play_until(self.board.now + 10**9, State.HELD, State.READY).state is State.READY:
                return
            self.board.run(pause)
            self.board.send(Resume())

    def assert_all_steps_made(self) -> None:
        status = self.play_until(self.board.now + 10**9, State.READY, State.FAULT)
        assert (status.state, status.fault) == (State.READY, Fault.NONE)
        assert status.ledger.position_usteps == Schedule.of(self.motion.segments).positions()
        assert status.ledger.executed_segments == len(self.motion.segments)
