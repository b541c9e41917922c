"""EEPROM: timed writes behind the EEMPE window, and the cycles for which the CPU is halted.

ATmega328P datasheet, 8.4 and 8.6.3: EEMPE opens a window of four cycles, a read halts the CPU for four cycles
and the start of a write for two; erase and write takes 3.4 ms, each alone 1.8 ms (table 8-1).
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    CYCLE,
    DUE_EEPROM,
    EE_BUSY_ADDRESS,
    EE_BUSY_DATA,
    EE_BUSY_MODE,
    EE_WRITE_UNTIL,
    HORIZON,
    NEVER,
    SPM_BUSY,
    Bytes,
    State,
)
from planarm_sim.cpu.registers import EEARH, EEARL, EECR, EEDR, EEPROM_BYTES, EEPROM_START
from planarm_sim.peripherals.self_programming import erase_buffer

EEPM, EERIE, EEMPE, EEPE, EERE = 3 << 4, 1 << 3, 1 << 2, 1 << 1, 1 << 0
ERASE_AND_WRITE, ERASE, WRITE = 0, 1, 2
WRITE_CYCLES, HALF_WRITE_CYCLES = 54_400, 28_800  # 3.4 ms and 1.8 ms at 16 MHz
READ_HALT, WRITE_HALT = 4, 2
WINDOW_CYCLES = 4


@inner
def read_control(st: State, cycle: int) -> int:
    """Read EECR; EEMPE reads one while its window is open."""
    return int(st[EECR] | (EEMPE if cycle < st[EE_WRITE_UNTIL] else 0))


@inner
def write_control(st: State, memory: Bytes, value: int, cycle: int) -> None:
    """Write EECR: read a byte, start a write, open the window."""
    busy = st[EECR] & EEPE
    address = (st[EEARL] | (st[EEARH] << 8)) % EEPROM_BYTES
    mode = st[EECR] & EEPM if busy else value & EEPM
    st[EECR] = mode | (value & EERIE) | busy
    if not busy and value & EEPE and cycle <= st[EE_WRITE_UNTIL] and not st[SPM_BUSY]:
        st[EE_WRITE_UNTIL] = 0
        erase_buffer(st)  # a page load is lost (27.8.2)
        st[EE_BUSY_ADDRESS] = address
        st[EE_BUSY_DATA] = st[EEDR]
        st[EE_BUSY_MODE] = mode >> 4
        st[EECR] |= EEPE
        st[DUE_EEPROM] = cycle + (WRITE_CYCLES if mode == ERASE_AND_WRITE else HALF_WRITE_CYCLES)
        st[HORIZON] = min(st[HORIZON], st[DUE_EEPROM])
        st[CYCLE] += WRITE_HALT
    elif value & EEMPE:
        st[EE_WRITE_UNTIL] = cycle + WINDOW_CYCLES
    if not busy and value & EERE and st[EECR] & EEPE == 0:
        st[EEDR] = memory[EEPROM_START + address]
        st[CYCLE] += READ_HALT


@inner
def finish_write(st: State, memory: Bytes) -> None:
    """The programming time is over: the byte is there, and EEPE reads zero."""
    address = st[EE_BUSY_ADDRESS]
    mode = st[EE_BUSY_MODE]
    if mode == ERASE:
        memory[EEPROM_START + address] = 0xFF
    elif mode == WRITE:
        memory[EEPROM_START + address] &= st[EE_BUSY_DATA]
    else:
        memory[EEPROM_START + address] = st[EE_BUSY_DATA]
    st[EECR] &= ~EEPE
    st[DUE_EEPROM] = NEVER
