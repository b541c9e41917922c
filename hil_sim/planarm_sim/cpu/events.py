"""Everything that happens beside instructions, in the order of time."""

from __future__ import annotations

from planarm_sim.cpu.compiled import inlined, inner  # kernel_cache: see there
from planarm_sim.cpu.interrupts import note_raised, pending_interrupts
from planarm_sim.cpu.layout import (
    BROKEN,
    DUE,
    DUE_ADC,
    DUE_CAPTURE,
    DUE_EEPROM,
    DUE_INPUT,
    DUE_PIPE,
    DUE_RX,
    DUE_SOURCES,
    DUE_SPM,
    DUE_TIMER2,
    DUE_TX,
    DUE_WATCHDOG,
    HORIZON,
    IN_BASE,
    IN_HEAD,
    IN_TAIL,
    NEVER,
    RESET_REQUEST,
    SOMETHING_CHANGED,
    TIMER0,
    TIMER1,
    TIMER2,
    WATCH,
    Bytes,
    State,
)
from planarm_sim.peripherals.adc import advance_adc
from planarm_sim.peripherals.eeprom import finish_write
from planarm_sim.peripherals.external import capture, deliver_inputs
from planarm_sim.peripherals.ports import drive_from_outside
from planarm_sim.peripherals.self_programming import end_command
from planarm_sim.peripherals.timers import advance_timer, plan_timer
from planarm_sim.peripherals.usart import end_frame, receive_event
from planarm_sim.peripherals.watchdog import watchdog_timeout

MOST_EVENTS = 1 << 20
"""Events within one instruction, or one look from outside, that no chip can have."""


@inlined
def next_event(st: State) -> int:
    """Cycle of the earliest event of all sources."""
    due = st[DUE]
    for source in range(1, DUE_SOURCES):
        due = min(due, st[DUE + source])
    return int(due)


@inlined
def process_events(st: State, memory: Bytes, until: int) -> int:
    """Let happen what is due up to and including the cycle `until`; return when the next event is due."""
    due = next_event(st)
    room = MOST_EVENTS
    while due <= until:
        room -= 1
        if room == 0:  # some source does not move on; `Chip` says so
            st[RESET_REQUEST] |= BROKEN
            st[HORIZON] = SOMETHING_CHANGED
            return NEVER
        source = DUE
        while st[source] != due:
            source += 1
        before = pending_interrupts(st) if st[WATCH] else 0
        happen(st, memory, source, due)
        if st[WATCH]:
            note_raised(st, before, due)
        st[HORIZON] = SOMETHING_CHANGED  # the CPU loop must look for interrupts at the next instruction
        due = next_event(st)
    return due


@inlined
def happen(st: State, memory: Bytes, source: int, cycle: int) -> None:
    """One event of one source."""
    if source <= DUE_TIMER2:
        t = TIMER1 if source == DUE + 1 else (TIMER0 if source == DUE else TIMER2)
        advance_timer(st, t, cycle)
        plan_timer(st, t)
    elif source == DUE_TX:
        end_frame(st, cycle)
    elif source == DUE_RX:
        receive_event(st, cycle)
    elif source == DUE_PIPE:
        deliver_inputs(st, cycle)
    elif source == DUE_INPUT:
        next_outside_drive(st, cycle)
    elif source == DUE_CAPTURE:
        capture(st, cycle)
    elif source == DUE_EEPROM:
        finish_write(st, memory)
    elif source == DUE_WATCHDOG:
        watchdog_timeout(st, cycle)
    elif source == DUE_SPM:
        end_command(st)
    elif source == DUE_ADC:
        advance_adc(st, cycle)


@inner
def next_outside_drive(st: State, cycle: int) -> None:
    """Apply the oldest queued outside drive: cycle << 8 | pin << 2 | kind."""
    entry = st[st[IN_BASE] + st[IN_HEAD]]
    st[IN_HEAD] += 1
    st[DUE_INPUT] = st[st[IN_BASE] + st[IN_HEAD]] >> 8 if st[IN_HEAD] < st[IN_TAIL] else NEVER
    drive_from_outside(st, (entry >> 2) & 63, entry & 3, cycle)
