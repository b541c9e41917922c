"""What the input pipeline delivers: INT0 and INT1, pin changes, external timer clocks, input capture.

A change of a pin acts PIPE_DELAY = 3 cycles later: latch, two synchroniser stages, edge detector (datasheet,
13.1 and 17.2: 2.5 to 3.5 cycles for a change at any phase, 3 for one at the start of a cycle).
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inner  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    DUE_CAPTURE,
    DUE_PIPE,
    F_COUNT,
    F_ICR,
    F_SYNC,
    F_TRIGGERS,
    NEVER,
    PIPE,
    PIPE_COUNT,
    PIPE_HEAD,
    PIPE_SLOTS,
    TIMER0,
    TIMER1,
    State,
)
from planarm_sim.cpu.registers import ADCSRB, EIFR, PCIFR, TIFR1
from planarm_sim.peripherals.adc import ADTS, BY_INT0, trigger
from planarm_sim.peripherals.ports import EFFECT_CLOCK0, EFFECT_CLOCK1, EFFECT_INT0, EFFECT_INT1, EFFECT_PCI0
from planarm_sim.peripherals.timers import ICF, advance_timer, clock_timer, plan_timer


@inner
def deliver_inputs(st: State, cycle: int) -> None:
    """Take the oldest entry out of the input pipeline and act on it."""
    slot = PIPE + 2 * st[PIPE_HEAD]
    effects = st[slot + 1]
    st[PIPE_HEAD] = (st[PIPE_HEAD] + 1) % PIPE_SLOTS
    st[PIPE_COUNT] -= 1
    st[DUE_PIPE] = st[PIPE + 2 * st[PIPE_HEAD]] if st[PIPE_COUNT] else NEVER
    if effects & EFFECT_INT0 and not st[EIFR] & EFFECT_INT0 and st[ADCSRB] & ADTS == BY_INT0:
        trigger(st, cycle)
    st[EIFR] |= effects & (EFFECT_INT0 | EFFECT_INT1)
    st[PCIFR] |= (effects // EFFECT_PCI0) & 7
    if effects & EFFECT_CLOCK0:
        clock_from_pin(st, TIMER0, cycle)
    if effects & EFFECT_CLOCK1:
        clock_from_pin(st, TIMER1, cycle)


@inner
def clock_from_pin(st: State, t: int, cycle: int) -> None:
    """One clock of a timer that counts edges of its T pin."""
    clock_timer(st, t, cycle)
    st[t + F_SYNC] = cycle


@inner
def capture(st: State, cycle: int) -> None:
    """Copy TCNT1 to ICR1 and set ICF1 (datasheet, 16.6.1)."""
    st[DUE_CAPTURE] = NEVER
    advance_timer(st, TIMER1, cycle)
    st[TIMER1 + F_ICR] = st[TIMER1 + F_COUNT]
    if st[TIMER1 + F_TRIGGERS] & ICF & ~st[TIFR1]:
        trigger(st, cycle)
    st[TIFR1] |= ICF
    plan_timer(st, TIMER1)
