"""What an instruction that accesses I/O does there, and entering an interrupt."""

from __future__ import annotations

from planarm_sim.cpu.bus import IVSEL, read_data_space, touch, touch_outside, write_data_space
from planarm_sim.cpu.compiled import constant, inlined, inner  # kernel_cache: see there
from planarm_sim.cpu.flags import I
from planarm_sim.cpu.interrupts import ENTRY_CYCLES, WAKE_CYCLES, acknowledge
from planarm_sim.cpu.layout import (
    ACCESS,
    ACCESS_ADDRESS,
    ACCESS_PC,
    ACCESS_VALUE,
    ASLEEP,
    BOOT_START,
    CHANGES,
    CYCLE,
    ENTERED_AT,
    ENTERED_VECTOR,
    HORIZON,
    IRQ_EARLIEST,
    LOOK_AT,
    NOTHING_CHANGED,
    PC,
    PENDING,
    SOMETHING_CHANGED,
    SP,
    SREG_BITS,
    Bytes,
    State,
)
from planarm_sim.cpu.registers import (
    EIFR,
    MCUCR,
    PCIFR,
    PINB,
    PINC,
    PIND,
    SMCR,
    SRAM_END,
    SRAM_START,
    SREG,
    TIFR0,
    TIFR1,
    TIFR2,
)
from planarm_sim.peripherals.watchdog import restart_watchdog

# Values of ACCESS. ACCESS_VALUE is the register that takes the byte read, the byte to write, the mask of a bit
# (above it the words to skip), or the return address to push.
NOTHING, READ, SKIP_CLEAR, SKIP_SET, WRITE, SET_BIT, CLEAR_BIT, CALL, RETURN, SLEEP, RESTART_WATCHDOG, TURN = (
    constant(n) for n in range(12)
)
LAST_READ = SKIP_SET
"""Accesses up to this one see the state one cycle before the instruction's end."""
LAST_WRITE = CLEAR_BIT
PC_MASK = 0x3FFF
SLEEP_ENABLE = 1 << 0  # SMCR


@inlined
def note_access(st: State, access: int, address: int, value: int, pc: int) -> None:
    """Leave an access for the moment at which the instruction at `pc` ends."""
    st[ACCESS] = access
    st[ACCESS_ADDRESS] = address
    st[ACCESS_VALUE] = value
    st[ACCESS_PC] = pc
    st[LOOK_AT] = 0


@inlined
def note_turn(st: State) -> None:
    """Leave the turn of a loop that is watched for the CPU loop's look-up."""
    st[ACCESS] = TURN
    st[LOOK_AT] = 0


@inner
def look_early(st: State, cycle: int) -> None:
    """Have the CPU loop look for interrupts at `cycle` at the latest."""
    st[HORIZON] = min(st[HORIZON], cycle)
    st[LOOK_AT] = min(st[LOOK_AT], cycle)


@inlined
def access_data(st: State, memory: Bytes) -> None:
    """Do the access noted in the state, for the instruction that ends at CYCLE; PC is where it goes on."""
    access = st[ACCESS]
    address = int(st[ACCESS_ADDRESS])
    value = int(st[ACCESS_VALUE])
    st[ACCESS] = NOTHING
    if access <= LAST_READ:
        byte = read_data_space(st, memory, address)
        if access == READ:
            st[value] = byte
        elif (byte & value & 0xFF != 0) == (access == SKIP_SET):
            st[CYCLE] += value >> 8
            st[PC] += value >> 8
        return
    st[CHANGES] += 1
    if access <= LAST_WRITE:
        if access != WRITE:
            value = changed_bit(st, address, value, access == SET_BIT)
        enabled = st[SREG_BITS] & I
        write_data_space(st, memory, address, value)
        if address == SREG and value & I and not enabled:  # one instruction, as after SEI
            st[IRQ_EARLIEST] = st[CYCLE] + 1
            st[HORIZON] = SOMETHING_CHANGED
    elif access == CALL:
        push_return(st, memory, value)
    elif access == RETURN:
        st[PC] = pop_return(st, memory)
    elif access == SLEEP:
        if st[SMCR] & SLEEP_ENABLE:
            if st[SMCR] != SLEEP_ENABLE:
                touch(st, SMCR)  # all other modes sleep as idle mode does, with the peripherals' clocks running
            st[ASLEEP] = 1
            st[HORIZON] = SOMETHING_CHANGED
    else:
        restart_watchdog(st, int(st[CYCLE]))


@inner
def changed_bit(st: State, address: int, mask: int, level: bool) -> int:
    """Return what SBI or CBI writes: one bit alone, also of PINx and of registers whose ones clear flags.

    ATmega328P datasheet, note 3 of the register summary. What changes by itself in the I/O registers that these
    instructions reach is in such registers only, so the others are taken as they were last written.
    """
    if address in (PINB, PINC, PIND, TIFR0, TIFR1, TIFR2, PCIFR, EIFR):
        return mask if level else 0
    before = int(st[address])
    return before | mask if level else before & ~mask


@inner
def push_return(st: State, memory: Bytes, address: int) -> None:
    """Push a return address, low byte first; what falls outside the SRAM is lost and noted."""
    for shift in range(0, 16, 8):
        place = int(st[SP])
        if SRAM_START <= place < SRAM_END:
            memory[place - SRAM_START] = (address >> shift) & 0xFF
        else:
            touch_outside(st, place)
        st[SP] = (place - 1) & 0xFFFF


@inner
def pop_return(st: State, memory: Bytes) -> int:
    """Pop a return address, high byte first; what lies outside the SRAM reads as 0 and is noted."""
    address = 0
    for _ in range(2):
        place = int((st[SP] + 1) & 0xFFFF)
        st[SP] = place
        address <<= 8
        if SRAM_START <= place < SRAM_END:
            address |= int(memory[place - SRAM_START])
        else:
            touch_outside(st, place)
    return address & PC_MASK


@inlined
def take_interrupt(st: State, memory: Bytes, vector: int) -> None:
    """Enter an interrupt: four cycles, four more out of sleep (datasheet, 7.7.1)."""
    st[CYCLE] += ENTRY_CYCLES + (WAKE_CYCLES if st[ASLEEP] else 0)
    st[ASLEEP] = 0
    st[ENTERED_AT] = st[CYCLE]
    st[ENTERED_VECTOR] = vector
    st[ACCESS_PC] = st[PC]
    push_return(st, memory, int(st[PC]))
    st[SREG_BITS] &= ~I
    if acknowledge(st, vector):
        st[PENDING] &= ~(1 << vector)
    st[HORIZON] = NOTHING_CHANGED
    st[PC] = 2 * vector + (st[BOOT_START] if st[MCUCR] & IVSEL else 0)
