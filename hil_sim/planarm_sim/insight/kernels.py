"""Watches a program without a hook in the CPU loop: the chip runs at full speed from one landmark to the next.

Landmarks are words at which something begins or ends: interrupt vectors, first instructions of functions, returns,
SLEEP, and what moves the stack pointer (`roles.py`). The chip runs a copy of the decoded flash in which they are
undefined opcodes, which stop it before anything happens; the landmark is noted, its instruction runs alone, and the
chip goes on. What is noted stands in four arrays; their fields are named below.
"""

from __future__ import annotations

from planarm_sim.cpu.compiled import inner, kernel  # kernel_cache: see there
from planarm_sim.cpu.dispatch import run
from planarm_sim.cpu.interrupts import ENTRY_CYCLES, WAKE_CYCLES
from planarm_sim.cpu.layout import (
    ASLEEP,
    CYCLE,
    ENTERED_AT,
    ENTERED_VECTOR,
    PC,
    RAISED_AT,
    SP,
    SREG_BITS,
    Bytes,
    State,
)
from planarm_sim.cpu.registers import SPL, SRAM_START, SREG
from planarm_sim.cpu.service import AT_BAD_OPCODE, REACHED, TRAPPED

# What a word is, bits of its role.
FUNCTION, VECTOR, RETURN, SLEEPING, STACK, BREAKPOINT = 1, 2, 4, 8, 16, 32

LOG_FULL = 200
"""Result of `run_watched` beside those of `run`: Python must take the intervals away."""

# --- Fields of `totals` ---
(
    DEPTH,  # frames in use
    ASLEEP_SINCE,  # cycle at which SLEEP ended, or -1
    ASLEEP_CYCLES,
    NESTED,  # interrupts under way
    INTERRUPT_CYCLES,
    DEEPEST_SP,
    LOGGED,
    LOST_FRAMES,  # that the stack of frames had no room for
    PASSED_AT,  # cycle at which a breakpoint does not stop: the debugger goes on from there
    CHANGED,  # data address whose watched value changed, or -1
    TOTALS,
) = range(11)

# --- Fields of a frame: what runs on the stack from `FRAME_SP` down ---
(
    FRAME_SP,  # stack pointer just below its return address
    FRAME_FUNCTION,  # number of the function, or of none for an interrupt and for what calls main
    FRAME_VECTOR,  # 0 for a function
    FRAME_BEGAN,
    FRAME_CHILD,  # cycles of the functions it called, theirs included
    FRAME_AWAY,  # cycles of interrupts, and asleep
    FRAME_FLAG,  # cycle of the interrupt's request
    FRAME_ENTRY,  # cycles that entering took
    FRAME_WORDS,
) = range(9)
FRAMES = 256
NO_FUNCTION = -1
ABOVE_ALL = 1 << 30
"""FRAME_SP of the first frame: what runs before any function, and never returns."""

# --- Fields of a function's, and of an interrupt's, figures; the latter are followed by two histograms ---
CALLS, INCLUSIVE, SELF, FUNCTION_WORDS = range(4)
(
    COUNT,
    LATENCY_SUM,
    LATENCY_LEAST,
    LATENCY_MOST,
    DURATION_SUM,
    DURATION_LEAST,
    DURATION_MOST,
    ACKNOWLEDGED_AT,
    LEFT_AT,
    LATENCY_BINS,
) = range(10)
FINE_BINS, COARSE_BINS, COARSE = 4096, 1024, 8
"""Values below FINE_BINS have a bin each, those above one for 2^COARSE of them, and the last takes the rest."""
BINS = FINE_BINS + COARSE_BINS
DURATION_BINS = LATENCY_BINS + BINS
VECTOR_WORDS = DURATION_BINS + BINS
INTERVAL_WORDS = 5
"""Words per interval: vector, request, entry, exit, how many interrupts it lay in."""
LOG_MARGIN = FRAMES


@inner
def bin_of(value: int) -> int:
    """Bin of a number of cycles."""
    if value < FINE_BINS:
        return value
    return int(FINE_BINS + min((value - FINE_BINS) >> COARSE, COARSE_BINS - 1))


@kernel
def run_watched(
    st: State,
    memory: Bytes,
    words: State,
    code: State,
    landmarks: State,
    flash: Bytes,
    roles: State,
    totals: State,
    frames: State,
    functions: State,
    vectors: State,
    log: State,
    target: int,
) -> int:
    """Run as `dispatch.run` does, on `landmarks`, and note what is met; `code` has the instructions themselves."""
    while True:
        cause = run(st, memory, words, landmarks, flash, target)
        role = int(roles[st[PC]]) if cause == AT_BAD_OPCODE else 0
        if role == 0:
            return cause
        if role & BREAKPOINT and st[CYCLE] != totals[PASSED_AT]:
            return TRAPPED
        arrive(st, role, totals, frames, functions, vectors, log)
        cause = run(st, memory, words, code, flash, int(st[CYCLE]) + 1)
        leave(st, role, totals, frames, functions, vectors, log)
        if cause != REACHED:
            return cause
        if (totals[LOGGED] + LOG_MARGIN) * INTERVAL_WORDS > len(log):
            return LOG_FULL


@kernel
def run_to_change(
    st: State,
    memory: Bytes,
    words: State,
    code: State,
    landmarks: State,
    flash: Bytes,
    roles: State,
    totals: State,
    frames: State,
    functions: State,
    vectors: State,
    log: State,
    places: State,
    values: State,
    target: int,
) -> int:
    """Run as `run_watched` does, an instruction at a time, until one of the data addresses `places` changes."""
    while True:
        cause = run_watched(
            st,
            memory,
            words,
            code,
            landmarks,
            flash,
            roles,
            totals,
            frames,
            functions,
            vectors,
            log,
            min(int(st[CYCLE]) + 1, target),
        )
        for index in range(len(places)):
            value = data_byte(st, memory, int(places[index]))
            if value != values[index]:
                values[index] = value
                totals[CHANGED] = places[index]
        if cause != REACHED:
            return cause
        if totals[CHANGED] >= 0:
            return TRAPPED
        if st[CYCLE] >= target:
            return REACHED


@kernel
def data_byte(st: State, memory: Bytes, address: int) -> int:
    """A byte of the data space; an I/O register as it was last written."""
    if address >= SRAM_START:
        return int(memory[address - SRAM_START])
    if address == SREG:
        return int(st[SREG_BITS])
    if address in (SPL, SPL + 1):
        return int(st[SP] >> (8 * (address - SPL)) & 0xFF)
    return int(st[address])


@inner
def arrive(st: State, role: int, totals: State, frames: State, functions: State, vectors: State, log: State) -> None:
    """A landmark is reached; its instruction comes next."""
    sp = int(st[SP])
    now = int(st[CYCLE])
    if role & STACK == 0:  # else it may have one new byte and one old, and counts when the instruction has run
        totals[DEEPEST_SP] = min(totals[DEEPEST_SP], sp)
    if role & VECTOR and st[ENTERED_AT] == now:
        begin_interrupt(st, totals, frames, vectors)
    elif role & FUNCTION:
        end_frames(now, sp, totals, frames, functions, vectors, log)  # left by a longjmp, if there are any
        top = FRAME_WORDS * (totals[DEPTH] - 1)
        same = frames[top + FRAME_SP] == sp and frames[top + FRAME_VECTOR] == 0
        if same and frames[top + FRAME_FUNCTION] == role >> 8:
            return  # a loop that begins where the function does
        if same:
            end_function(now, totals, frames, functions)  # one jumped to the other, which returns for both
        begin_function(st, role >> 8, totals, frames, functions)


@inner
def leave(st: State, role: int, totals: State, frames: State, functions: State, vectors: State, log: State) -> None:
    """The instruction at a landmark has run."""
    sp = int(st[SP])
    if role & RETURN:
        end_frames(int(st[CYCLE]), sp, totals, frames, functions, vectors, log)
    elif role & STACK:
        totals[DEEPEST_SP] = min(totals[DEEPEST_SP], sp)
    elif role & SLEEPING and st[ASLEEP]:
        totals[ASLEEP_SINCE] = st[CYCLE]


@inner
def push_frame(st: State, function: int, vector: int, totals: State, frames: State) -> int:
    """Make a frame; returns where it is, or -1 when there is no room."""
    if totals[DEPTH] >= FRAMES:
        totals[LOST_FRAMES] += 1
        return -1
    at = int(FRAME_WORDS * totals[DEPTH])
    totals[DEPTH] += 1
    frames[at + FRAME_SP] = st[SP]
    frames[at + FRAME_FUNCTION] = function
    frames[at + FRAME_VECTOR] = vector
    frames[at + FRAME_BEGAN] = st[CYCLE]
    frames[at + FRAME_CHILD] = 0
    frames[at + FRAME_AWAY] = 0
    return at


@inner
def begin_function(st: State, function: int, totals: State, frames: State, functions: State) -> None:
    """A function is called."""
    if push_frame(st, function, 0, totals, frames) >= 0:
        functions[FUNCTION_WORDS * function + CALLS] += 1


@inner
def begin_interrupt(st: State, totals: State, frames: State, vectors: State) -> None:
    """An interrupt is taken: its first instruction, in the vector table, comes next."""
    now = int(st[CYCLE])
    entry = ENTRY_CYCLES
    if totals[ASLEEP_SINCE] >= 0:
        entry += WAKE_CYCLES
        slept = now - entry - totals[ASLEEP_SINCE]
        totals[ASLEEP_CYCLES] += slept
        frames[FRAME_WORDS * (totals[DEPTH] - 1) + FRAME_AWAY] += slept
        totals[ASLEEP_SINCE] = -1
    vector = int(st[ENTERED_VECTOR])
    at = push_frame(st, NO_FUNCTION, vector, totals, frames)
    if at < 0:
        return
    totals[NESTED] += 1
    v = VECTOR_WORDS * vector
    flag = st[RAISED_AT + vector]
    if flag <= vectors[v + ACKNOWLEDGED_AT]:  # the handler left the request standing
        flag = vectors[v + LEFT_AT]
    frames[at + FRAME_FLAG] = flag
    frames[at + FRAME_ENTRY] = entry
    vectors[v + ACKNOWLEDGED_AT] = now - entry


@kernel
def end_frames(now: int, sp: int, totals: State, frames: State, functions: State, vectors: State, log: State) -> None:
    """End whatever has its return address above the stack pointer `sp`: it was popped."""
    while frames[FRAME_WORDS * (totals[DEPTH] - 1) + FRAME_SP] < sp:
        if frames[FRAME_WORDS * (totals[DEPTH] - 1) + FRAME_VECTOR]:
            end_interrupt(now, totals, frames, vectors, log)
        else:
            end_function(now, totals, frames, functions)


@inner
def end_function(now: int, totals: State, frames: State, functions: State) -> None:
    """The function on top has returned."""
    totals[DEPTH] -= 1
    at = int(FRAME_WORDS * totals[DEPTH])
    inclusive = now - frames[at + FRAME_BEGAN] - frames[at + FRAME_AWAY]
    f = FUNCTION_WORDS * frames[at + FRAME_FUNCTION]
    functions[f + SELF] += inclusive - frames[at + FRAME_CHILD]
    if not is_within_itself(at, frames):
        functions[f + INCLUSIVE] += inclusive
    frames[at - FRAME_WORDS + FRAME_CHILD] += inclusive
    frames[at - FRAME_WORDS + FRAME_AWAY] += frames[at + FRAME_AWAY]


@inner
def is_within_itself(at: int, frames: State) -> bool:
    """Tell whether the function of the frame `at` was called by itself; then its first call counts for all."""
    below = at - FRAME_WORDS
    while below >= 0 and frames[below + FRAME_VECTOR] == 0:
        if frames[below + FRAME_FUNCTION] == frames[at + FRAME_FUNCTION]:
            return True
        below -= FRAME_WORDS
    return False


@inner
def end_interrupt(now: int, totals: State, frames: State, vectors: State, log: State) -> None:
    """The interrupt on top has returned."""
    totals[DEPTH] -= 1
    totals[NESTED] -= 1
    at = int(FRAME_WORDS * totals[DEPTH])
    began, entry, flag = frames[at + FRAME_BEGAN], frames[at + FRAME_ENTRY], frames[at + FRAME_FLAG]
    frames[at - FRAME_WORDS + FRAME_AWAY] += now - began + entry
    if totals[NESTED] == 0:
        totals[INTERRUPT_CYCLES] += now - began + entry
    v = VECTOR_WORDS * frames[at + FRAME_VECTOR]
    vectors[v + COUNT] += 1
    vectors[v + LEFT_AT] = now
    add_value(vectors, v + LATENCY_SUM, v + LATENCY_BINS, began - flag)
    add_value(vectors, v + DURATION_SUM, v + DURATION_BINS, now - began)
    entry_of_log = INTERVAL_WORDS * totals[LOGGED]
    log[entry_of_log] = frames[at + FRAME_VECTOR]
    log[entry_of_log + 1] = flag
    log[entry_of_log + 2] = began
    log[entry_of_log + 3] = now
    log[entry_of_log + 4] = totals[NESTED]
    totals[LOGGED] += 1


@inner
def add_value(vectors: State, at: int, bins: int, value: int) -> None:
    """Add to sum, least, most and histogram."""
    vectors[at] += value
    vectors[at + 1] = min(vectors[at + 1], value)
    vectors[at + 2] = max(vectors[at + 2], value)
    vectors[bins + bin_of(value)] += 1
