"""Analogue-to-digital converter: conversion times, channels, references, free running (ATmega328P datasheet, 24).

Inputs are voltages that the outside injects; without one, a channel sees its pin's digital level. Conversions are
exact: no noise, no error. The prescaler counts from ADEN on; its first rising edge is taken one ADC clock later.
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import kernel  # kernel_cache: see there
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
    DUE_ADC,
    LEVEL,
    NEVER,
    State,
)
from planarm_sim.cpu.registers import ADCL, ADCSRA, ADCSRB, ADMUX

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
FULL_SCALE = 1023


@kernel
def adc_clock(st: State) -> int:
    """CPU cycles in a cycle of the ADC's clock (table 24-5)."""
    return 1 << max(int(st[ADCSRA] & ADPS), 1)


@kernel
def read_adc(st: State, address: int) -> int:
    """Read ADCL, which holds the result until ADCH is read, or ADCH (24.2)."""
    result = st[ADC_RESULT] << 6 if st[ADMUX] & ADLAR else st[ADC_RESULT]
    st[ADC_LOCKED] = address == ADCL
    return int(result & 0xFF if address == ADCL else result >> 8)


@kernel
def write_adc(st: State, address: int, value: int, cycle: int) -> None:
    """Write ADCSRA, ADCSRB or ADMUX; the data registers cannot be written."""
    if address == ADCSRA:
        write_control(st, value, cycle)
    elif address == ADMUX:
        st[address] = value & 0xEF
    elif address == ADCSRB:
        st[address] = value & (ACME | ADTS)


@kernel
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
        clock = adc_clock(st)
        st[DUE_ADC] = st[ADC_ORIGIN] + ((cycle - st[ADC_ORIGIN]) // clock + 1) * clock


@kernel
def advance_adc(st: State, cycle: int) -> None:
    """The next step of a conversion: 1.5 ADC clocks to the sample, 13 in all; the first one 13.5 and 25 (24.4)."""
    clock = adc_clock(st)
    if st[ADC_PHASE] == WAITING:
        start_conversion(st, cycle)
    elif st[ADC_PHASE] == SAMPLING:
        st[ADC_SAMPLE] = convert(st)
        st[ADC_PHASE] = CONVERTING
        st[DUE_ADC] = st[ADC_START] + (25 if st[ADC_FIRST] else 13) * clock
        st[ADC_FIRST] = 0
    else:
        if not st[ADC_LOCKED]:
            st[ADC_RESULT] = st[ADC_SAMPLE]
        st[ADCSRA] |= ADIF
        if st[ADCSRA] & ADATE and st[ADCSRB] & ADTS == 0:  # free running
            start_conversion(st, cycle)
        else:
            st[ADCSRA] &= ~ADSC
            st[ADC_PHASE] = IDLE
            st[DUE_ADC] = NEVER


@kernel
def start_conversion(st: State, cycle: int) -> None:
    """Fix channel and reference, and wait for the sample."""
    st[ADC_START] = cycle
    st[ADC_MUX] = st[ADMUX]
    st[ADC_PHASE] = SAMPLING
    st[DUE_ADC] = cycle + (27 if st[ADC_FIRST] else 3) * adc_clock(st) // 2


@kernel
def convert(st: State) -> int:
    """Result for the voltages of now: V * 1024 / Vref (24.7)."""
    source = st[ADC_MUX] >> 6
    reference = SUPPLY_UV if source == 1 else BANDGAP_UV if source == 3 else max(st[ADC_INPUT + AREF], 0)
    voltage = input_uv(st, int(st[ADC_MUX] & 15))
    if voltage >= reference:
        return FULL_SCALE
    return int(voltage * 1024 // reference)


@kernel
def input_uv(st: State, channel: int) -> int:
    """Microvolts on a channel (table 24-4); reserved ones read as ground."""
    if channel < CHANNELS:
        if st[ADC_INPUT + channel] != NOT_DRIVEN:
            return int(st[ADC_INPUT + channel])
        return SUPPLY_UV if (st[LEVEL + PORT_C] >> channel) & 1 else 0
    if channel == TEMPERATURE:
        return TEMPERATURE_UV
    return BANDGAP_UV if channel == BANDGAP else 0
