"""The data space as the CPU reads and writes it: registers, I/O, extended I/O, SRAM.

An access happens in the last clock cycle of its instruction. A read sees the state at the start of that cycle,
a write takes effect at its end; the caller has let happen what is due until then. CYCLE holds the end of the
instruction.
"""

from __future__ import annotations

import numpy as np

from planarm_sim.cpu.compiled import inlined, inner, kernel  # kernel_cache: see there
from planarm_sim.cpu.interrupts import note_raised, pending_interrupts
from planarm_sim.cpu.layout import (
    ACCESS_PC,
    CHANGES,
    CYCLE,
    HORIZON,
    IVCE_UNTIL,
    OUTSIDE_ADDRESS,
    OUTSIDE_PC,
    SOMETHING_CHANGED,
    SP,
    SREG_BITS,
    TIMER0,
    TIMER1,
    TIMER2,
    TOUCHED,
    WATCH,
    Bytes,
    State,
)
from planarm_sim.cpu.registers import (
    ADCH,
    ADCL,
    ADCSRA,
    ADCSRB,
    ADMUX,
    EEARH,
    EEARL,
    EECR,
    EEDR,
    EICRA,
    EIFR,
    EIMSK,
    GPIOR0,
    GPIOR1,
    GPIOR2,
    GTCCR,
    ICR1H,
    MCUCR,
    MCUSR,
    OCR0B,
    OCR1BH,
    OCR2B,
    PCICR,
    PCIFR,
    PCMSK0,
    PCMSK1,
    PCMSK2,
    PINB,
    PIND,
    PORTD,
    PRR,
    READS_PLAIN,
    SMCR,
    SPL,
    SPMCSR,
    SRAM_END,
    SRAM_START,
    SREG,
    TCCR0A,
    TCCR1A,
    TCCR2A,
    TCNT0,
    TCNT1L,
    TCNT2,
    TIFR0,
    TIFR2,
    TIMSK0,
    TIMSK2,
    UBRR0H,
    UCSR0A,
    UCSR0B,
    UCSR0C,
    UDR0,
    WDTCSR,
)
from planarm_sim.peripherals.adc import ACME, ADTS, BY_COMPARATOR, read_adc, write_adc
from planarm_sim.peripherals.eeprom import read_control, write_control
from planarm_sim.peripherals.ports import PUD, read_pins, refresh_port, write_port
from planarm_sim.peripherals.power import is_off, write_power_reduction
from planarm_sim.peripherals.self_programming import BLBSET, SIGRD, write_spm_control
from planarm_sim.peripherals.timer_registers import (
    read_count8,
    read_timer1,
    read_timer_flags,
    write_prescaler_control,
    write_timer1,
    write_timer8,
    write_timer_flags,
    write_timer_mask,
)
from planarm_sim.peripherals.timers import advance_timer, plan_timer
from planarm_sim.peripherals.usart import read_data, write_data, write_usart
from planarm_sim.peripherals.watchdog import write_watchdog

IVSEL, IVCE = 1 << 1, 1 << 0  # MCUCR
IVCE_CYCLES = 4
UMSEL = 3 << 6  # UCSR0C: synchronous and SPI modes, which are not modelled
NO_REGISTER_1, NO_REGISTER_2 = 0x83, 0xC3  # gaps among timer 1's and the USART's registers

# Bits that can be written, where not all of them can.
WRITABLE = np.full(256, 0xFF, dtype=np.int64)
WRITABLE[[EIMSK, EICRA, PCICR, PCMSK1, SMCR, EEARH]] = (3, 15, 7, 0x7F, 15, 3)


@inner
def touch(st: State, address: int) -> None:
    """Note the first access to a register whose part is not modelled."""
    if st[TOUCHED + address] == 0:
        st[TOUCHED + address] = st[ACCESS_PC] + 1


@inner
def touch_outside(st: State, address: int) -> None:
    """Note the first access where there is no memory for it."""
    if st[OUTSIDE_ADDRESS] == 0:
        st[OUTSIDE_ADDRESS] = address + 1
        st[OUTSIDE_PC] = st[ACCESS_PC]


@inlined
def read_data_space(st: State, memory: Bytes, address: int) -> int:
    """Read one byte; beyond the SRAM there is nothing, which reads as 0 and is noted."""
    if address < SRAM_START:
        return read_io(st, memory, address)
    if address < SRAM_END:
        return int(memory[address - SRAM_START])
    touch_outside(st, address)
    return 0


@inlined
def write_data_space(st: State, memory: Bytes, address: int, value: int) -> None:
    """Write one byte."""
    if address < 32:
        st[address] = value
    elif address < SRAM_START:
        write_io(st, memory, address, value)
    elif address < SRAM_END:
        memory[address - SRAM_START] = value
    else:
        touch_outside(st, address)


@kernel
def peek(st: State, memory: Bytes, address: int) -> int:
    """As `read_data_space`, for Python."""
    return int(read_data_space(st, memory, address))


@kernel
def poke(st: State, memory: Bytes, address: int, value: int) -> None:
    """As `write_data_space`, for Python."""
    write_data_space(st, memory, address, value)


@inlined
def read_io(st: State, memory: Bytes, address: int) -> int:  # noqa: PLR0911 - one line per part
    """Read a general or I/O register (address below 256)."""
    if READS_PLAIN[address]:
        return int(st[address])
    if SPL <= address <= SREG:
        if address == SREG:
            return int(st[SREG_BITS])
        return int(st[SP] & 0xFF if address == SPL else st[SP] >> 8)
    cycle = st[CYCLE] - 1
    if PINB <= address <= PIND:
        return read_pins(st, (address - PINB) // 3, cycle)
    if address in (UCSR0A, UCSR0B, PCIFR, EIFR, WDTCSR, SPMCSR, ADCSRA, ADCSRB, ADMUX):
        return int(st[address])
    st[CHANGES] += 1  # what follows depends on time, or reading it changes something
    if TCNT1L <= address <= ICR1H:
        return read_timer1(st, address, cycle)
    if address in (TCNT0, TCNT2):
        return read_count8(st, TIMER0 if address == TCNT0 else TIMER2, cycle)
    if TIFR0 <= address <= TIFR2:
        return read_timer_flags(st, address, cycle)
    if address == UDR0:
        return read_data(st)
    if address in (ADCL, ADCH):
        return read_adc(st, address)
    if address == EECR:
        return read_control(st, cycle)
    touch(st, address)
    return int(st[address])


@inlined
def write_io(st: State, memory: Bytes, address: int, value: int) -> None:
    """Write an I/O register (address 32 to 255)."""
    cycle = st[CYCLE]
    if SPL <= address <= SREG:
        write_cpu_register(st, address, value)
        return
    if st[PRR] and is_off(st, address):
        return
    if PINB <= address <= PORTD:
        write_port(st, address, value, cycle)
    elif TCCR1A <= address <= OCR1BH and address != NO_REGISTER_1:
        write_timer1(st, address, value, cycle)
    elif address == UDR0:
        write_data(st, value, cycle)
    elif TCCR0A <= address <= OCR0B or TCCR2A <= address <= OCR2B:
        write_timer8(st, TIMER0 if address <= OCR0B else TIMER2, address, value, cycle)
    elif address in (GPIOR0, GPIOR1, GPIOR2):
        st[address] = value
    else:
        before = pending_interrupts(st) if st[WATCH] else 0
        write_rare_io(st, memory, address, value, cycle)
        if st[WATCH]:
            note_raised(st, before, cycle)
        st[HORIZON] = SOMETHING_CHANGED


@inner
def write_cpu_register(st: State, address: int, value: int) -> None:
    """Write SPL, SPH or SREG."""
    if address == SREG:
        st[SREG_BITS] = value
    elif address == SPL:
        st[SP] = (st[SP] & 0xFF00) | value
    else:
        st[SP] = (st[SP] & 0x00FF) | (value << 8)


@inner
def write_rare_io(st: State, memory: Bytes, address: int, value: int, cycle: int) -> None:
    """Write a register whose effect the CPU loop must look at before its next instruction."""
    if TIFR0 <= address <= TIFR2:
        write_timer_flags(st, address, value, cycle)
    elif TIMSK0 <= address <= TIMSK2:
        write_timer_mask(st, address, value, cycle)
    elif UCSR0A <= address <= UBRR0H and address != NO_REGISTER_2:
        write_usart(st, address, value, cycle)
        if address == UCSR0C and value & UMSEL:
            touch(st, address)
    elif address in (PCIFR, EIFR):
        st[address] &= ~value
    elif address in (EIMSK, PCICR, EICRA, PCMSK0, PCMSK1, PCMSK2, SMCR, EEDR, EEARL, EEARH):
        st[address] = value & WRITABLE[address]
    elif address == MCUSR:
        st[address] &= value
    elif address == EECR:
        write_control(st, memory, value, cycle)
    elif address == WDTCSR:
        write_watchdog(st, value, cycle)
    elif address == GTCCR:
        write_prescaler_control(st, value, cycle)
    else:
        write_rarest_io(st, address, value, cycle)


@inner
def write_rarest_io(st: State, address: int, value: int, cycle: int) -> None:
    """Write one of the others, or a register of a part that is not modelled."""
    if address == MCUCR:
        write_mcu_control(st, value, cycle)
    elif address == SPMCSR:
        write_spm_control(st, value, cycle)
        if value & (SIGRD | BLBSET):
            touch(st, address)  # signature, fuses and lock bits are not modelled
    elif ADCL <= address <= ADMUX:
        for t in (TIMER0, TIMER1):  # what they did so far triggers nothing
            advance_timer(st, t, cycle)
        write_adc(st, address, value, cycle)
        for t in (TIMER0, TIMER1):
            plan_timer(st, t)
        if address == ADCSRB and (value & ACME or value & ADTS == BY_COMPARATOR):
            touch(st, address)  # the analogue comparator is not modelled
    elif address == PRR:
        write_power_reduction(st, value, cycle)
    else:
        touch(st, address)
        st[address] = value


@inner
def write_mcu_control(st: State, value: int, cycle: int) -> None:
    """Write MCUCR: PUD at any time, IVSEL only within four cycles of IVCE (datasheet, 12.5)."""
    before = st[MCUCR]
    ivsel = before & IVSEL
    if value & IVCE:
        st[IVCE_UNTIL] = cycle + IVCE_CYCLES
    elif cycle <= st[IVCE_UNTIL]:
        ivsel = value & IVSEL
    st[MCUCR] = (value & PUD) | ivsel
    if (before ^ value) & PUD:
        for port in range(3):
            refresh_port(st, port, cycle)
