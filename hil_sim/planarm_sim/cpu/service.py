"""What happens between two instructions: events, interrupts, sleep, and reasons to stop."""

from __future__ import annotations

from planarm_sim.cpu.access import LAST_READ, NOTHING, TURN, access_data, take_interrupt
from planarm_sim.cpu.compiled import inlined, inner, kernel  # kernel_cache: see there
from planarm_sim.cpu.events import next_event, process_events
from planarm_sim.cpu.flags import I
from planarm_sim.cpu.idle import choose_loop, pass_over
from planarm_sim.cpu.interrupts import lowest_bit, pending_interrupts
from planarm_sim.cpu.layout import (
    ACCESS,
    ASLEEP,
    CYCLE,
    EDGE_COUNT,
    EDGE_LIMIT,
    HORIZON,
    IRQ_EARLIEST,
    LOOK_AT,
    NEVER,
    PENDING,
    RESET_REQUEST,
    SOMETHING_CHANGED,
    SREG_BITS,
    STOP_AT,
    TX_COUNT,
    TX_LIMIT,
    UNKNOWN,
    Bytes,
    State,
)

# Results of `service`: go on, take interrupt vector n (n is 1 to 25), or why the CPU loop ends.
RUNNING = 0
REACHED, AT_BREAK, AT_BAD_OPCODE, ASLEEP_FOR_EVER, LOG_FULL, RESET_WANTED, FLASH_WRITE, TRAPPED = range(100, 108)
FIRST_STOP = REACHED


@inner
def look_up(st: State, memory: Bytes, words: State, target: int) -> int:
    """All that happens between the instruction that has ended at CYCLE and the next one at PC.

    `words` is `memory` as int64 words. Returns RUNNING with LOOK_AT set, or why the CPU loop ends.
    """
    access = st[ACCESS]
    if access == TURN:
        st[ACCESS] = NOTHING
        pass_over(st, words)
    elif access != NOTHING:
        until = st[CYCLE] - 1 if access <= LAST_READ else st[CYCLE]
        if until >= st[HORIZON]:  # no event is due before the horizon
            process_events(st, memory, until)
        access_data(st, memory)
    if st[CYCLE] >= st[HORIZON]:
        while True:
            cause = service(st, memory, target)
            if not RUNNING < cause < FIRST_STOP:
                break
            take_interrupt(st, memory, cause)
        if cause != RUNNING:
            return int(cause)
        choose_loop(st)
    st[LOOK_AT] = st[HORIZON]
    return RUNNING


@inlined
def service(st: State, memory: Bytes, target: int) -> int:
    """Let happen what is due; RUNNING with HORIZON set when the CPU goes on, else a vector or a stop."""
    while True:
        cycle = int(st[CYCLE])
        due = process_events(st, memory, cycle)
        if st[RESET_REQUEST]:
            return RESET_WANTED
        end = min(target, int(st[STOP_AT]))
        if cycle >= end:
            return REACHED
        if st[EDGE_COUNT] >= st[EDGE_LIMIT] or st[TX_COUNT] >= st[TX_LIMIT]:
            return LOG_FULL
        horizon = min(due, end)
        enabled = st[SREG_BITS] & I
        if enabled:
            pending = pending_interrupts(st)
            st[PENDING] = pending
            if pending:
                if cycle >= st[IRQ_EARLIEST]:
                    return lowest_bit(pending)
                horizon = min(horizon, int(st[IRQ_EARLIEST]))
        elif st[HORIZON] == SOMETHING_CHANGED:
            st[PENDING] = UNKNOWN
        if not st[ASLEEP]:
            st[HORIZON] = horizon
            return RUNNING
        if not enabled and due == NEVER:
            return ASLEEP_FOR_EVER
        st[CYCLE] = horizon


@kernel
def stand_still(st: State, memory: Bytes, until: int) -> int:
    """Let time pass up to the cycle `until` while the CPU is halted; REACHED, or what must be seen to before."""
    while True:
        due = next_event(st)
        if due > until:
            st[CYCLE] = until
            return REACHED
        st[CYCLE] = max(st[CYCLE], due)
        process_events(st, memory, due)
        if st[RESET_REQUEST]:
            return RESET_WANTED
        if st[EDGE_COUNT] >= st[EDGE_LIMIT] or st[TX_COUNT] >= st[TX_LIMIT]:
            return LOG_FULL
