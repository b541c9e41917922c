"""The timers' registers: addresses, mode tables and access, over the one design in `timers`.

ATmega328P datasheet, 15.9, 16.11 and 18.11. All 16-bit registers of timer 1 share one TEMP byte (16.3).
"""

from __future__ import annotations

import numpy as np

from planarm_sim.cpu.compiled import inlined, inner  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    AT_BOTTOM,
    AT_MAX,
    AT_ONCE,
    AT_TOP,
    CLOCK_FALLING,
    CLOCK_RISING,
    CLOCK_STOPPED,
    DUE_TIMER0,
    F_COUNT,
    F_DUE,
    F_HELD,
    F_ICR,
    F_MAX,
    F_PIN_A,
    F_PIN_B,
    F_PRESCALER,
    F_SHIFT,
    F_SYNC,
    F_TCCRA,
    F_TCCRB,
    F_TIFR,
    F_TIMSK,
    F_TOP_SOURCE,
    HELD_01,
    HELD_2,
    PRESCALER_01,
    PRESCALER_2,
    SLOPE_COUNT,
    SLOPE_DUAL,
    SLOPE_FAST,
    TEMP,
    TIMER0,
    TIMER1,
    TIMER2,
    TOP_FIXED,
    TOP_ICR,
    TOP_OCR_A,
    State,
)
from planarm_sim.cpu.registers import (
    GTCCR,
    ICR1H,
    ICR1L,
    OCR1AH,
    OCR1AL,
    OCR1BH,
    OCR1BL,
    TCCR0A,
    TCCR0B,
    TCCR1A,
    TCCR1B,
    TCCR1C,
    TCCR2A,
    TCCR2B,
    TCNT1H,
    TCNT1L,
    TIFR0,
    TIFR1,
    TIFR2,
    TIMSK0,
    TIMSK1,
    TIMSK2,
)
from planarm_sim.peripherals.timers import (
    advance_timer,
    effective_com,
    force_compare,
    plan_timer,
    set_mode,
    set_outputs,
    write_compare,
    write_count,
)

_COUNT, _FAST, _DUAL = SLOPE_COUNT, SLOPE_FAST, SLOPE_DUAL
_FIX, _OCR, _ICR = TOP_FIXED, TOP_OCR_A, TOP_ICR

# Columns: slope, source of TOP, fixed TOP, load of OCRnx at, TOV at, OCnA toggles with COMnA = 1.
MODES_8 = np.array(
    [
        (_COUNT, _FIX, 0xFF, AT_ONCE, AT_MAX, 1),
        (_DUAL, _FIX, 0xFF, AT_TOP, AT_BOTTOM, 0),
        (_COUNT, _OCR, 0, AT_ONCE, AT_MAX, 1),
        (_FAST, _FIX, 0xFF, AT_BOTTOM, AT_TOP, 0),
        (_COUNT, _FIX, 0xFF, AT_ONCE, AT_MAX, 1),  # reserved
        (_DUAL, _OCR, 0, AT_TOP, AT_BOTTOM, 1),
        (_COUNT, _FIX, 0xFF, AT_ONCE, AT_MAX, 1),  # reserved
        (_FAST, _OCR, 0, AT_BOTTOM, AT_TOP, 1),
    ],
    dtype=np.int64,
)
"""Waveform generation modes of timers 0 and 2 (datasheet, table 15-8)."""
MODES_16 = np.array(
    [
        (_COUNT, _FIX, 0xFFFF, AT_ONCE, AT_MAX, 1),
        (_DUAL, _FIX, 0x00FF, AT_TOP, AT_BOTTOM, 0),
        (_DUAL, _FIX, 0x01FF, AT_TOP, AT_BOTTOM, 0),
        (_DUAL, _FIX, 0x03FF, AT_TOP, AT_BOTTOM, 0),
        (_COUNT, _OCR, 0, AT_ONCE, AT_MAX, 1),
        (_FAST, _FIX, 0x00FF, AT_BOTTOM, AT_TOP, 0),
        (_FAST, _FIX, 0x01FF, AT_BOTTOM, AT_TOP, 0),
        (_FAST, _FIX, 0x03FF, AT_BOTTOM, AT_TOP, 0),
        (_DUAL, _ICR, 0, AT_BOTTOM, AT_BOTTOM, 0),
        (_DUAL, _OCR, 0, AT_BOTTOM, AT_BOTTOM, 1),
        (_DUAL, _ICR, 0, AT_TOP, AT_BOTTOM, 0),
        (_DUAL, _OCR, 0, AT_TOP, AT_BOTTOM, 1),
        (_COUNT, _ICR, 0, AT_ONCE, AT_MAX, 1),
        (_COUNT, _FIX, 0xFFFF, AT_ONCE, AT_MAX, 1),  # reserved
        (_FAST, _ICR, 0, AT_BOTTOM, AT_TOP, 1),
        (_FAST, _OCR, 0, AT_BOTTOM, AT_TOP, 1),
    ],
    dtype=np.int64,
)
"""Waveform generation modes of timer 1 (datasheet, table 16-4)."""
CLOCKS_01 = np.array([CLOCK_STOPPED, 0, 3, 6, 8, 10, CLOCK_FALLING, CLOCK_RISING], dtype=np.int64)
"""CSn2:0 of timers 0 and 1 as log2 of the division (datasheet, table 15-9)."""
CLOCKS_2 = np.array([CLOCK_STOPPED, 0, 3, 5, 6, 7, 8, 10], dtype=np.int64)
"""CS22:0 of timer 2 (datasheet, table 18-9)."""

PSRSYNC, PSRASY, TSM = 1 << 0, 1 << 1, 1 << 7  # GTCCR
FIXED_FIELDS = {
    TIMER0: {F_MAX: 0xFF, F_PRESCALER: PRESCALER_01, F_HELD: HELD_01, F_DUE: DUE_TIMER0, F_TIFR: TIFR0}
    | {F_TIMSK: TIMSK0, F_TCCRA: TCCR0A, F_TCCRB: TCCR0B, F_PIN_A: 2 * 8 + 6, F_PIN_B: 2 * 8 + 5},
    TIMER1: {F_MAX: 0xFFFF, F_PRESCALER: PRESCALER_01, F_HELD: HELD_01, F_DUE: DUE_TIMER0 + 1, F_TIFR: TIFR1}
    | {F_TIMSK: TIMSK1, F_TCCRA: TCCR1A, F_TCCRB: TCCR1B, F_PIN_A: 1, F_PIN_B: 2},
    TIMER2: {F_MAX: 0xFF, F_PRESCALER: PRESCALER_2, F_HELD: HELD_2, F_DUE: DUE_TIMER0 + 2, F_TIFR: TIFR2}
    | {F_TIMSK: TIMSK2, F_TCCRA: TCCR2A, F_TCCRB: TCCR2B, F_PIN_A: 3, F_PIN_B: 2 * 8 + 3},
}
"""What tells the three timers apart; OC0A PD6, OC0B PD5, OC1A PB1, OC1B PB2, OC2A PB3, OC2B PD3."""


def power_up_timers(st: State) -> None:
    """Fill the timers' blocks as after a reset (all other fields are zero)."""
    for t, fields in FIXED_FIELDS.items():
        for field, value in fields.items():
            st[t + field] = value
        _, source, fixed, load_at, overflow_at, _ = MODES_16[0] if t == TIMER1 else MODES_8[0]
        set_mode(st, t, SLOPE_COUNT, source, fixed, load_at, overflow_at)
        st[t + F_SHIFT] = CLOCK_STOPPED


@inner
def clock_setting(t: int, control_b: int) -> int:
    """F_SHIFT as CSn2:0 of TCCRnB say."""
    return int(CLOCKS_2[control_b & 7] if t == TIMER2 else CLOCKS_01[control_b & 7])


@inner
def apply_control(st: State, t: int, cycle: int) -> None:
    """Act on TCCRnA and TCCRnB as they now stand: mode, outputs, clock."""
    control_a = st[st[t + F_TCCRA]]
    control_b = st[st[t + F_TCCRB]]
    high = control_b >> 1
    mode = MODES_16[(control_a & 3) | (high & 12)] if t == TIMER1 else MODES_8[(control_a & 3) | (high & 4)]
    slope = mode[0]
    set_mode(st, t, slope, mode[1], mode[2], mode[3], mode[4])
    com_a = effective_com(control_a >> 6, slope, mode[5] != 0)
    com_b = effective_com((control_a >> 4) & 3, slope, False)
    set_outputs(st, t, com_a, com_b, cycle)
    st[t + F_SHIFT] = clock_setting(t, control_b)
    st[t + F_SYNC] = cycle


@inner
def write_timer8(st: State, t: int, address: int, value: int, cycle: int) -> None:
    """Write a register of timer 0 or 2; their five registers stand in one order."""
    advance_timer(st, t, cycle)
    what = address - st[t + F_TCCRA]
    if what == 0:
        st[address] = value & 0xF3
        apply_control(st, t, cycle)
    elif what == 1:
        st[address] = value & 0x0F
        apply_control(st, t, cycle)
        force_compare(st, t, value, cycle)
    elif what == 2:
        write_count(st, t, value)
    else:
        st[address] = value
        write_compare(st, t, what - 3, value)
    plan_timer(st, t)


@inner
def read_count8(st: State, t: int, cycle: int) -> int:
    """Read TCNT0 or TCNT2; all other registers of these timers read as written."""
    advance_timer(st, t, cycle)
    return int(st[t + F_COUNT])


@inlined
def write_timer1(st: State, address: int, value: int, cycle: int) -> None:
    """Write a register of timer 1; the high bytes wait in TEMP."""
    if address in (TCNT1H, ICR1H, OCR1AH, OCR1BH):
        st[TEMP] = value
        return
    advance_timer(st, TIMER1, cycle)
    word = (st[TEMP] << 8) | value
    if address == TCCR1A:
        st[address] = value & 0xF3
        apply_control(st, TIMER1, cycle)
    elif address == TCCR1B:
        st[address] = value & 0xDF
        apply_control(st, TIMER1, cycle)
    elif address == TCCR1C:
        force_compare(st, TIMER1, value, cycle)
    elif address == TCNT1L:
        write_count(st, TIMER1, word)
    elif address in (OCR1AL, OCR1BL):
        st[address] = value
        st[address + 1] = word >> 8
        write_compare(st, TIMER1, (address - OCR1AL) >> 1, word)
    elif address == ICR1L and st[TIMER1 + F_TOP_SOURCE] == TOP_ICR:
        st[TIMER1 + F_ICR] = word  # in the other modes the register belongs to input capture (16.6.3)
    plan_timer(st, TIMER1)


@inlined
def read_timer1(st: State, address: int, cycle: int) -> int:
    """Read TCNT1 or ICR1: the low byte puts the high one into TEMP; OCR1x read as written, TEMP aside."""
    word = st[TIMER1 + F_ICR]
    if address in (TCNT1H, ICR1H):
        return int(st[TEMP])
    if address == TCNT1L:
        advance_timer(st, TIMER1, cycle)
        word = st[TIMER1 + F_COUNT]
    st[TEMP] = word >> 8
    return int(word & 0xFF)


@inner
def timer_of(address: int) -> int:
    """Block of the timer whose TIFRn or TIMSKn is at `address`."""
    if address in (TIFR0, TIMSK0):
        return TIMER0
    return TIMER1 if address in (TIFR1, TIMSK1) else TIMER2


@inner
def write_timer_flags(st: State, address: int, value: int, cycle: int) -> None:
    """Write TIFRn: ones clear flags."""
    advance_timer(st, timer_of(address), cycle)
    st[address] &= ~value


@inner
def read_timer_flags(st: State, address: int, cycle: int) -> int:
    """Read TIFRn."""
    advance_timer(st, timer_of(address), cycle)
    return int(st[address])


@inner
def write_timer_mask(st: State, address: int, value: int, cycle: int) -> None:
    """Write TIMSKn."""
    t = timer_of(address)
    advance_timer(st, t, cycle)
    st[address] = value & (0x27 if t == TIMER1 else 0x07)
    plan_timer(st, t)


@inner
def write_prescaler_control(st: State, value: int, cycle: int) -> None:
    """Write GTCCR: PSRSYNC and PSRASY restart the prescalers; with TSM they stay in reset (datasheet, 17.4.1)."""
    hold = value & TSM != 0
    for t in (TIMER0, TIMER1, TIMER2):
        advance_timer(st, t, cycle)
    if value & PSRSYNC or st[HELD_01]:
        st[PRESCALER_01] = cycle
        st[HELD_01] = 1 if hold and value & PSRSYNC else 0
        st[TIMER0 + F_SYNC] = cycle
        st[TIMER1 + F_SYNC] = cycle
    if value & PSRASY or st[HELD_2]:
        st[PRESCALER_2] = cycle
        st[HELD_2] = 1 if hold and value & PSRASY else 0
        st[TIMER2 + F_SYNC] = cycle
    st[GTCCR] = value & (TSM | PSRSYNC | PSRASY) if hold else 0
    for t in (TIMER0, TIMER1, TIMER2):
        plan_timer(st, t)
