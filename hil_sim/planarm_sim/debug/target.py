"""The chip as a debugger sees it: registers, one address space for all memories, breakpoints and watchpoints.

avr-gdb's address space: flash from 0 on, the data space (registers, I/O, SRAM) from 0x800000, EEPROM from 0x810000.
Reading I/O registers shows what the program would read, without what reading does; writing does what a write does.
"""

from __future__ import annotations

from typing import Final

from planarm_sim.cpu.chip import Chip, ResetCause, StopCause
from planarm_sim.insight import Observer

__all__ = ["DATA_SPACE", "EEPROM_SPACE", "REGISTER_BYTES", "Target"]

DATA_SPACE: Final = 0x800000
EEPROM_SPACE: Final = 0x810000
DATA_BYTES: Final = 0x900
REGISTER_BYTES: Final = (*([1] * 32), 1, 2, 4)
"""Sizes of r0 to r31, SREG, SP and PC (a byte address) as avr-gdb numbers them."""
SREG, SP, PC = 32, 33, 34


class Target:
    """A chip under a debugger; it runs by an observer, the board's own when the program is watched.

    Args:
        chip: the chip.
        observer: what watches it already, if anything does.
    """

    def __init__(self, chip: Chip, observer: Observer | None = None) -> None:
        self._chip = chip
        self._own = observer is None
        self._observer = observer or Observer(figures=False)
        if self._own:
            self._observer.begin(chip.cycle)
            chip.watch(self._observer)

    @property
    def cycle(self) -> int:
        """Clock cycles since power-up."""
        return self._chip.cycle

    @property
    def observer(self) -> Observer:
        """Breakpoints and watchpoints are there."""
        return self._observer

    def release(self) -> None:
        """Take away breakpoints and watchpoints, and run as before."""
        self._observer.breakpoints = frozenset()
        self._observer.watchpoints = frozenset()
        if self._own:
            self._chip.watch(None)

    def step(self) -> StopCause:
        """Run one instruction, or enter one interrupt."""
        self._observer.pass_breakpoint(self._chip.cycle)
        return self._chip.run_to(self._chip.cycle + 1)

    def reset(self) -> None:
        """Reset the chip as its reset pin does."""
        self._chip.reset(ResetCause.EXTERNAL)

    def read_register(self, number: int) -> bytes:
        """A register's bytes, the lowest first."""
        chip = self._chip
        value = {SREG: chip.sreg, SP: chip.sp, PC: 2 * chip.pc}.get(number)
        if value is None:
            value = int(chip.registers[number])
        return value.to_bytes(REGISTER_BYTES[number], "little")

    def write_register(self, number: int, data: bytes) -> None:
        """Set a register; bytes as `read_register` gives them."""
        value = int.from_bytes(data, "little")
        if number == SREG:
            self._chip.sreg = value
        elif number == SP:
            self._chip.sp = value
        elif number == PC:
            self._chip.pc = value // 2
        else:
            self._chip.registers[number] = value & 0xFF

    def read_memory(self, address: int, length: int) -> bytes:
        """Bytes from `address` on; fewer, or none, where the memory ends."""
        chip = self._chip
        if address >= EEPROM_SPACE:
            return chip.eeprom[address - EEPROM_SPACE : address - EEPROM_SPACE + length].tobytes()
        if address >= DATA_SPACE:
            first = address - DATA_SPACE
            return chip.peek_data(range(first, min(first + length, DATA_BYTES)))
        return chip.flash[address : address + length].tobytes()

    def write_memory(self, address: int, data: bytes) -> bool:
        """Write bytes; False where there is no memory for all of them."""
        chip = self._chip
        if address >= EEPROM_SPACE:
            first = address - EEPROM_SPACE
            if first + len(data) > len(chip.eeprom):
                return False
            for place, byte in enumerate(data, start=first):
                chip.eeprom[place] = byte
            return True
        if address >= DATA_SPACE:
            first = address - DATA_SPACE
            if first + len(data) > DATA_BYTES:
                return False
            chip.poke_data(first, data)
            return True
        if address + len(data) > len(chip.flash):
            return False
        chip.poke_flash(address, data)
        return True
