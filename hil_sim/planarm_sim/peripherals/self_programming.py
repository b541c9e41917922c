"""Flash that the program itself erases and writes, page by page (ATmega328P datasheet, 27).

SPMCSR opens a window of four cycles for one SPM instruction (27.9.1). What changes the flash's bytes is done at
the start of the operation: until its end and RWWSRE nobody can read them, as the RWW section is blocked and the
CPU stands still for pages of the other one (27.4).
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inner, kernel  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    BOOT_START,
    CYCLE,
    DUE_SPM,
    EMPTY,
    NEVER,
    PAGE_BUFFER,
    PAGE_WORDS,
    PC,
    SPM_BUSY,
    SPM_HALT_UNTIL,
    State,
)
from planarm_sim.cpu.program import NRWW_START_WORD, Program
from planarm_sim.cpu.registers import EECR, SPMCSR

SPMIE, RWWSB, SIGRD, RWWSRE, BLBSET, PGWRT, PGERS, SELFPRGEN = (1 << bit for bit in range(7, -1, -1))
COMMAND = SIGRD | RWWSRE | BLBSET | PGWRT | PGERS | SELFPRGEN
FILL, ERASE, WRITE, SET_LOCK_BITS = SELFPRGEN, PGERS | SELFPRGEN, PGWRT | SELFPRGEN, BLBSET | SELFPRGEN
ENABLE_RWW, READ_SIGNATURE = RWWSRE | SELFPRGEN, SIGRD | SELFPRGEN
WINDOW_CYCLES = 4
PAGE_CYCLES = 72_000
"""Erasing or writing a page: the longest of 3.7 to 4.5 ms (27.8.12), at 16 MHz."""
EEPE = 1 << 1  # EECR


@inner
def write_spm_control(st: State, value: int, cycle: int) -> None:
    """Write SPMCSR: choose what the next SPM does; nothing but SPMIE while flash or EEPROM is being written."""
    if st[EECR] & EEPE:  # 27.8.8
        return
    st[SPMCSR] = (st[SPMCSR] & ~SPMIE) | (value & SPMIE)
    if st[SPM_BUSY]:
        return
    command = value & COMMAND
    if command not in (FILL, ERASE, WRITE, SET_LOCK_BITS, ENABLE_RWW, READ_SIGNATURE):
        return  # "any other combination will have no effect"
    st[SPMCSR] = (st[SPMCSR] & ~COMMAND) | command
    st[DUE_SPM] = cycle + WINDOW_CYCLES
    if command == ENABLE_RWW:
        erase_buffer(st)


@kernel
def end_command(st: State) -> None:
    """The window has closed without SPM, or the page is erased or written."""
    st[SPMCSR] &= ~COMMAND
    st[SPM_BUSY] = 0
    st[DUE_SPM] = NEVER


@kernel
def erase_buffer(st: State) -> None:
    """Forget the temporary page buffer."""
    for word in range(PAGE_WORDS):
        st[PAGE_BUFFER + word] = EMPTY


def execute_spm(st: State, program: Program) -> Program:
    """Do the SPM instruction at PC and return the flash after it.

    Outside the boot section, and outside the window, SPM does nothing. A word of the buffer takes the first value
    loaded only; writing a page clears bits and never sets them (27.8.1 to 27.8.3).
    """
    place = int(st[PC])
    st[PC] += 1
    st[CYCLE] += 1
    command = int(st[SPMCSR]) & COMMAND
    if place < st[BOOT_START] or st[SPM_BUSY] or not command:
        return program
    end_command(st)
    word = (int(st[30]) | int(st[31]) << 8) >> 1 & 0x3FFF
    if command == FILL:
        st[SPMCSR] &= ~RWWSB
        slot = PAGE_BUFFER + word % PAGE_WORDS
        if st[slot] == EMPTY:
            st[slot] = st[0] | st[1] << 8
    elif command == ENABLE_RWW:
        st[SPMCSR] &= ~RWWSB
    elif command in (ERASE, WRITE):
        _occupy(st, command, word)
        if command == ERASE:
            return program.with_page_erased(word)
        page = st[PAGE_BUFFER : PAGE_BUFFER + PAGE_WORDS] & 0xFFFF  # EMPTY becomes 0xFFFF, which changes nothing
        erase_buffer(st)
        return program.with_page_written(word, page)
    return program


def _occupy(st: State, command: int, word: int) -> None:
    """The flash is busy with a page: of the RWW section, which is blocked, or of the other, for which the CPU halts."""
    done = int(st[CYCLE]) + PAGE_CYCLES
    st[SPMCSR] |= command
    st[SPM_BUSY] = 1
    st[DUE_SPM] = done
    if word < NRWW_START_WORD:
        st[SPMCSR] |= RWWSB
    else:
        st[SPM_HALT_UNTIL] = done
