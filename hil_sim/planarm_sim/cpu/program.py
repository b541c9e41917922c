"""The flash and its decoded words together, never changed in place: snapshots share them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.decode import ERASED_WORD, FLASH_WORDS, decode, decode_part
from planarm_sim.cpu.fusion import fuse
from planarm_sim.cpu.layout import PAGE_WORDS

NRWW_START_WORD = 0x3800
"""First word of the no-read-while-write section (ATmega328P datasheet, table 27-14)."""


@dataclass(frozen=True, slots=True)
class Program:
    """What is in the flash.

    Attributes:
        flash: FLASH_BYTES bytes.
        code: one decoded word per word; see `decode`.
        fused: the same with pairs fused, for the CPU loop; see `fusion`.
        erased_runs: erased words run as what they nearly are, SBRS r31, 7, as chips are known to do: an empty
            chip comes round to its boot loader. Otherwise they are undefined opcodes.
    """

    flash: NDArray[np.uint8]
    code: NDArray[np.int64]
    erased_runs: bool
    fused: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        """Fuse pairs for the CPU loop."""
        object.__setattr__(self, "fused", fuse(self.code))

    @classmethod
    def of(cls, flash: NDArray[np.uint8], *, erased_runs: bool) -> Self:
        """Decode a flash image."""
        return cls(flash, decode(flash, erased_runs=erased_runs), erased_runs)

    def with_page_erased(self, word: int) -> Program:
        """The same with the page erased in which `word` lies."""
        return self._with_page(word, np.full(PAGE_WORDS, ERASED_WORD, dtype=np.int64))

    def with_page_written(self, word: int, page: NDArray[np.int64]) -> Program:
        """The same with PAGE_WORDS words written over the page in which `word` lies; bits are only cleared."""
        first = word - word % PAGE_WORDS
        return self._with_page(word, self.flash.view("<u2")[first : first + PAGE_WORDS] & page)

    def with_bytes(self, address: int, data: bytes) -> Program:
        """The same with bytes replaced from `address` on, as a programmer or a debugger does it."""
        flash = self.flash.copy()
        flash[address : address + len(data)] = np.frombuffer(data, dtype=np.uint8)
        return Program.of(flash, erased_runs=self.erased_runs)

    def rww_blocked(self) -> Program:
        """The same as the CPU sees it while the RWW section cannot be read: bytes read as erased, no opcode runs."""
        flash, code = self.flash.copy(), self.code.copy()
        flash[: 2 * NRWW_START_WORD] = 0xFF
        code[:NRWW_START_WORD] = op.UNDEFINED
        return Program(flash, code, self.erased_runs)

    def _with_page(self, word: int, page: NDArray[np.int64]) -> Program:
        first = word - word % PAGE_WORDS
        flash, code = self.flash.copy(), self.code.copy()
        flash.view("<u2")[first : first + PAGE_WORDS] = page
        places = np.arange(first - 1, first + PAGE_WORDS) % FLASH_WORDS  # the word before may skip over the first
        code[places] = decode_part(flash, places, erased_runs=self.erased_runs)
        return Program(flash, code, self.erased_runs)
