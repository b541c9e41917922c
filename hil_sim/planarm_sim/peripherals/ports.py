"""Ports B, C and D: what drives each pin, its level, and who is told when it changes.

ATmega328P datasheet, chapter 14. A pin follows, in this order: a peripheral's override, PORTx where DDRx is
set, the outside, the pull-up, else 0. PINx shows the level one cycle late (figures 14-3 and 14-4: an OUT is
seen by an IN only with one instruction between them).
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import constant, inlined, inner, kernel  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    CHANGED_AT,
    CHANGES,
    CLOCK_FALLING,
    CLOCK_RISING,
    DIRECTION,
    DUE_CAPTURE,
    DUE_PIPE,
    EDGE_BASE,
    EDGE_COUNT,
    EDGE_LIMIT,
    EXTERNAL,
    EXTERNAL_LEVEL,
    F_SHIFT,
    F_TOP_SOURCE,
    FORCE_IN,
    FORCE_OUT,
    HORIZON,
    LEVEL,
    LEVEL_BEFORE,
    NEVER,
    OVERRIDE,
    OVERRIDE_LEVEL,
    PIPE,
    PIPE_COUNT,
    PIPE_DELAY,
    PIPE_HEAD,
    PIPE_SLOTS,
    SOMETHING_CHANGED,
    TIMER0,
    TIMER1,
    TOP_ICR,
    State,
)
from planarm_sim.cpu.registers import DDRB, EICRA, MCUCR, PCMSK0, PINB, PORTB, PRR, TCCR1B

# Effects of a pin change that wait in the input pipeline.
EFFECT_INT0, EFFECT_INT1, EFFECT_PCI0 = 1, 2, 4  # and 8, 16 for pin-change groups 1 and 2
EFFECT_CLOCK0, EFFECT_CLOCK1, EFFECT_CAPTURE, EFFECT_LEVEL = 32, 64, 128, 256

PRTIM1 = 1 << 3  # PRR: timer 1 is switched off
PUD = 1 << 4  # MCUCR: pull-ups off everywhere
ICNC1, ICES1 = 1 << 7, 1 << 6  # TCCR1B
CAPTURE_FILTER_CYCLES = 4  # the noise canceller wants four equal samples (datasheet, 16.6.2)
PORT_B, PORT_D = constant(0), constant(2)
CAPTURE_PIN, CLOCK0_PIN, CLOCK1_PIN = 1 << 0, 1 << 4, 1 << 5  # PB0, PD4, PD5
INT0_PIN = 1 << 2  # PD2; INT1 is PD3


@inlined
def log_edge(st: State, cycle: int, pin: int, level: int) -> None:
    """Log an edge that the chip made, by driving or pulling up; stop the CPU loop when the log is nearly full."""
    count = st[EDGE_COUNT]
    st[st[EDGE_BASE] + count] = (cycle << 8) | (pin << 1) | level
    st[EDGE_COUNT] = count + 1
    if count + 1 >= st[EDGE_LIMIT]:
        st[HORIZON] = SOMETHING_CHANGED


@kernel
def refresh_port(st: State, port: int, cycle: int) -> None:
    """Work out the levels of a port's pins after something that drives them changed at `cycle`."""
    override = st[OVERRIDE + port]
    latch = st[PORTB + 3 * port]
    driven = (latch & ~override) | (st[OVERRIDE_LEVEL + port] & override)
    direction = (st[DDRB + 3 * port] | st[FORCE_OUT + port]) & ~st[FORCE_IN + port]
    outside = st[EXTERNAL + port]
    pull_up = 0 if st[MCUCR] & PUD else latch
    passive = (st[EXTERNAL_LEVEL + port] & outside) | (pull_up & ~outside)
    level = (driven & direction) | (passive & ~direction)
    before = st[LEVEL + port]
    changed = before ^ level
    if changed != 0:
        if st[CHANGED_AT + port] != cycle:
            st[LEVEL_BEFORE + port] = before
            st[CHANGED_AT + port] = cycle
        st[LEVEL + port] = level
        logged = changed & (direction | st[DIRECTION + port] | ~outside)  # pull-ups are seen outside, too
        bit = 0
        while logged != 0:
            if logged & 1:
                log_edge(st, cycle, 8 * port + bit, (level >> bit) & 1)
            logged >>= 1
            bit += 1
        notify_inputs(st, port, changed, level, cycle)
    st[DIRECTION + port] = direction


@inlined
def notify_inputs(st: State, port: int, changed: int, level: int, cycle: int) -> None:
    """Send what a change of levels means to peripherals into the input pipeline."""
    effects = 0
    if changed & st[PCMSK0 + port]:
        effects = EFFECT_PCI0 << port
    if port == PORT_D:
        sense = st[EICRA]
        for number in range(2):
            pin = INT0_PIN << number
            if changed & pin:
                effects |= edge_effect((sense >> (2 * number)) & 3, level & pin, EFFECT_INT0 << number)
        if changed & CLOCK0_PIN and clocks(st[TIMER0 + F_SHIFT], level & CLOCK0_PIN):
            effects |= EFFECT_CLOCK0
        if changed & CLOCK1_PIN and clocks(st[TIMER1 + F_SHIFT], level & CLOCK1_PIN):
            effects |= EFFECT_CLOCK1
    elif port == PORT_B and changed & CAPTURE_PIN and st[TIMER1 + F_TOP_SOURCE] != TOP_ICR and not st[PRR] & PRTIM1:
        schedule_capture(st, level & CAPTURE_PIN, cycle)
    if effects != 0:
        slot = PIPE + 2 * ((st[PIPE_HEAD] + st[PIPE_COUNT]) % PIPE_SLOTS)
        st[slot] = cycle + PIPE_DELAY
        st[slot + 1] = effects
        st[PIPE_COUNT] += 1
        if st[PIPE_COUNT] == 1:
            st[DUE_PIPE] = cycle + PIPE_DELAY
            st[HORIZON] = min(st[HORIZON], cycle + PIPE_DELAY)


@inner
def edge_effect(sense: int, level: int, effect: int) -> int:
    """Effect of a change of INT0 or INT1 under its ISCn1:0 bits (datasheet, table 13-1)."""
    if sense == 0:
        return EFFECT_LEVEL
    if sense == 1 or (sense == 2) == (level == 0):
        return effect
    return 0


@inner
def clocks(shift: int, level: int) -> bool:
    """Tell whether a timer on an external clock counts this edge."""
    return shift == CLOCK_RISING if level else shift == CLOCK_FALLING


@inlined
def schedule_capture(st: State, level: int, cycle: int) -> None:
    """An edge of ICP1: capture after the synchroniser and, when on, the noise canceller."""
    wanted = (level != 0) == (st[TCCR1B] & ICES1 != 0)
    filtered = st[TCCR1B] & ICNC1
    if wanted:
        due = cycle + PIPE_DELAY + (CAPTURE_FILTER_CYCLES if filtered else 0)
        st[DUE_CAPTURE] = due
        st[HORIZON] = min(st[HORIZON], due)
    elif filtered and cycle < st[DUE_CAPTURE] - PIPE_DELAY:
        st[DUE_CAPTURE] = NEVER


@inlined
def read_pins(st: State, port: int, cycle: int) -> int:
    """PINx as the CPU reads it in the clock cycle that begins at `cycle`: the levels one cycle before."""
    if st[CHANGED_AT + port] >= cycle:
        st[CHANGES] += 1
        return int(st[LEVEL_BEFORE + port])
    return int(st[LEVEL + port])


@inlined
def write_port(st: State, address: int, value: int, cycle: int) -> None:
    """Write PINx (toggles), DDRx or PORTx; takes effect at `cycle`, the end of the instruction."""
    port = (address - PINB) // 3
    what = (address - PINB) % 3
    if what == 0:
        st[PORTB + 3 * port] ^= value
    else:
        st[address] = value
    refresh_port(st, port, cycle)


@inner
def set_override(st: State, pin: int, connected: bool, level: bool, cycle: int) -> None:
    """Connect a peripheral's output to a pin in place of PORTx, or disconnect it."""
    port = pin >> 3
    mask = 1 << (pin & 7)
    if connected:
        st[OVERRIDE + port] |= mask
    else:
        st[OVERRIDE + port] &= ~mask
    if level:
        st[OVERRIDE_LEVEL + port] |= mask
    else:
        st[OVERRIDE_LEVEL + port] &= ~mask
    refresh_port(st, port, cycle)


@kernel
def drive_from_outside(st: State, pin: int, kind: int, cycle: int) -> None:
    """Apply an outside drive: `kind` 0 low, 1 high, 2 let go."""
    port = pin >> 3
    mask = 1 << (pin & 7)
    if kind == 2:
        st[EXTERNAL + port] &= ~mask
    else:
        st[EXTERNAL + port] |= mask
        if kind == 1:
            st[EXTERNAL_LEVEL + port] |= mask
        else:
            st[EXTERNAL_LEVEL + port] &= ~mask
    refresh_port(st, port, cycle)
