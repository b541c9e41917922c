"""The emulated board run instruction by instruction, so that every interrupt's cycles are counted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from firmware_board import UNO, EmulatedFirmware
from planarm_wire.boards import Board as Wiring

# Numbers of the vectors, from 0.
PIN_CHANGE, SCHEDULED_3, SCHEDULED_4, STEP_1, STEP_2 = 4, 7, 8, 11, 12
LAP, END_PULSES, RECEIVE, TRANSMIT = 13, 16, 18, 19
ENTRY_CYCLES = 4
INTERRUPTS_ON = 0x80
CLI, WDR = b"\xf8\x94", b"\xa8\x95"


class Tracer(EmulatedFirmware):
    """The emulated board, run by single instructions; notes (vector, cycles) of every interrupt.

    `locked` are the ticks at which the main program keeps interrupts off, with the CLI that begins it.
    """

    def __init__(self, image: Path, wiring: Wiring = UNO) -> None:
        super().__init__(image, wiring)
        self.chip = self.uno._chip
        self.done: list[tuple[int, int]] = []
        self.locked: set[int] = set()

    def run(self, ticks: int) -> None:
        end = self.uno.cycle + ticks
        while self.uno.cycle < end:
            self._step()
        super().run(0)  # takes over what came on pins and line

    def run_until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            self._step()

    def hold_interrupts(self, ticks: int) -> None:
        """Let the main program run on for a while as if it had switched interrupts off."""
        # An interrupt, or a lock, even one that has only read what it will restore, would switch them on.
        self.run_until(lambda: bool(self.chip.sreg & INTERRUPTS_ON) and self._next_instruction() != CLI)
        self.chip.sreg &= ~INTERRUPTS_ON
        self.uno.run(cycles=ticks)
        # On to the main program's next pass: the end of a lock that is open now would switch off what it found off.
        while not self.begins_pass():
            self.chip.run_to(self.chip.cycle + 1)
        self.chip.sreg |= INTERRUPTS_ON

    def begins_pass(self) -> bool:
        """True when the next instruction is WDR, with which a pass begins."""
        return self._next_instruction() == WDR

    def _next_instruction(self) -> bytes:
        return self.uno.flash[2 * self.chip.pc : 2 * self.chip.pc + 2]

    def taken(self, vector: int) -> set[int]:
        return {cycles for number, cycles in self.done if number == vector}

    def _step(self) -> None:
        chip = self.chip
        depth, at, was_locked = chip.sp, chip.cycle, not chip.sreg & INTERRUPTS_ON
        cli = self._next_instruction() == CLI
        chip.run_to(at + 1)
        if was_locked or cli:
            self.locked.update(range(at, chip.cycle))
        if chip.pc % 2 or not PIN_CHANGE <= chip.pc // 2 <= TRANSMIT:
            return
        vector, begun = chip.pc // 2, chip.cycle - ENTRY_CYCLES
        assert chip.sp == depth - 2
        while chip.sp < depth:
            chip.run_to(chip.cycle + 1)
        self.done.append((vector, chip.cycle - begun))
