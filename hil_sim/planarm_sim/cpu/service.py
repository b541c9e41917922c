"""What happens between two instructions: accesses to I/O, events, interrupts, sleep, and reasons to stop."""

from __future__ import annotations

from planarm_wire.kernel_cache import kernel

from planarm_sim.cpu.bus import IVSEL, read_data_space, read_io, write_data_space, write_io
from planarm_sim.cpu.events import process_events
from planarm_sim.cpu.flags import I
from planarm_sim.cpu.interrupts import ENTRY_CYCLES, WAKE_CYCLES, acknowledge, lowest_bit, pending_interrupts
from planarm_sim.cpu.layout import (
    ASLEEP,
    BOOT_START,
    CYCLE,
    EDGE_COUNT,
    EDGE_LIMIT,
    HORIZON,
    IRQ_EARLIEST,
    NEVER,
    PC,
    RESET_REQUEST,
    SP,
    SREG_BITS,
    TX_COUNT,
    TX_LIMIT,
    Bytes,
    State,
)
from planarm_sim.cpu.registers import EIFR, MCUCR, PCIFR, PINB, PINC, PIND, SMCR, SREG, TIFR0, TIFR1, TIFR2
from planarm_sim.peripherals.watchdog import restart_watchdog

# Why the CPU loop ends.
RUNNING, REACHED, AT_BREAK, AT_BAD_OPCODE, ASLEEP_FOR_EVER, LOG_FULL, RESET_WANTED, FLASH_WRITE = range(8)
# What an instruction wants from I/O.
(
    ACCESS_NONE,
    ACCESS_READ,
    ACCESS_WRITE,
    ACCESS_SET_BIT,
    ACCESS_CLEAR_BIT,
    ACCESS_SKIP_CLEAR,
    ACCESS_SKIP_SET,
    ACCESS_CALL,
    ACCESS_RETURN,
    ACCESS_SLEEP,
    ACCESS_RESTART_WATCHDOG,
) = range(11)
PC_MASK = 0x3FFF
SLEEP_ENABLE = 1 << 0  # SMCR


@kernel
def access_data(st: State, sram: Bytes, eeprom: Bytes, access: int, address: int, value: int, pc: int) -> int:
    """Do an access that ends at CYCLE for the instruction at PC; return where the program goes on.

    `value` is the byte to write, the register that takes the byte read, the mask of a bit (and above it the
    words to skip), or the return address to push.
    """
    if access == ACCESS_READ:
        st[value] = read_data_space(st, sram, eeprom, address)
    elif access == ACCESS_WRITE:
        enabled = st[SREG_BITS] & I
        write_data_space(st, sram, eeprom, address, value)
        if address == SREG and value & I and not enabled:
            delay_interrupts(st)
    elif access == ACCESS_SET_BIT or access == ACCESS_CLEAR_BIT:
        change_bit(st, eeprom, address, value, access == ACCESS_SET_BIT)
    elif access == ACCESS_SKIP_CLEAR or access == ACCESS_SKIP_SET:
        is_set = read_io(st, eeprom, address) & value & 0xFF != 0
        if is_set == (access == ACCESS_SKIP_SET):
            st[CYCLE] += value >> 8
            pc += value >> 8
    elif access == ACCESS_CALL:
        push_return(st, sram, eeprom, value)
    elif access == ACCESS_RETURN:
        pc = pop_return(st, sram, eeprom)
    elif access == ACCESS_SLEEP:
        if st[SMCR] & SLEEP_ENABLE:
            st[ASLEEP] = 1 + ((st[SMCR] >> 1) & 7)
            st[HORIZON] = 0
    else:
        process_events(st, eeprom, int(st[CYCLE]))
        restart_watchdog(st, int(st[CYCLE]))
    return int(pc)


@kernel
def delay_interrupts(st: State) -> None:
    """After I is set, one instruction is executed before an interrupt is taken."""
    st[IRQ_EARLIEST] = st[CYCLE] + 1
    st[HORIZON] = min(st[HORIZON], st[CYCLE] + 1)


@kernel
def change_bit(st: State, eeprom: Bytes, address: int, mask: int, level: bool) -> None:
    """SBI or CBI: act on one bit alone, also of PINx and of registers whose ones clear flags.

    ATmega328P datasheet, note 3 of the register summary.
    """
    if address in (PINB, PINC, PIND, TIFR0, TIFR1, TIFR2, PCIFR, EIFR):
        if level:
            write_io(st, eeprom, address, mask)
    else:
        before = read_io(st, eeprom, address)
        write_io(st, eeprom, address, before | mask if level else before & ~mask)


@kernel
def push_return(st: State, sram: Bytes, eeprom: Bytes, address: int) -> None:
    """Push a return address, low byte first."""
    write_data_space(st, sram, eeprom, int(st[SP]), address & 0xFF)
    st[SP] = (st[SP] - 1) & 0xFFFF
    write_data_space(st, sram, eeprom, int(st[SP]), address >> 8)
    st[SP] = (st[SP] - 1) & 0xFFFF


@kernel
def pop_return(st: State, sram: Bytes, eeprom: Bytes) -> int:
    """Pop a return address, high byte first."""
    st[SP] = (st[SP] + 1) & 0xFFFF
    high = read_data_space(st, sram, eeprom, int(st[SP]))
    st[SP] = (st[SP] + 1) & 0xFFFF
    return int(((high << 8) | read_data_space(st, sram, eeprom, int(st[SP]))) & PC_MASK)


@kernel
def take_interrupt(st: State, sram: Bytes, eeprom: Bytes, vector: int) -> None:
    """Enter an interrupt: four cycles, four more out of sleep (datasheet, 7.7.1)."""
    st[CYCLE] += ENTRY_CYCLES + (WAKE_CYCLES if st[ASLEEP] else 0)
    st[ASLEEP] = 0
    push_return(st, sram, eeprom, int(st[PC]))
    st[SREG_BITS] &= ~I
    acknowledge(st, vector)
    st[PC] = 2 * vector + (st[BOOT_START] if st[MCUCR] & IVSEL else 0)


@kernel
def service(st: State, sram: Bytes, eeprom: Bytes, target: int) -> int:
    """Let events and interrupts happen; RUNNING with HORIZON set when the CPU goes on, else why it stops."""
    while True:
        cycle = int(st[CYCLE])
        due = process_events(st, eeprom, cycle)
        if st[RESET_REQUEST]:
            return RESET_WANTED
        if cycle >= target:
            return REACHED
        if st[EDGE_COUNT] >= st[EDGE_LIMIT] or st[TX_COUNT] >= st[TX_LIMIT]:
            return LOG_FULL
        horizon = min(due, target)
        enabled = st[SREG_BITS] & I
        if enabled:
            pending = pending_interrupts(st)
            if pending:
                if cycle >= st[IRQ_EARLIEST]:
                    take_interrupt(st, sram, eeprom, lowest_bit(pending))
                    continue
                horizon = min(horizon, int(st[IRQ_EARLIEST]))
        if st[ASLEEP]:
            if not enabled and due == NEVER:
                return ASLEEP_FOR_EVER
            st[CYCLE] = horizon
            continue
        st[HORIZON] = horizon
        return RUNNING
