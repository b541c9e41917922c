"""Layout of the one int64 array that holds the chip's state, shared by every kernel.

Words 0 to 255 are the low data space: the 32 general registers and the I/O registers as last written (a
register whose value depends on time is computed when it is read). State that no program sees follows, then
four queues whose place and size stand in the state itself, so that Python can grow them.

SRAM, EEPROM and flash are byte arrays of their own: three quarters of a snapshot would be zeros otherwise.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu.compiled import constant

State: TypeAlias = NDArray[np.int64]
Bytes: TypeAlias = NDArray[np.uint8]

NEVER = 1 << 62
"""A cycle that does not come (9,000 years at 16 MHz)."""

SOMETHING_CHANGED = 0
"""A horizon in the past: events or a write may have raised interrupts, and the CPU loop has to look."""
NOTHING_CHANGED = 1
"""Likewise in the past, but nothing that concerns interrupts has happened since the last look."""
UNKNOWN = -1
BROKEN = 1 << 16
"""In RESET_REQUEST: the state contradicts itself, and going on would never end."""

# --- CPU ---------------------------------------------------------------------------------------------------
(
    PC,  # word address
    CYCLE,  # clock cycles since power-up
    SP,  # stack pointer, 16 bits
    SREG_BITS,
    HORIZON,  # the first cycle at which something beside instructions is due
    LOOK_AT,  # the first cycle at which the CPU loop looks up from instructions: HORIZON, or 0 at once
    IRQ_EARLIEST,  # no interrupt is taken before this cycle (one instruction after SEI and RETI)
    PENDING,  # interrupts with flag and enable set, at least; or UNKNOWN
    ASLEEP,  # 0 awake, else 1 + sleep mode (SM2:0)
    RESET_REQUEST,  # bits of MCUSR of a reset that a peripheral asks for, or BROKEN
    BOOT_START,  # word address of the boot section, where vectors go when IVSEL is set
    BOOT_RESET,  # 1 when resets lead there (fuse BOOTRST programmed)
    ACCESS,  # what the instruction that just ended wants from I/O, and the particulars (see `access`)
    ACCESS_ADDRESS,
    ACCESS_VALUE,
    ACCESS_PC,  # word address of the instruction
    WATCH,  # 1 while RAISED_AT is kept; see `planarm_sim.insight`
    ENTERED_AT,  # cycle at which the last interrupt's first instruction began, and its vector
    ENTERED_VECTOR,
    IVCE_UNTIL,  # last cycle at which IVSEL may be changed
    OUTSIDE_ADDRESS,  # first data address beyond the chip's memory that was used, plus 1
    OUTSIDE_PC,
    # --- Watchdog, EEPROM, self-programming ---
    WDT_ORIGIN,
    WDT_CHANGE_UNTIL,
    EE_WRITE_UNTIL,
    EE_BUSY_ADDRESS,
    EE_BUSY_DATA,
    EE_BUSY_MODE,
    SPM_BUSY,  # 1 while a page of the flash is erased or written
    SPM_HALT_UNTIL,  # the CPU stands still until then: the page is in the section that it runs from
    # --- ADC ---
    ADC_ORIGIN,  # cycle at which its prescaler began to count
    ADC_PHASE,
    ADC_FIRST,  # 1 until the first conversion since ADEN was set
    ADC_START,
    ADC_MUX,  # ADMUX as it was then
    ADC_SAMPLE,
    ADC_RESULT,
    ADC_TRIGGERED,  # 1 when the conversion under way was started by a trigger
    ADC_LOCKED,  # 1 between reads of ADCL and ADCH
    # --- Shared prescalers of the timers ---
    PRESCALER_01,  # cycle of the last reset of the prescaler of timers 0 and 1
    PRESCALER_2,
    HELD_01,  # 1 while TSM holds the prescaler in reset
    HELD_2,
    TEMP,  # high byte on its way into or out of a 16-bit register
    # --- USART0 ---
    BAUD_ORIGIN,  # cycle at which the baud rate divider was last loaded by a write to UBRR0L
    TX_BUSY,
    TX_SHIFT,
    TX_BUFFER,
    TX_BIT_CYCLES,
    RX_ACTIVE,  # 1 between the detection of a start bit and the middle of the stop bit
    RX_FIRST_SAMPLE,  # cycle of sample 1 of the frame being received
    RX_READY,  # cycle from which the receiver looks for a start bit
    RX_COUNT,  # bytes in the receive buffer, 0 to 2
    RX_ENTRY_0,
    RX_ENTRY_1,
    RX_WAITING,  # 1 when a whole frame waits in the shift register
    RX_ENTRY_SHIFT,
    RX_OVERRUN,
    RX_LAST,
    # --- Input pipeline: what a pin does to peripherals, PIPE_DELAY cycles later ---
    PIPE_HEAD,
    PIPE_COUNT,
    # --- Queues: entries in use; the last two are taken from, too ---
    TX_COUNT,
    EDGE_COUNT,
    RX_HEAD,
    RX_TAIL,
    IN_HEAD,
    IN_TAIL,
    _CPU_END,
) = range(256, 256 + 68)

# --- When each source of events is due ----------------------------------------------------------------------
(
    DUE_TIMER0,
    DUE_TIMER1,
    DUE_TIMER2,
    DUE_TX,
    DUE_RX,
    DUE_PIPE,
    DUE_INPUT,
    DUE_CAPTURE,
    DUE_EEPROM,
    DUE_WATCHDOG,
    DUE_SPM,
    DUE_ADC,
) = range(_CPU_END, _CPU_END + 12)
DUE, DUE_SOURCES = DUE_TIMER0, 12

# --- Ports, one word each for B, C, D ------------------------------------------------------------------------
LEVEL = DUE + DUE_SOURCES  # electrical level of the pins now
LEVEL_BEFORE = LEVEL + 3  # their level before the last change
CHANGED_AT = LEVEL + 6  # cycle of the last change
DIRECTION = LEVEL + 9  # 1 where the chip drives the pin
OVERRIDE = LEVEL + 12  # 1 where a peripheral's output replaces PORTx
OVERRIDE_LEVEL = LEVEL + 15
FORCE_OUT = LEVEL + 18  # 1 where a peripheral overrides DDRx
FORCE_IN = LEVEL + 21
EXTERNAL = LEVEL + 24  # 1 where something outside drives the pin
EXTERNAL_LEVEL = LEVEL + 27
PIPE = LEVEL + 30  # PIPE_SLOTS pairs of (cycle, effects)
PIPE_SLOTS = 16
PIPE_DELAY = 3

# --- Timers: three blocks of the same fields -----------------------------------------------------------------
(
    F_SYNC,  # cycle up to which the counter is worked out
    F_COUNT,
    F_DOWN,  # 1 while counting down (dual slope)
    F_SHIFT,  # log2 of the prescaler's ratio, or CLOCK_STOPPED, CLOCK_RISING, CLOCK_FALLING
    F_OCR_A,  # the value compared with
    F_OCR_B,
    F_BUFFER_A,  # the value as written, copied to F_OCR_x at once or at TOP or BOTTOM
    F_BUFFER_B,
    F_ICR,
    F_MAX,
    F_SLOPE,
    F_TOP_SOURCE,
    F_TOP_FIXED,
    F_LOAD_AT,
    F_OVERFLOW_AT,
    F_COM_A,  # 0 not connected, 1 toggle, 2 and 3 as COMnx1:0
    F_COM_B,
    F_LATCH_A,  # the OCnx register
    F_LATCH_B,
    F_BLOCKED,  # 1 when a write to TCNTn blocks matches at the next timer clock
    F_PRESCALER,  # index of the prescaler's origin in the state
    F_HELD,
    F_DUE,
    F_TRIGGERS,  # bits of TIFRn that start a conversion of the ADC when they rise
    F_TIFR,
    F_TIMSK,
    F_TCCRA,
    F_TCCRB,
    F_PIN_A,
    F_PIN_B,
    _F_END,
) = range(31)
# Values of F_SHIFT below zero, F_SLOPE, F_TOP_SOURCE, F_LOAD_AT and F_OVERFLOW_AT.
CLOCK_STOPPED, CLOCK_FALLING, CLOCK_RISING = -1, -2, -3
SLOPE_COUNT, SLOPE_FAST, SLOPE_DUAL = 0, 1, 2
TOP_FIXED, TOP_OCR_A, TOP_ICR = 0, 1, 2
AT_ONCE, AT_TOP, AT_BOTTOM, AT_MAX = 0, 1, 2, 3

TIMER0 = constant(PIPE + 2 * PIPE_SLOTS)
TIMER1 = constant(TIMER0 + _F_END)
TIMER2 = constant(TIMER1 + _F_END)

PAGE_BUFFER = int(TIMER2) + _F_END
"""One word per word of the flash's temporary page buffer; EMPTY until it is filled."""
PAGE_WORDS = 64
EMPTY = -1

ADC_INPUT = PAGE_BUFFER + PAGE_WORDS
"""Microvolts on the ADC's eight channels and on AREF, or -1 where nothing outside drives them."""
ADC_INPUTS = 9

RAISED_AT = ADC_INPUT + ADC_INPUTS
"""One word per vector: the cycle at which its flag and its enable last came to stand both, while WATCH is 1."""
VECTORS = 26

TOUCHED = RAISED_AT + VECTORS
"""256 words, one per data address: 1 + PC of the first access when its part is not modelled, else 0."""
STATE_WORDS = TOUCHED + 256
"""What a snapshot has to copy of the state array; the queues are behind it."""
CONSTANTS = STATE_WORDS
"""256 words that hold 0 to 255: the second register of instructions with a constant."""
RESULT_FLAGS = CONSTANTS + 256
CARRY_FLAGS = RESULT_FLAGS + 256
SHIFT_FLAGS = CARRY_FLAGS + 512
"""SREG bits by result, by carries and by shifted value; see `tables`."""

# --- The loop that is watched (see `idle`); nothing that decides the run, so no snapshot has it --------------
(
    CHANGES,  # counts what could make one turn of a loop differ from the next, beside what is compared
    STORES,  # counts writes to the SRAM
    LAST_BACK,  # where the program last jumped back to
    WATCHED,  # head of the loop that is watched, or -1
    WATCH_SAW,  # 1 once the program came by there since the CPU loop last looked up
    WATCH_REST,  # how many more times the CPU loop looks up before another loop is watched
    WATCH_PENALTY,
    WATCH_STAMP,  # CHANGES when the record was made
    WATCH_TURNS,
    WATCH_NEXT,  # turns after which the record is made anew
    WATCH_CYCLE,  # cycle of the record
    WATCH_STORES,  # STORES then
    WATCH_SRAM,  # 1 when the SRAM is part of the record
    PASSED_OVER,  # cycles, in all
    # What this run waits for, set anew at each; no snapshot has it either
    TX_QUIET,  # cycles after the end of a frame sent, in which none follows, that end the run; 0: none do
    STOP_AT,  # the cycle at which it ends for that
    WATCH_RECORD,  # 38 words
) = range(SHIFT_FLAGS + 512, SHIFT_FLAGS + 512 + 17)
KEPT_SRAM = WATCH_RECORD + 38
"""256 words: the SRAM as it was."""

# --- Where the queues stand, and how many entries the first two may have ------------------------------------
(
    TX_BASE,
    TX_LIMIT,
    EDGE_BASE,
    EDGE_LIMIT,
    RX_BASE,
    IN_BASE,
    QUEUES,  # the first word behind all that
) = range(KEPT_SRAM + 256, KEPT_SRAM + 256 + 7)

TX_WIDTH, RX_WIDTH = 3, 4
"""Words per entry: sent frames (cycle, data, bit cycles), received ones (start, bit cycles * 2^16, bits, count)."""
BIT_FRACTION = 16
"""Fraction bits of the far end's bit time."""
