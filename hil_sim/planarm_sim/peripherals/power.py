"""Power reduction: parts whose clock PRR stops (ATmega328P datasheet, 10.10 and 10.12.3).

A part that is switched off keeps its state and cannot be written until it is switched on again. A timer then counts on
from where it stood. Of the USART and the ADC, what was under way is lost: the datasheet asks to set them up anew. Reads
are not blocked here; the datasheet does not say what they give.
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    ADC_PHASE,
    CLOCK_STOPPED,
    DUE_ADC,
    DUE_RX,
    DUE_TX,
    F_SHIFT,
    F_SYNC,
    F_TCCRB,
    NEVER,
    RX_ACTIVE,
    RX_READY,
    TIMER0,
    TIMER1,
    TIMER2,
    TX_BUSY,
    State,
)
from planarm_sim.cpu.registers import (
    ADCL,
    ADCSRA,
    ADMUX,
    OCR0B,
    OCR1BH,
    OCR2B,
    PRR,
    TCCR0A,
    TCCR1A,
    TCCR2A,
    TIFR0,
    TIFR1,
    TIFR2,
    TIMSK0,
    TIMSK1,
    TIMSK2,
    UCSR0A,
    UDR0,
)
from planarm_sim.peripherals.adc import ADSC
from planarm_sim.peripherals.adc import IDLE as ADC_IDLE
from planarm_sim.peripherals.timer_registers import clock_setting
from planarm_sim.peripherals.timers import advance_timer, plan_timer
from planarm_sim.peripherals.usart import UDRE, plan_receiver

PRTWI, PRTIM2, PRTIM0, PRTIM1, PRSPI, PRUSART0, PRADC = 1 << 7, 1 << 6, 1 << 5, 1 << 3, 1 << 2, 1 << 1, 1 << 0
BITS = 0xEF


@inner
def is_off(st: State, address: int) -> bool:
    """Tell whether a register's part is switched off."""
    off = st[PRR]
    if off & PRTIM0 and (TCCR0A <= address <= OCR0B or address in (TIFR0, TIMSK0)):
        return True
    if off & PRTIM1 and (TCCR1A <= address <= OCR1BH or address in (TIFR1, TIMSK1)):
        return True
    if off & PRTIM2 and (TCCR2A <= address <= OCR2B or address in (TIFR2, TIMSK2)):
        return True
    return bool((off & PRUSART0 and UCSR0A <= address <= UDR0) or (off & PRADC and ADCL <= address <= ADMUX))


@inner
def write_power_reduction(st: State, value: int, cycle: int) -> None:
    """Write PRR."""
    changed = (st[PRR] ^ value) & BITS
    for t, bit in ((TIMER0, PRTIM0), (TIMER1, PRTIM1), (TIMER2, PRTIM2)):
        if changed & bit:
            switch_timer(st, t, value & bit == 0, cycle)
    st[PRR] = value & BITS
    if changed & PRUSART0:
        switch_usart(st, value & PRUSART0 == 0, cycle)
    if changed & value & PRADC:
        st[ADC_PHASE] = ADC_IDLE
        st[DUE_ADC] = NEVER
        st[ADCSRA] &= ~ADSC


@inner
def switch_timer(st: State, t: int, on: bool, cycle: int) -> None:
    """Stop the timer's clock, or let it go on as TCCRnB says."""
    advance_timer(st, t, cycle)
    st[t + F_SHIFT] = clock_setting(t, int(st[st[t + F_TCCRB]])) if on else CLOCK_STOPPED
    st[t + F_SYNC] = cycle
    plan_timer(st, t)


@inner
def switch_usart(st: State, on: bool, cycle: int) -> None:
    """Drop what was under way; when switched on, look for start bits from now on."""
    st[RX_ACTIVE] = 0
    st[RX_READY] = cycle
    st[TX_BUSY] = 0
    st[UCSR0A] |= UDRE
    st[DUE_TX] = NEVER
    st[DUE_RX] = NEVER
    if on:
        plan_receiver(st)
