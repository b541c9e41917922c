"""Passing over loops in which a program only waits.

When a program comes round to the head of a loop in exactly the state in which it was there before, and nothing
beside instructions happened in between, it will go on doing so until something does, that is until the horizon. The
whole turns until then are passed over; what is left of the last one runs as ever. Nothing that can be seen changes:
registers, SREG, SP, SRAM and the program's own I/O registers were compared, byte for byte, and `CHANGES` counts
whatever else could make a difference (events, interrupts, writes, reads that depend on time or change something).

One loop is watched at a time: the one that the program jumped back to last before the CPU loop looked up. Turns are
compared after 1, 2, 4, ... of them (Brent), so that inner loops do no harm. A program that does not wait costs a few
comparisons before longer and longer rests.
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inlined, inner  # kernel_cache: see there
from planarm_sim.cpu.layout import (
    CHANGES,
    CYCLE,
    HORIZON,
    KEPT_SRAM,
    LAST_BACK,
    PASSED_OVER,
    SP,
    SREG_BITS,
    STORES,
    TEMP,
    WATCH_CYCLE,
    WATCH_NEXT,
    WATCH_PENALTY,
    WATCH_RECORD,
    WATCH_REST,
    WATCH_SAW,
    WATCH_SRAM,
    WATCH_STAMP,
    WATCH_STORES,
    WATCH_TURNS,
    WATCHED,
    State,
)
from planarm_sim.cpu.registers import GPIOR0, GPIOR1, GPIOR2, SRAM_END, SRAM_START

LEAST_ROOM = 48
"""Cycles to the horizon below which looking does not pay."""
MOST_TURNS = 24
"""Turns after which the program is taken not to wait."""
LONGEST_REST = 63
NOTHING = -1
"""WATCHED while no loop is watched."""
REGISTERS = 32
SRAM_WORDS = (SRAM_END - SRAM_START) // 8
OTHERS = (SREG_BITS, SP, TEMP, GPIOR0, GPIOR1, GPIOR2)
"""Words that an instruction changes without a note of an access."""


@inlined
def choose_loop(st: State) -> None:
    """The CPU loop has looked up: whatever was recorded is void, and another loop may be watched."""
    st[CHANGES] += 1
    if st[WATCH_REST] > 0:
        st[WATCH_REST] -= 1
    elif st[WATCH_SAW] == 0:
        st[WATCHED] = st[LAST_BACK]
    st[WATCH_SAW] = 0


@inner
def pass_over(st: State, words: State) -> None:
    """At the head of the watched loop: move CYCLE on by whole turns if the program only waits there.

    `words` begins with the SRAM, as int64 words.
    """
    cycle = st[CYCLE]
    room = st[HORIZON] - cycle
    if room < LEAST_ROOM:
        return
    st[WATCH_SAW] = 1
    if st[WATCH_STAMP] != st[CHANGES]:
        st[WATCH_STAMP] = st[CHANGES]
        st[WATCH_TURNS] = 0
        st[WATCH_NEXT] = 1
        record(st)
        return
    st[WATCH_TURNS] += 1
    if not same_words(st):
        if st[WATCH_TURNS] > MOST_TURNS:
            give_up(st)
        elif st[WATCH_TURNS] == st[WATCH_NEXT]:
            st[WATCH_NEXT] *= 2
            record(st)
    elif st[WATCH_STORES] == st[STORES] or (st[WATCH_SRAM] and same_contents(st, words)):
        st[WATCH_PENALTY] = 0
        turn = cycle - st[WATCH_CYCLE]
        st[CYCLE] += room // turn * turn
        st[PASSED_OVER] += room // turn * turn
    elif st[WATCH_TURNS] > MOST_TURNS:
        give_up(st)
    else:
        st[WATCH_SRAM] = 1
        st[WATCH_STORES] = st[STORES]
        st[WATCH_CYCLE] = cycle
        st[WATCH_NEXT] = 2 * st[WATCH_TURNS] + 2
        for n in range(SRAM_WORDS):
            st[KEPT_SRAM + n] = words[n]


@inlined
def record(st: State) -> None:
    """Keep the words that a turn must leave as they are; the SRAM only once they agree."""
    for n in range(REGISTERS):
        st[WATCH_RECORD + n] = st[n]
    for n in range(len(OTHERS)):
        st[WATCH_RECORD + REGISTERS + n] = st[OTHERS[n]]
    st[WATCH_CYCLE] = st[CYCLE]
    st[WATCH_STORES] = st[STORES]
    st[WATCH_SRAM] = 0


@inlined
def same_words(st: State) -> bool:
    """Tell whether all recorded words are as they were."""
    different = 0
    for n in range(REGISTERS):
        different |= st[WATCH_RECORD + n] ^ st[n]
    for n in range(len(OTHERS)):
        different |= st[WATCH_RECORD + REGISTERS + n] ^ st[OTHERS[n]]
    return bool(different == 0)


@inlined
def same_contents(st: State, words: State) -> bool:
    """Tell whether the SRAM is as it was."""
    different = 0
    for n in range(SRAM_WORDS):
        different |= st[KEPT_SRAM + n] ^ words[n]
    return bool(different == 0)


@inner
def give_up(st: State) -> None:
    """Watch nothing for a while, each time twice as long."""
    st[WATCH_PENALTY] = min(2 * st[WATCH_PENALTY] + 1, LONGEST_REST)
    st[WATCH_REST] = st[WATCH_PENALTY]
    st[WATCHED] = NOTHING
