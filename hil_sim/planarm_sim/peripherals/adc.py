"""Analogue-to-digital converter: conversion times, channels, references, triggers (ATmega328P datasheet, 24).

Inputs are voltages that the outside injects; without one, a channel sees its pin's digital level. Conversions are
exact: no noise, no error. The prescaler counts from ADEN on; its first rising edge is taken one ADC clock later.
"""

from __future__ import annotations

import numpy as np

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    ADC_FIRST,
    ADC_INPUT,
    ADC_LOCKED,
    ADC_MUX,
    ADC_ORIGIN,
    ADC_PHASE,
    ADC_RESULT,
    ADC_SAMPLE,
    ADC_START,
    ADC_TRIGGERED,
    DUE_ADC,
    F_TRIGGERS,
    HORIZON,
    LEVEL,
    NEVER,
    TIMER0,
    TIMER1,
    State,
)
from planarm_sim.cpu.registers import ADCL, ADCSRA, ADCSRB, ADMUX, EIFR, TIFR0, TIFR1

ADEN, ADSC, ADATE, ADIF, ADIE, ADPS = 1 << 7, 1 << 6, 1 << 5, 1 << 4, 1 << 3, 7  # ADCSRA
ADLAR = 1 << 5  # ADMUX
ADTS, ACME = 7, 1 << 6  # ADCSRB
IDLE, WAITING, SAMPLING, CONVERTING = 0, 1, 2, 3
"""Values of ADC_PHASE: until the ADC clock's next edge, until the sample is taken, until the result is there."""
PORT_C = 1
SUPPLY_UV, BANDGAP_UV, TEMPERATURE_UV = 5_000_000, 1_100_000, 314_000
"""Microvolts: AVCC of a Uno, the internal reference, the temperature sensor at 25 degrees (table 24-2)."""
CHANNELS, TEMPERATURE, BANDGAP = 8, 8, 14
AREF = CHANNELS
"""Index of the reference pin among the inputs; a Uno leaves it open, and conversions against it read 1023."""
NOT_DRIVEN = -1
# Sources of triggers, values of ADTS2:0 (table 24-6), and their bits in EIFR, TIFR0 and TIFR1.
FREE_RUNNING, BY_COMPARATOR, BY_INT0 = 0, 1, 2
TRIGGER_INT0 = 1 << 0
TRIGGERS_0 = np.array([0, 0, 0, 1 << 1, 1 << 0, 0, 0, 0], dtype=np.int64)
TRIGGERS_1 = np.array([0, 0, 0, 0, 0, 1 << 2, 1 << 0, 1 << 5], dtype=np.int64)
SYNCHRONISATION_CYCLES = 3
"""CPU cycles from a trigger to the start of the prescaler that it resets (24.4)."""
FULL_SCALE = 1023


@inner
def adc_clock(st: State) -> int:
    """CPU cycles in a cycle of the ADC's clock (table 24-5)."""
    return 1 << max(int(st[ADCSRA] & ADPS), 1)


@inner
def read_adc(st: State, address: int) -> int:
    """Read ADCL, which holds the result until ADCH is read, or ADCH (24.2)."""
    result = st[ADC_RESULT] << 6 if st[ADMUX] & ADLAR else st[ADC_RESULT]
    st[ADC_LOCKED] = address == ADCL
    return int(result & 0xFF if address == ADCL else result >> 8)


@inner
def write_adc(st: State, address: int, value: int, cycle: int) -> None:
    """Write ADCSRA, ADCSRB or ADMUX; the data registers cannot be written."""
    if address == ADMUX:
        st[address] = value & 0xEF
        return
    signal = trigger_signal(st)
    if address == ADCSRA:
        write_control(st, value, cycle)
    elif address == ADCSRB:
        st[address] = value & (ACME | ADTS)
    armed = st[ADCSRA] & ADEN and st[ADCSRA] & ADATE
    source = st[ADCSRB] & ADTS
    st[TIMER0 + F_TRIGGERS] = TRIGGERS_0[source] if armed else 0
    st[TIMER1 + F_TRIGGERS] = TRIGGERS_1[source] if armed else 0
    if address == ADCSRB and trigger_signal(st) and not signal:  # a change of source is an edge, too (24.9.4)
        trigger(st, cycle)


@inner
def trigger_signal(st: State) -> bool:
    """Level of the chosen source; none of its own while running free."""
    source = st[ADCSRB] & ADTS
    if source == BY_INT0:
        return bool(st[EIFR] & TRIGGER_INT0 != 0)
    return bool((st[TIFR0] & TRIGGERS_0[source]) | (st[TIFR1] & TRIGGERS_1[source]) != 0)


@inner
def trigger(st: State, cycle: int) -> None:
    """The chosen source's flag has risen: reset the prescaler and start, unless a conversion is under way (24.3)."""
    if st[ADCSRA] & ADEN and st[ADCSRA] & ADATE and st[ADC_PHASE] == IDLE:
        st[ADCSRA] |= ADSC
        st[ADC_PHASE] = WAITING
        st[ADC_TRIGGERED] = 1
        st[ADC_ORIGIN] = cycle + SYNCHRONISATION_CYCLES
        st[DUE_ADC] = st[ADC_ORIGIN]
        st[HORIZON] = min(st[HORIZON], st[DUE_ADC])


@inner
def write_control(st: State, value: int, cycle: int) -> None:
    """Write ADCSRA: switch on and off, start, clear the flag."""
    before = st[ADCSRA]
    kept = before & ADSC
    if not value & ADEN:
        st[ADC_PHASE] = IDLE
        st[DUE_ADC] = NEVER
        kept = 0
    elif not before & ADEN:
        st[ADC_ORIGIN] = cycle
        st[ADC_FIRST] = 1
    st[ADCSRA] = (value & ~(ADSC | ADIF)) | kept | (before & ADIF & ~value)
    if value & ADSC and value & ADEN and st[ADC_PHASE] == IDLE:
        st[ADCSRA] |= ADSC
        st[ADC_PHASE] = WAITING
        st[ADC_TRIGGERED] = 0
        clock = adc_clock(st)
        st[DUE_ADC] = st[ADC_ORIGIN] + ((cycle - st[ADC_ORIGIN]) // clock + 1) * clock


@inner
def advance_adc(st: State, cycle: int) -> None:
    """The next step of a conversion: 1.5 ADC clocks to the sample, 13 in all (table 24-1).

    A triggered one takes 2 and 13.5, the first one since ADEN 13.5 and 25.
    """
    clock = adc_clock(st)
    if st[ADC_PHASE] == WAITING:
        start_conversion(st, cycle)
    elif st[ADC_PHASE] == SAMPLING:
        st[ADC_SAMPLE] = convert(st)
        st[ADC_PHASE] = CONVERTING
        halves = 50 if st[ADC_FIRST] else (27 if st[ADC_TRIGGERED] else 26)
        st[DUE_ADC] = st[ADC_START] + halves * clock // 2
        st[ADC_FIRST] = 0
    else:
        if not st[ADC_LOCKED]:
            st[ADC_RESULT] = st[ADC_SAMPLE]
        st[ADCSRA] |= ADIF
        st[ADC_TRIGGERED] = 0
        if st[ADCSRA] & ADATE and st[ADCSRB] & ADTS == FREE_RUNNING:
            start_conversion(st, cycle)
        else:
            st[ADCSRA] &= ~ADSC
            st[ADC_PHASE] = IDLE
            st[DUE_ADC] = NEVER


@inner
def start_conversion(st: State, cycle: int) -> None:
    """Fix channel and reference, and wait for the sample."""
    st[ADC_START] = cycle
    st[ADC_MUX] = st[ADMUX]
    st[ADC_PHASE] = SAMPLING
    halves = 27 if st[ADC_FIRST] else (4 if st[ADC_TRIGGERED] else 3)
    st[DUE_ADC] = cycle + halves * adc_clock(st) // 2


@inner
def convert(st: State) -> int:
    """Result for the voltages of now: V * 1024 / Vref (24.7)."""
    source = st[ADC_MUX] >> 6
    reference = SUPPLY_UV if source == 1 else BANDGAP_UV if source == 3 else max(st[ADC_INPUT + AREF], 0)
    voltage = input_uv(st, int(st[ADC_MUX] & 15))
    if voltage >= reference:
        return FULL_SCALE
    return int(voltage * 1024 // reference)


@inner
def input_uv(st: State, channel: int) -> int:
    """Microvolts on a channel (table 24-4); reserved ones read as ground."""
    if channel < CHANNELS:
        if st[ADC_INPUT + channel] != NOT_DRIVEN:
            return int(st[ADC_INPUT + channel])
        return SUPPLY_UV if (st[LEVEL + PORT_C] >> channel) & 1 else 0
    if channel == TEMPERATURE:
        return TEMPERATURE_UV
    return BANDGAP_UV if channel == BANDGAP else 0
