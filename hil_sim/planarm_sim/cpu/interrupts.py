"""Interrupt sources, their priority, and what taking one clears (ATmega328P datasheet, 7.7 and table 12-6)."""

from __future__ import annotations

from planarm_sim.cpu.compiled import inlined, inner, kernel  # kernel_cache: see there
from planarm_sim.cpu.layout import LEVEL, RAISED_AT, State
from planarm_sim.cpu.registers import (
    ADCSRA,
    EECR,
    EICRA,
    EIFR,
    EIMSK,
    PCICR,
    PCIFR,
    SPMCSR,
    TIFR0,
    TIFR1,
    TIFR2,
    TIMSK0,
    TIMSK1,
    TIMSK2,
    UCSR0A,
    UCSR0B,
    WDTCSR,
)
from planarm_sim.peripherals.adc import ADIE, ADIF
from planarm_sim.peripherals.eeprom import EEPE, EERIE
from planarm_sim.peripherals.ports import PORT_D
from planarm_sim.peripherals.self_programming import SELFPRGEN, SPMIE
from planarm_sim.peripherals.timers import ICF, OCF_A, OCF_B, TOV
from planarm_sim.peripherals.usart import RXC, TXC, UDRE
from planarm_sim.peripherals.watchdog import WDE, WDIE, WDIF

# Vector numbers; the vector's word address is twice the number.
INT0, INT1, PCINT0 = 1, 2, 3
WDT = 6
TIMER2_COMPA, TIMER2_COMPB, TIMER2_OVF = 7, 8, 9
TIMER1_CAPT, TIMER1_COMPA, TIMER1_COMPB, TIMER1_OVF = 10, 11, 12, 13
TIMER0_COMPA, TIMER0_COMPB, TIMER0_OVF = 14, 15, 16
USART_RX, USART_UDRE, USART_TX = 18, 19, 20
ADC_COMPLETE = 21
EE_READY = 22
SPM_READY = 25
ENTRY_CYCLES, WAKE_CYCLES = 4, 4


@inner
def pending_interrupts(st: State) -> int:
    """Bit n is set when vector n has its flag and its enable; the lowest bit is the first in priority."""
    pending = (st[EIFR] & st[EIMSK]) << INT0
    if st[EIMSK]:
        pending |= low_levels(st) << INT0
    pending |= (st[PCIFR] & st[PCICR]) << PCINT0
    if st[WDTCSR] & WDIF and st[WDTCSR] & WDIE:
        pending |= 1 << WDT
    timer1 = st[TIFR1] & st[TIMSK1]
    if timer1:
        pending |= ((timer1 & (OCF_A | OCF_B)) << (TIMER1_COMPA - 1)) | ((timer1 & TOV) << TIMER1_OVF)
        pending |= ((timer1 & ICF) >> 5) << TIMER1_CAPT
    timer0 = st[TIFR0] & st[TIMSK0]
    pending |= ((timer0 & (OCF_A | OCF_B)) << (TIMER0_COMPA - 1)) | ((timer0 & TOV) << TIMER0_OVF)
    timer2 = st[TIFR2] & st[TIMSK2]
    pending |= ((timer2 & (OCF_A | OCF_B)) << (TIMER2_COMPA - 1)) | ((timer2 & TOV) << TIMER2_OVF)
    usart = st[UCSR0A] & st[UCSR0B]  # RXC/RXCIE and TXC/TXCIE share their bits, and so do UDRE/UDRIE
    if usart & (RXC | TXC | UDRE):
        pending |= ((usart & RXC) >> 7) << USART_RX
        pending |= ((usart & UDRE) >> 5) << USART_UDRE
        pending |= ((usart & TXC) >> 6) << USART_TX
    if st[ADCSRA] & ADIF and st[ADCSRA] & ADIE:
        pending |= 1 << ADC_COMPLETE
    if st[EECR] & EERIE and st[EECR] & EEPE == 0:
        pending |= 1 << EE_READY
    if st[SPMCSR] & (SPMIE | SELFPRGEN) == SPMIE:
        pending |= 1 << SPM_READY
    return int(pending)


@kernel
def note_raised(st: State, before: int, cycle: int) -> None:
    """Note that the interrupts that are pending now, and were not in the mask `before`, are so since `cycle`."""
    raised = pending_interrupts(st) & ~before
    while raised:
        st[RAISED_AT + lowest_bit(raised)] = cycle
        raised &= raised - 1


@inner
def low_levels(st: State) -> int:
    """INT0 (bit 0) and INT1 (bit 1) that are enabled, set to low level, and low."""
    sense = st[EICRA]
    low = ~st[LEVEL + PORT_D] >> 2 & st[EIMSK]
    return int((low & 1 if sense & 3 == 0 else 0) | (low & 2 if sense & 12 == 0 else 0))


@inlined
def lowest_bit(mask: int) -> int:
    """Number of the lowest set bit of a mask that is not 0."""
    number = 0
    while mask & 1 == 0 and number < 63:
        mask >>= 1
        number += 1
    return number


@inlined
def acknowledge(st: State, vector: int) -> bool:
    """Clear what the hardware clears when the vector is taken; False where the request stays, or may stay.

    RXC, UDRE, EE_READY, SPM_READY and low levels of INT0 and INT1 ask until their cause is gone.
    """
    if vector <= INT1:
        st[EIFR] &= ~(1 << (vector - INT0))
    elif vector < WDT:
        st[PCIFR] &= ~(1 << (vector - PCINT0))
    elif vector == WDT:
        st[WDTCSR] &= ~WDIF
        if st[WDTCSR] & WDE:
            st[WDTCSR] &= ~WDIE
    elif vector <= TIMER2_OVF:
        st[TIFR2] &= ~timer_flag(vector - TIMER2_COMPA)
    elif vector == TIMER1_CAPT:
        st[TIFR1] &= ~ICF
    elif vector <= TIMER1_OVF:
        st[TIFR1] &= ~timer_flag(vector - TIMER1_COMPA)
    elif vector <= TIMER0_OVF:
        st[TIFR0] &= ~timer_flag(vector - TIMER0_COMPA)
    elif vector == USART_TX:
        st[UCSR0A] &= ~TXC
    elif vector == ADC_COMPLETE:
        st[ADCSRA] &= ~ADIF
    return INT1 < vector <= TIMER0_OVF or vector in (USART_TX, ADC_COMPLETE)


@inner
def timer_flag(index: int) -> int:
    """TIFRn bit of the index-th of COMPA, COMPB, OVF."""
    return TOV if index == 2 else OCF_A << index
