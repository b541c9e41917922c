"""What an instruction that accesses I/O does there, and entering an interrupt."""

from __future__ import annotations

from planarm_sim.cpu.bus import IVSEL, read_data_space, read_io, touch, write_data_space, write_io
from planarm_sim.cpu.compiled import constant, kernel  # kernel_cache: see there
from planarm_sim.cpu.flags import I
from planarm_sim.cpu.interrupts import ENTRY_CYCLES, WAKE_CYCLES, acknowledge
from planarm_sim.cpu.layout import (
    ACCESS,
    ACCESS_ADDRESS,
    ACCESS_PC,
    ACCESS_VALUE,
    ASLEEP,
    BOOT_START,
    CYCLE,
    HORIZON,
    IRQ_EARLIEST,
    PC,
    SP,
    SREG_BITS,
    Bytes,
    State,
)
from planarm_sim.cpu.registers import EIFR, MCUCR, PCIFR, PINB, PINC, PIND, SMCR, SREG, TIFR0, TIFR1, TIFR2
from planarm_sim.peripherals.watchdog import restart_watchdog

# Values of ACCESS. ACCESS_VALUE is the register that takes the byte read, the byte to write, the mask of a bit
# (above it the words to skip), or the return address to push.
NOTHING, READ, SKIP_CLEAR, SKIP_SET, WRITE, SET_BIT, CLEAR_BIT, CALL, RETURN, SLEEP, RESTART_WATCHDOG = (
    constant(n) for n in range(11)
)
LAST_READ = SKIP_SET
"""Accesses up to this one see the state one cycle before the instruction's end."""
PC_MASK = 0x3FFF
SLEEP_ENABLE = 1 << 0  # SMCR


@kernel
def note_access(st: State, access: int, address: int, value: int, pc: int) -> None:
    """Leave an access for the moment at which the instruction at `pc` ends."""
    st[ACCESS] = access
    st[ACCESS_ADDRESS] = address
    st[ACCESS_VALUE] = value
    st[ACCESS_PC] = pc


@kernel
def access_data(st: State, sram: Bytes, eeprom: Bytes, next_pc: int) -> int:
    """Do the access noted in the state, for the instruction at PC that ends at CYCLE; return where to go on."""
    access = st[ACCESS]
    address = int(st[ACCESS_ADDRESS])
    value = int(st[ACCESS_VALUE])
    st[ACCESS] = NOTHING
    if access == READ:
        st[value] = read_data_space(st, sram, eeprom, address)
    elif access == WRITE:
        enabled = st[SREG_BITS] & I
        write_data_space(st, sram, eeprom, address, value)
        if address == SREG and value & I and not enabled:  # one instruction, as after SEI
            st[IRQ_EARLIEST] = st[CYCLE] + 1
            st[HORIZON] = 0
    elif access in (SET_BIT, CLEAR_BIT):
        change_bit(st, eeprom, address, value, access == SET_BIT)
    elif access in (SKIP_CLEAR, SKIP_SET):
        is_set = read_io(st, eeprom, address) & value & 0xFF != 0
        if is_set == (access == SKIP_SET):
            st[CYCLE] += value >> 8
            return next_pc + (value >> 8)
    elif access == CALL:
        push_return(st, sram, eeprom, value)
    elif access == RETURN:
        return pop_return(st, sram, eeprom)
    elif access == SLEEP:
        if st[SMCR] & SLEEP_ENABLE:
            if st[SMCR] != SLEEP_ENABLE:
                touch(st, SMCR)  # all other modes sleep as idle mode does, with the peripherals' clocks running
            st[ASLEEP] = 1 + ((st[SMCR] >> 1) & 7)
            st[HORIZON] = 0
    else:
        restart_watchdog(st, int(st[CYCLE]))
    return next_pc


@kernel
def change_bit(st: State, eeprom: Bytes, address: int, mask: int, level: bool) -> None:
    """SBI or CBI: act on one bit alone, also of PINx and of registers whose ones clear flags.

    ATmega328P datasheet, note 3 of the register summary.
    """
    value = mask
    if address in (PINB, PINC, PIND, TIFR0, TIFR1, TIFR2, PCIFR, EIFR):
        if not level:
            return
    else:
        before = read_io(st, eeprom, address)
        value = before | mask if level else before & ~mask
    write_io(st, eeprom, address, value)


@kernel
def push_return(st: State, sram: Bytes, eeprom: Bytes, address: int) -> None:
    """Push a return address, low byte first."""
    for byte in (address & 0xFF, address >> 8):
        write_data_space(st, sram, eeprom, int(st[SP]), byte)
        st[SP] = (st[SP] - 1) & 0xFFFF


@kernel
def pop_return(st: State, sram: Bytes, eeprom: Bytes) -> int:
    """Pop a return address, high byte first."""
    address = 0
    for _ in range(2):
        st[SP] = (st[SP] + 1) & 0xFFFF
        address = (address << 8) | read_data_space(st, sram, eeprom, int(st[SP]))
    return int(address & PC_MASK)


@kernel
def take_interrupt(st: State, sram: Bytes, eeprom: Bytes, vector: int) -> None:
    """Enter an interrupt: four cycles, four more out of sleep (datasheet, 7.7.1)."""
    st[CYCLE] += ENTRY_CYCLES + (WAKE_CYCLES if st[ASLEEP] else 0)
    st[ASLEEP] = 0
    push_return(st, sram, eeprom, int(st[PC]))
    st[SREG_BITS] &= ~I
    acknowledge(st, vector)
    st[PC] = 2 * vector + (st[BOOT_START] if st[MCUCR] & IVSEL else 0)
