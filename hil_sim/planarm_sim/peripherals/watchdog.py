"""Watchdog timer: interrupt, reset, or one after the other (ATmega328P datasheet, 11.8 and 11.9.2).

Its own 128 kHz oscillator is taken as exact: 2^(11 + WDP) of its periods, 125 CPU cycles each.
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inner, kernel  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    DUE_WATCHDOG,
    HORIZON,
    NEVER,
    RESET_REQUEST,
    WDT_CHANGE_UNTIL,
    WDT_ORIGIN,
    State,
)
from planarm_sim.cpu.registers import MCUSR, WDTCSR

WDIF, WDIE, WDCE, WDE = 1 << 7, 1 << 6, 1 << 4, 1 << 3
WDP = 0x27
WDRF = 1 << 3  # MCUSR
SHORTEST_CYCLES = 2048 * 125  # 16 ms
LONGEST_SETTING = 9  # 8 s; higher settings are reserved
CHANGE_CYCLES = 4


@kernel
def plan_watchdog(st: State, cycle: int) -> None:
    """Note when the watchdog times out, counted from its last restart."""
    control = st[WDTCSR]
    if control & (WDIE | WDE):
        setting = min((control & 7) | ((control >> 2) & 8), LONGEST_SETTING)
        st[DUE_WATCHDOG] = max(st[WDT_ORIGIN] + (SHORTEST_CYCLES << setting), cycle)
        st[HORIZON] = min(st[HORIZON], st[DUE_WATCHDOG])
    else:
        st[DUE_WATCHDOG] = NEVER


@inner
def restart_watchdog(st: State, cycle: int) -> None:
    """WDR: count from zero again."""
    st[WDT_ORIGIN] = cycle
    plan_watchdog(st, cycle)


@inner
def write_watchdog(st: State, value: int, cycle: int) -> None:
    """Write WDTCSR: WDE and WDP change only within four cycles of a write of WDCE and WDE together."""
    before = st[WDTCSR]
    running = before & (WDIE | WDE)
    kept = before & (WDE | WDP)
    if value & WDCE and value & WDE:
        st[WDT_CHANGE_UNTIL] = cycle + CHANGE_CYCLES
        kept |= WDE
    elif cycle <= st[WDT_CHANGE_UNTIL]:
        st[WDT_CHANGE_UNTIL] = 0
        kept = value & (WDE | WDP)
    else:
        kept |= value & WDE
    if st[MCUSR] & WDRF:
        kept |= WDE
    st[WDTCSR] = kept | (value & WDIE) | (before & WDIF & ~value)
    if not running:
        st[WDT_ORIGIN] = cycle
    plan_watchdog(st, cycle)


@inner
def watchdog_timeout(st: State, cycle: int) -> None:
    """Raise the interrupt flag, or ask for a reset.

    An interrupt that was not executed before the next time-out resets, too (11.9.2, bit WDIE): so in interrupt and
    system reset mode; interrupts alone never reset (table 11-1).
    """
    unanswered = st[WDTCSR] & (WDIF | WDE) == WDIF | WDE
    if st[WDTCSR] & WDIE and not unanswered:
        st[WDTCSR] |= WDIF
        st[WDT_ORIGIN] = cycle
        plan_watchdog(st, cycle)
    else:
        st[RESET_REQUEST] = WDRF
        st[DUE_WATCHDOG] = NEVER
