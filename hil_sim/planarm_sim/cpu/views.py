"""The chip's insides, for tests, debuggers and whoever counts what a program does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import layout as at
from planarm_sim.cpu.bus import peek, poke
from planarm_sim.cpu.layout import Bytes, State
from planarm_sim.cpu.program import Program


class ChipViews:
    """What `Chip` shows of its state and memories."""

    _state: State
    _memory: Bytes
    _sram: Bytes
    _eeprom: Bytes
    _program: Program

    @property
    def pc(self) -> int:
        """Word address of the next instruction."""
        return int(self._state[at.PC])

    @pc.setter
    def pc(self, value: int) -> None:
        self._state[at.PC] = value & 0x3FFF

    @property
    def sreg(self) -> int:
        """Status register."""
        return int(self._state[at.SREG_BITS])

    @sreg.setter
    def sreg(self, value: int) -> None:
        self._state[at.SREG_BITS] = value & 0xFF

    @property
    def sp(self) -> int:
        """Stack pointer."""
        return int(self._state[at.SP])

    @sp.setter
    def sp(self, value: int) -> None:
        self._state[at.SP] = value & 0xFFFF

    @property
    def registers(self) -> NDArray[np.int64]:
        """The 32 general registers, a live view."""
        return self._state[:32]

    @property
    def sram(self) -> NDArray[np.uint8]:
        """The SRAM from data address 0x100 on, a live view."""
        return self._sram

    @property
    def eeprom(self) -> NDArray[np.uint8]:
        """The EEPROM, a live view."""
        return self._eeprom

    @property
    def flash(self) -> NDArray[np.uint8]:
        """The program memory; not to be written to."""
        return self._program.flash

    def peek_data(self, addresses: range) -> bytes:
        """What the program would read at data addresses now, without what reading does to I/O registers."""
        st = self._state.copy()
        return bytes(peek(st, self._memory, address) for address in addresses)

    def poke_data(self, address: int, data: bytes) -> None:
        """Write to the data space as the program does, with all that writing does, now."""
        for place, byte in enumerate(data, start=address):
            poke(self._state, self._memory, place, byte)
