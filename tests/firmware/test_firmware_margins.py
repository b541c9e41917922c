"""Interrupts that come late, to the cycle, on the emulated chip: whatever step is still made keeps every driver's rule.

The main program is stopped with interrupts off in front of a step, and goes on some ticks before the next one: that
one is made with the least low time and DIR setup time, or a fault is latched and nothing rises any more.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from firmware_board import LEAD_TICKS, Board, end_motion, run_of, segment_of
from firmware_tracer import INTERRUPTS_ON, Tracer
from planarm_wire.messages import BOARDS, MIN_DIR_SETUP_TICKS, Fault, Segment, Segments, Start, Status

RELEASE = Path(__file__).parents[2] / "firmware" / "release"
JUMP_TO_ITSELF = b"\xff\xcf"  # rjmp .-2
INTERVAL = 1500
STEPS = 12
MOST_LATE_TICKS = 192  # docs/wiring.md: joints 3 and 4, 12 us


class LateBoard:
    """A board that plays one motion again and again, each time with interrupts held off for another while."""

    def __init__(self, name: str, motion: list[Segment], joint: int) -> None:
        self.wiring = BOARDS[name]
        self.tracer = Tracer(RELEASE / f"{name}.hex", self.wiring)
        self.tracer.run = super(Tracer, self.tracer).run  # type: ignore[method-assign]
        self.board = Board(self.tracer)
        self.board.get_ready()
        for segment in motion:
            self.board.ask(Segments(0, 0, 0, (segment,)))
        self.board.edges.clear()
        self.seq = self.board.seq
        code = self.tracer.uno.flash
        self._trap = next(at for at in range(len(code) // 2) if code[2 * at : 2 * at + 2] == JUMP_TO_ITSELF)
        self._queued = self.tracer.uno.snapshot()
        self.joint = joint
        self.planned = self.play(0, 0)[1]

    def play(self, hold_from: int, hold_until: int) -> tuple[Status, list[int]]:
        """Play the motion, with interrupts held between two ticks; return the last STATUS and the joint's rises."""
        board, chip = self.board, self.tracer.chip
        self.tracer.uno.restore(self._queued)
        board.forget_replies()
        board.edges.clear()
        board.seq = self.seq
        board.send(Start(LEAD_TICKS))
        if hold_until:
            board.run(hold_from - board.now)
            self.tracer.run_until(lambda: bool(chip.sreg & INTERRUPTS_ON))
            place, sreg = chip.pc, chip.sreg
            chip.pc, chip.sreg = self._trap, sreg & ~INTERRUPTS_ON
            chip.run_to(hold_until)
            chip.pc, chip.sreg = place, sreg
        board.run(LEAD_TICKS + 3 * STEPS * INTERVAL)
        status = board.ask()
        self.assert_rules()
        assert status.fault in (Fault.NONE, Fault.MISSED_DEADLINE)
        made = tuple(board.position_at(joint, board.now) for joint in range(self.wiring.joints))
        assert status.ledger.position_usteps == made
        return status, board.rises(self.joint)

    def assert_rules(self) -> None:
        """High and low times, and DIR's setup time."""
        for step_pin, dir_pin in self.wiring.joint_pins:
            edges = [edge for edge in self.board.edges if edge.pin == step_pin]
            turns = [edge.tick for edge in self.board.edges if edge.pin == dir_pin]
            for earlier, later in itertools.pairwise(edges):
                least = self.wiring.min_step_high_ticks if earlier.level else self.wiring.min_step_low_ticks
                assert later.tick - earlier.tick >= least, step_pin
            for rise in (edge.tick for edge in edges if edge.level):
                assert all(turn > rise or rise - turn >= MIN_DIR_SETUP_TICKS for turn in turns), step_pin

    def faults(self, step: int, ticks_before: range) -> Iterator[tuple[Fault, list[int]]]:
        """Hold interrupts from before a step until some ticks before the next one."""
        for before in ticks_before:
            status, made = self.play(self.planned[step] - 100, self.planned[step + 1] - before)
            yield status.fault, made


def moving(which: Sequence[int], joints: int, *, turns: bool) -> list[Segment]:
    """Some joints at an even pace, with a turn in the middle if told so; the others rest."""

    def part(positive: bool) -> Segment:
        moves = [run_of(0)] * joints
        for joint in which:
            moves[joint] = run_of(STEPS, first=0, interval=INTERVAL, positive=positive)
        return segment_of(STEPS * INTERVAL, *moves, joints=joints)

    return end_motion([part(True), part(not turns)])


@pytest.mark.parametrize("turns", [False, True], ids=["onward", "turning"])
@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", ["uno", "uno_four", "cnc_shield"])
def test_a_late_interrupt_leaves_the_next_step_its_times_or_ends_all(name: str, joint: int, turns: bool) -> None:
    late = LateBoard(name, moving((joint,), BOARDS[name].joints, turns=turns), joint)
    assert len(late.planned) == 2 * STEPS
    # Within a run, and at its end, where DIR may turn: from no distance to more than is asked for.
    found = set()
    for fault, made in late.faults(STEPS - 1 if turns else 5, range(30, 520 if turns else 190, 3)):
        found.add(fault)
        if name != "cnc_shield":
            assert made == late.planned[: len(made)]
        assert fault is Fault.MISSED_DEADLINE or len(made) == len(late.planned)
    assert found == {Fault.NONE, Fault.MISSED_DEADLINE}


@pytest.mark.parametrize("joints", [(2,), (3,), (2, 3)])
def test_joints_3_and_4_are_late_by_what_is_told_or_not_at_all(joints: tuple[int, ...]) -> None:
    # Joint 1 makes one step, which tells the ticks; from then on nothing but the late interrupt notices. A step is
    # made within 12 us of its tick, or not made.
    mark, *motion = moving(joints, 4, turns=False)
    moves = [run_of(1, first=0) if joint == 0 else move for joint, move in enumerate(mark.moves)]
    late = LateBoard("uno_four", [replace(mark, moves=tuple(moves)), *motion], joints[-1])
    begin = late.board.rises(0)[0]
    schedule = [begin + INTERVAL * n for n in range(2 * STEPS)]
    found, most_late = set(), 0
    for after in range(-100, 500, 3):
        status, made = late.play(schedule[5] - 400, schedule[5] + after)
        found.add(status.fault)
        assert len(made) == (len(schedule) if status.fault is Fault.NONE else 5), after
        for joint in joints:
            off = [rise - tick for rise, tick in zip(late.board.rises(joint), schedule, strict=False)]
            assert max(off) <= MOST_LATE_TICKS, (joint, after)
            most_late = max(most_late, *off)
    assert found == {Fault.NONE, Fault.MISSED_DEADLINE}
    assert most_late > MOST_LATE_TICKS - 25, "no earlier than needed"
